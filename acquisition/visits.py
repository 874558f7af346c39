"""The steps of a single direction, with all of its slots in one go, and of a reference."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from acquisition.analyzer_matrix import AnalyzerState
from acquisition.moving import Moving
from acquisition.recipe import Recipe, Reference
from acquisition.settings_tour import Stop, change_s, shortest_tour
from acquisition.steps import Slots, Step, Target
from acquisition.timing import BenchTiming

_Place = tuple[Target, Stop]


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
        self._tour = shortest_tour(recipe, slots, timing)
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
            self._target(exit_deg, stop)
            for exit_deg in set(self._recipe.exit_angles_deg())
            for stop in (self._tour[0], self._tour[-1])
        ]
        return max(sum(step.duration_s for step in self.closing(0, end)) for end in ends)

    def _timed(self, point: int, readings: int, here: Target, places: Iterable[_Place]) -> tuple[Step, ...]:
        steps, exposure_s = [], self._recipe.exposure_s
        reading_s = self._timing.reading_s(exposure_s)
        for there, (_, kind, state, _, made) in places:
            duration_s = self._moving_s(here, there) + self._timing.readings_s(readings, exposure_s)
            steps.append(
                Step(
                    *(point, kind, there, state.polarizer_deg, readings, exposure_s, duration_s),
                    *(state.retarder_deg, state.retardance_deg, reading_s),
                    made=made,
                    wavelength_nm=self._recipe.one_wavelength_nm,
                )
            )
            here = there
        return tuple(steps)

    def _places(self, point: int, exit_deg: float, here: Target) -> Iterator[_Place]:
        recipe, tour = self._recipe, self._tour
        if recipe.reference is not None and point % recipe.reference.every_points == 0:
            place = self._reference(recipe.reference)
            yield place
            here = place[0]
        if self._turning_s(here, tour[-1]) < self._turning_s(here, tour[0]):
            tour = tour[::-1]
        for stop in tour:
            yield self._target(exit_deg, stop), stop

    def _target(self, exit_deg: float, stop: Stop) -> Target:
        """In the plane of the recipe's first direction, which is the only one of a scan that decides as it goes."""
        where_deg = self._incidence_deg, exit_deg, self._azimuth_deg
        return Target(*where_deg, stop.slot, self._exit_azimuth_deg, stop.generator, self._slots.filter_slot)

    def _reference(self, reference: Reference) -> _Place:
        assert self._slots.open is not None, "a recipe with a reference is only accepted with an open slot"
        # always in the same light: what reaches the detector depends on it
        stop = self._tour[0]._replace(slot=self._slots.open, kind="reference", state=AnalyzerState())
        # in the plane of incidence, where the light is that follows the lamp best
        return self._target(reference.exit_deg, stop)._replace(exit_azimuth_deg=0.0), stop

    def _turning_s(self, here: Target, stop: Stop) -> float:
        return sum(change_s(self._timing, (here.slot, here.generator), (stop.slot, stop.generator)))
