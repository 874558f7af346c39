"""From a recipe to steps: the only place that decides what is done in which order, and how long it takes."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from acquisition.blocks import Sweep, blocks
from acquisition.moving import Moving
from acquisition.recipe import Recipe
from acquisition.steps import HOME as HOME
from acquisition.steps import Slots as Slots
from acquisition.steps import Step as Step
from acquisition.steps import Target as Target
from acquisition.timing import BenchTiming
from acquisition.visits import Visits as Visits
from acquisition.visits import tours


@dataclass(frozen=True)
class Direction:
    """One of the recipe's directions, by its number: where it is, and how often each slot is read there."""

    point: int
    incidence_deg: float
    exit_deg: float
    azimuth_deg: float
    readings: int

    def through(self, slot: int) -> Target:
        """Where the bench stands for it, with a slot in the beam."""
        return Target(self.incidence_deg, self.exit_deg, self.azimuth_deg, slot)


def expand(recipe: Recipe, slots: Slots, timing: BenchTiming) -> tuple[Step, ...]:
    """Turn a recipe into its steps, in the order that takes the least time.

    The arm takes the directions as it comes by, upwards or downwards as the recipe does; `blocks` says how many of them
    are swept, forth and back, slot after slot. No block goes beyond the next reference.

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
        `point` of a step is the number of its direction in the recipe. `duration_s` counts its moves, settling and
        readings. With a reference in the recipe the last step reads it once more, so that every direction stands
        between two references.
    """
    return tuple(_Listed(recipe, slots, timing).steps())


class _Listed:
    """The steps of a recipe that says beforehand all that is measured."""

    def __init__(self, recipe: Recipe, slots: Slots, timing: BenchTiming) -> None:
        self._recipe, self._timing = recipe, timing
        self._tours = tours(recipe, slots, timing.analyzer)
        self._tour = self._tours[0]
        self._visits = Visits(recipe, slots, timing)
        self._moving_s = Moving(timing)

    def steps(self) -> Iterator[Step]:
        here = HOME
        reference = self._recipe.reference
        route = self._route()
        every = len(route) if reference is None else reference.every_points
        for first in range(0, len(route), every):
            part = route[first : first + every]
            if reference is not None:
                (step,) = self._visits.reference(part[0].point, part[0].readings, here)
                yield step
                here = step.target
            for block in blocks(self._sweep(part), self._recipe.direction_within_s):
                for step in self._swept([part[place] for place in block], here):
                    yield step
                    here = step.target
        if reference is not None:
            yield from self._visits.reference(route[-1].point, route[-1].readings, here)

    def _route(self) -> list[Direction]:
        """The directions in the order in which the arm comes by, upwards or downwards as the recipe begins and ends."""
        recipe = self._recipe
        angles_deg = recipe.exit_angles_deg()
        angles = zip(angles_deg, recipe.readings_of_angles(), strict=True)
        route = sorted(
            (
                Direction(point, recipe.incidence_deg, exit_deg, recipe.azimuth_deg, readings)
                for point, (exit_deg, readings) in enumerate(angles)
            ),
            key=lambda direction: direction.exit_deg,
        )
        return route if angles_deg[0] <= angles_deg[-1] else route[::-1]

    def _sweep(self, part: Sequence[Direction]) -> Sweep:
        slot = self._tour[0][0]
        targets = [direction.through(slot) for direction in part]
        onward_s = [
            (self._moving_s(one, other) + self._moving_s(other, one)) / 2 for one, other in itertools.pairwise(targets)
        ]
        turns = itertools.pairwise(part[0].through(stop[0]) for stop in self._tour)
        return Sweep(
            onward_s=np.array(onward_s),
            reading_s=np.array([self._readings_s(direction.readings) for direction in part]),
            turn_s=sum(self._moving_s(one, other) for one, other in turns),
            slots=len(self._tour),
        )

    def _swept(self, block: Sequence[Direction], here: Target) -> Iterator[Step]:
        """The steps of a block: from whichever end and whichever slot is reached sooner, and then forth and back."""
        recipe = self._recipe
        ways = [(order, stops) for order in (block, block[::-1]) for stops in self._tours]
        block, tour = min(ways, key=lambda way: self._moving_s(here, way[0][0].through(way[1][0][0])))
        reading_s, exposure_s = self._timing.reading_s(recipe.exposure_s), recipe.exposure_s
        taking_s = [self._readings_s(direction.readings) for direction in block]
        onward_s, back_s = self._between_s(block), self._between_s(block[::-1])
        for slot, kind, state in tour:
            moving_s = self._moving_s(here, block[0].through(slot))
            for direction, next_s, taken_s in zip(block, [*onward_s, 0.0], taking_s, strict=True):
                here = direction.through(slot)
                duration_s = moving_s + taken_s
                yield Step(
                    *(direction.point, kind, here, state.polarizer_deg, direction.readings, exposure_s, duration_s),
                    *(state.retarder_deg, state.retardance_deg, reading_s),
                )
                moving_s = next_s
            block, onward_s, back_s, taking_s = block[::-1], back_s, onward_s, taking_s[::-1]

    def _readings_s(self, readings: int) -> float:
        return self._timing.readings_s(readings, self._recipe.exposure_s)

    def _between_s(self, block: Sequence[Direction]) -> list[float]:
        """How long it takes from each direction to the next, in whichever slot."""
        slot = self._tour[0][0]
        return [self._moving_s(one, other) for one, other in itertools.pairwise(one.through(slot) for one in block)]
