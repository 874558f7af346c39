"""From a recipe to steps: the only place that decides what is done in which order, and how long it takes."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from acquisition.readings import ReadingKind
from acquisition.recipe import Recipe
from acquisition.timing import POLL_S, AnalyzerTiming, BenchTiming


@dataclass(frozen=True)
class Slots:
    """Which analyzer slot holds what: `polarizers` by the angle a recipe names, and the blocked and open slots."""

    polarizers: Mapping[float, int]
    offset_deg: float
    blocked: int | None
    open: int | None


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
    """One place of the bench and the readings taken there."""

    point: int
    kind: ReadingKind
    target: Target
    analyzer_deg: float | None
    readings: int
    exposure_s: float
    duration_s: float


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
        `duration_s` of a step counts its moves, settling, position checks and readings.
    """
    visits = Visits(recipe, slots, timing)
    steps: list[Step] = []
    directions = zip(recipe.exit_angles_deg(), recipe.readings_of_angles(), strict=True)
    for point, (exit_deg, readings) in enumerate(directions):
        here = steps[-1].target if steps else HOME
        steps += visits.steps(point, exit_deg, readings, here)
    return tuple(steps)


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
        recipe, steps = self._recipe, []
        reading_s = self._timing.reading_s(recipe.exposure_s)
        for kind, there, analyzer_deg, taken in self._places(point, exit_deg, readings, here):
            duration_s = _moving_s(here, there, self._timing) + taken * reading_s
            steps.append(Step(point, kind, there, analyzer_deg, taken, recipe.exposure_s, duration_s))
            here = there
        return tuple(steps)

    def _places(
        self, point: int, exit_deg: float, readings: int, here: Target
    ) -> Iterator[tuple[ReadingKind, Target, float | None, int]]:
        recipe, analyzer, slot = self._recipe, self._timing.analyzer, here.slot
        if recipe.reference is not None and point % recipe.reference.every_points == 0:
            assert self._slots.open is not None, "a recipe with a reference is only accepted with an open slot"
            slot = self._slots.open
            place = Target(recipe.incidence_deg, recipe.reference.exit_deg, recipe.azimuth_deg, slot)
            yield "reference", place, None, readings
        tour = self._tour
        if analyzer.move_s(slot, tour[-1][0]) < analyzer.move_s(slot, tour[0][0]):
            tour = tour[::-1]
        for slot, kind, analyzer_deg in tour:
            yield kind, Target(recipe.incidence_deg, exit_deg, recipe.azimuth_deg, slot), analyzer_deg, readings


def _tour(recipe: Recipe, slots: Slots, analyzer: AnalyzerTiming) -> list[tuple[int, ReadingKind, float | None]]:
    """The slots of one point in the order, round the wheel or along the angles, that takes the least time."""
    stops: list[tuple[int, ReadingKind, float | None]] = [
        (slots.polarizers[angle], "signal", angle + slots.offset_deg) for angle in recipe.analyzer_deg
    ]
    if recipe.dark:
        assert slots.blocked is not None, "a recipe with dark readings is only accepted with a blocked slot"
        stops.append((slots.blocked, "dark", None))

    def time_s(tour: list[tuple[int, ReadingKind, float | None]]) -> float:
        return sum(analyzer.move_s(here[0], there[0]) for here, there in itertools.pairwise(tour))

    in_order = (sorted(stops, key=lambda stop: stop[0]), sorted(stops, key=lambda stop: stop[2] or 0.0))
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
