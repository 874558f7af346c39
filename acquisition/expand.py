"""From a recipe to steps: the only place that decides what is done in which order, and how long it takes."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field

from acquisition.analyzer_matrix import AnalyzerState
from acquisition.readings import ReadingKind
from acquisition.recipe import Recipe, Reference
from acquisition.timing import POLL_S, AnalyzerTiming, BenchTiming


@dataclass(frozen=True)
class Slots:
    """Which analyzer slot holds what.

    `polarizers` are slots by the angle that a recipe names; `retarded` are those with a retarder, by number, with
    the angles that a recipe names. Beside them there are the blocked and the open slot.
    """

    polarizers: Mapping[float, int]
    offset_deg: float
    blocked: int | None
    open: int | None
    retarded: Mapping[int, AnalyzerState] = field(default_factory=dict)

    def signal(self, polarizer_deg: float, retarder_deg: float | None) -> tuple[int, AnalyzerState]:
        """The slot with these angles, and the analyzer's state there, from the s-direction."""
        if retarder_deg is None:
            return self.polarizers[polarizer_deg], AnalyzerState(polarizer_deg + self.offset_deg)
        named = (polarizer_deg, retarder_deg)
        slot, state = next(
            (slot, state) for slot, state in self.retarded.items() if (state.polarizer_deg, state.retarder_deg) == named
        )
        return slot, AnalyzerState(
            polarizer_deg + self.offset_deg, retarder_deg + self.offset_deg, state.retardance_deg
        )


@dataclass(frozen=True)
class Target:
    """Where the bench stands: three angles in degrees and the analyzer's slot."""

    incidence_deg: float
    exit_deg: float
    azimuth_deg: float
    slot: int

    @property
    def axes_deg(self) -> dict[str, float]:
        """Where the axes stand, by role."""
        return {
            "source_arm": self.incidence_deg,
            "detector_arm": self.exit_deg,
            "sample_azimuth": self.azimuth_deg,
        }


HOME = Target(0.0, 0.0, 0.0, 1)
"""Where a bench is taken to stand before its first step."""


@dataclass(frozen=True)
class Step:
    """One place of the bench and the readings taken there, `reading_s` each of the whole `duration_s`."""

    point: int
    kind: ReadingKind
    target: Target
    analyzer_deg: float | None
    readings: int
    exposure_s: float
    duration_s: float
    retarder_deg: float | None = None
    retardance_deg: float | None = None
    reading_s: float = 0.0

    @property
    def analyzer(self) -> AnalyzerState:
        """What the light passes."""
        return AnalyzerState(self.analyzer_deg, self.retarder_deg, self.retardance_deg)


_Place = tuple[ReadingKind, Target, AnalyzerState]
_Stop = tuple[int, ReadingKind, AnalyzerState]


def expand(recipe: Recipe, slots: Slots, timing: BenchTiming) -> tuple[Step, ...]:
    """Turn a recipe into its steps, with the arms taking the directions in the recipe's order.

    Parameters
    ----------
    recipe : Recipe
        What to measure.
    slots : Slots
        What the rig's analyzer holds.
    timing : BenchTiming
        Speeds of the rig, from which every step's duration follows.

    Returns
    -------
    tuple of Step
        `duration_s` of a step counts its moves, settling, position checks and readings. With a reference in the recipe
        the last step reads it once more, so that every direction stands between two references.
    """
    visits = Visits(recipe, slots, timing)
    steps: list[Step] = []
    directions = zip(recipe.exit_angles_deg(), recipe.readings_of_angles(), strict=True)
    for point, (exit_deg, readings) in enumerate(directions):
        here = steps[-1].target if steps else HOME
        steps += visits.steps(point, exit_deg, readings, here)
    return (*steps, *visits.closing(steps[-1].point, steps[-1].target))


class Visits:
    """Steps of one direction at a time, from wherever the bench stands.

    At each direction the analyzer runs through its slots from whichever end is nearer to where it stands (the wheel
    snakes).

    Parameters
    ----------
    recipe, slots, timing
        As for `expand`.
    """

    def __init__(self, recipe: Recipe, slots: Slots, timing: BenchTiming) -> None:
        self._recipe, self._slots, self._timing = recipe, slots, timing
        self._tour = _tour(recipe, slots, timing.analyzer)

    def steps(self, point: int, exit_deg: float, readings: int, here: Target) -> tuple[Step, ...]:
        """The steps that measure an exit angle with so many readings in every slot, as the point of this number."""
        return self._timed(point, readings, here, self._places(point, exit_deg, here))

    def closing(self, point: int, here: Target) -> tuple[Step, ...]:
        """The reference that closes a scan behind its last point; none for a recipe without references."""
        if self._recipe.reference is None:
            return ()
        return self._timed(
            point, self._recipe.readings_of_angles()[-1], here, [self._reference(self._recipe.reference)]
        )

    def closing_s(self) -> float:
        """The longest time that `closing` may take, from wherever a direction leaves the bench."""
        ends = [
            Target(self._recipe.incidence_deg, exit_deg, self._recipe.azimuth_deg, slot)
            for exit_deg in set(self._recipe.exit_angles_deg())
            for slot, _, _ in (self._tour[0], self._tour[-1])
        ]
        return max(sum(step.duration_s for step in self.closing(0, end)) for end in ends)

    def _timed(self, point: int, readings: int, here: Target, places: Iterable[_Place]) -> tuple[Step, ...]:
        steps, exposure_s = [], self._recipe.exposure_s
        reading_s = self._timing.reading_s(exposure_s)
        for kind, there, state in places:
            duration_s = _moving_s(here, there, self._timing) + readings * reading_s
            steps.append(
                Step(
                    *(point, kind, there, state.polarizer_deg, readings, exposure_s, duration_s),
                    *(state.retarder_deg, state.retardance_deg, reading_s),
                )
            )
            here = there
        return tuple(steps)

    def _places(self, point: int, exit_deg: float, here: Target) -> Iterator[_Place]:
        recipe, analyzer, slot = self._recipe, self._timing.analyzer, here.slot
        if recipe.reference is not None and point % recipe.reference.every_points == 0:
            place = self._reference(recipe.reference)
            yield place
            slot = place[1].slot
        tour = self._tour
        if analyzer.move_s(slot, tour[-1][0]) < analyzer.move_s(slot, tour[0][0]):
            tour = tour[::-1]
        for slot, kind, state in tour:
            yield kind, Target(recipe.incidence_deg, exit_deg, recipe.azimuth_deg, slot), state

    def _reference(self, reference: Reference) -> _Place:
        assert self._slots.open is not None, "a recipe with a reference is only accepted with an open slot"
        place = Target(self._recipe.incidence_deg, reference.exit_deg, self._recipe.azimuth_deg, self._slots.open)
        return "reference", place, AnalyzerState()


def _tour(recipe: Recipe, slots: Slots, analyzer: AnalyzerTiming) -> list[_Stop]:
    """The slots of one point in the order, round the wheel or along the angles, that takes the least time."""
    stops: list[_Stop] = []
    for polarizer_deg, retarder_deg in recipe.settings():
        slot, state = slots.signal(polarizer_deg, retarder_deg)
        stops.append((slot, "signal", state))
    if recipe.dark:
        assert slots.blocked is not None, "a recipe with dark readings is only accepted with a blocked slot"
        stops.append((slots.blocked, "dark", AnalyzerState()))

    def time_s(tour: list[_Stop]) -> float:
        return sum(analyzer.move_s(here[0], there[0]) for here, there in itertools.pairwise(tour))

    in_order = (
        sorted(stops, key=lambda stop: stop[0]),
        sorted(stops, key=lambda stop: stop[2].polarizer_deg or 0.0),
        sorted(stops, key=lambda stop: stop[2].retarder_deg or 0.0),
    )
    return min((order[first:] + order[:first] for order in in_order for first in range(len(stops))), key=time_s)


def _moving_s(here: Target, there: Target, timing: BenchTiming) -> float:
    ways = (
        (timing.source_arm, there.incidence_deg - here.incidence_deg),
        (timing.detector_arm, there.exit_deg - here.exit_deg),
        (timing.sample_azimuth, there.azimuth_deg - here.azimuth_deg),
    )
    checks_s = 2 * (timing.analyzer.exchange_s + sum(axis.exchange_s for axis, _ in ways))
    going = [axis for axis, way in ways if way]
    settles_s = [axis.settle_s for axis in going]
    moving_s = timing.axes_s(here.axes_deg, there.axes_deg) + sum(axis.start_s for axis in going)
    asking_s = sum(axis.exchange_s for axis in going)
    if here.slot != there.slot:
        moving_s = max(moving_s, timing.analyzer.move_s(here.slot, there.slot))
        settles_s.append(timing.analyzer.settle_s)
        asking_s += timing.analyzer.exchange_s
    if not settles_s:
        return checks_s
    return checks_s + moving_s + POLL_S / 2 + asking_s + max(settles_s)
