"""The steps of a single direction, with all of its slots in one go, and of a reference."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator

from acquisition.analyzer_matrix import AnalyzerState
from acquisition.moving import Moving
from acquisition.readings import ReadingKind
from acquisition.recipe import Recipe, Reference
from acquisition.steps import Slots, Step, Target
from acquisition.timing import AnalyzerTiming, BenchTiming

_Place = tuple[ReadingKind, Target, AnalyzerState]
Stop = tuple[int, ReadingKind, AnalyzerState]
"""A slot, what is read there, and what the light then passes."""


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
        self._tour = shortest_tour(recipe, slots, timing.analyzer)
        self._moving_s = Moving(timing)
        self._incidence_deg, _, self._azimuth_deg, self._exit_azimuth_deg = recipe.directions_deg()[0].tolist()

    def steps(self, point: int, exit_deg: float, readings: int, here: Target) -> tuple[Step, ...]:
        """The steps that measure an exit angle with so many readings in every slot, as the point of this number."""
        return self._timed(point, readings, here, self._places(point, exit_deg, here))

    def closing(self, point: int, here: Target) -> tuple[Step, ...]:
        """The reference that closes a scan behind its last point; none for a recipe without references."""
        if self._recipe.reference is None:
            return ()
        return self.reference(point, self._recipe.readings_of_angles()[-1], here)

    def reference(self, point: int, readings: int, here: Target) -> tuple[Step, ...]:
        """The reference that belongs to a point; for a recipe with references."""
        assert self._recipe.reference is not None, "asked only of a recipe with references"
        return self._timed(point, readings, here, [self._reference(self._recipe.reference)])

    def closing_s(self) -> float:
        """The longest time that `closing` may take, from wherever a direction leaves the bench."""
        ends = [
            self._target(exit_deg, slot)
            for exit_deg in set(self._recipe.exit_angles_deg())
            for slot, _, _ in (self._tour[0], self._tour[-1])
        ]
        return max(sum(step.duration_s for step in self.closing(0, end)) for end in ends)

    def _timed(self, point: int, readings: int, here: Target, places: Iterable[_Place]) -> tuple[Step, ...]:
        steps, exposure_s = [], self._recipe.exposure_s
        reading_s = self._timing.reading_s(exposure_s)
        for kind, there, state in places:
            duration_s = self._moving_s(here, there) + self._timing.readings_s(readings, exposure_s)
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
            yield kind, self._target(exit_deg, slot), state

    def _target(self, exit_deg: float, slot: int) -> Target:
        """In the plane of the recipe's first direction, which is the only one of a scan that decides as it goes."""
        return Target(self._incidence_deg, exit_deg, self._azimuth_deg, slot, self._exit_azimuth_deg)

    def _reference(self, reference: Reference) -> _Place:
        assert self._slots.open is not None, "a recipe with a reference is only accepted with an open slot"
        # in the plane of incidence, where the light is that follows the lamp best
        place = Target(self._incidence_deg, reference.exit_deg, self._azimuth_deg, self._slots.open)
        return "reference", place, AnalyzerState()


def tours(recipe: Recipe, slots: Slots, analyzer: AnalyzerTiming) -> tuple[list[Stop], list[Stop]]:
    """The slots of one point in two orders, one opposite to the other.

    Where each slot is read until it is known well enough, the dark slot is the last of both: how often it is read
    follows from the others.
    """
    tour = shortest_tour(recipe, slots, analyzer)
    if recipe.averaging is None or recipe.averaging.signal_to_noise is None or not recipe.dark:
        return tour, tour[::-1]
    dark = [stop for stop in tour if stop[1] == "dark"]
    lit = shortest_tour(recipe.model_copy(update={"dark": False}), slots, analyzer)
    return lit + dark, lit[::-1] + dark


def shortest_tour(recipe: Recipe, slots: Slots, analyzer: AnalyzerTiming) -> list[Stop]:
    """The slots of one point in the order, round the wheel or along the angles, that takes the least time."""
    stops: list[Stop] = []
    for polarizer_deg, retarder_deg in recipe.settings():
        slot, state = slots.signal(polarizer_deg, retarder_deg)
        stops.append((slot, "signal", state))
    if recipe.dark:
        assert slots.blocked is not None, "a recipe with dark readings is only accepted with a blocked slot"
        stops.append((slots.blocked, "dark", AnalyzerState()))

    def time_s(tour: list[Stop]) -> float:
        return sum(analyzer.move_s(here[0], there[0]) for here, there in itertools.pairwise(tour))

    in_order = (
        sorted(stops, key=lambda stop: stop[0]),
        sorted(stops, key=lambda stop: stop[2].polarizer_deg or 0.0),
        sorted(stops, key=lambda stop: stop[2].retarder_deg or 0.0),
    )
    return min((order[first:] + order[:first] for order in in_order for first in range(len(stops))), key=time_s)
