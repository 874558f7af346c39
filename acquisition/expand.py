"""From a recipe to steps: the only place that decides what is done in which order, and how long it takes."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from acquisition.blocks import Sweep, blocks
from acquisition.moving import Moving
from acquisition.recipe import Recipe
from acquisition.route import Order, routes
from acquisition.settings_tour import Stop, tours
from acquisition.steps import HOME as HOME
from acquisition.steps import Slots as Slots
from acquisition.steps import Step as Step
from acquisition.steps import Target as Target
from acquisition.timing import BenchTiming
from acquisition.visits import Visits as Visits
from acquisition.ways import Ways

_SAME_S = 6
"""Decimals of a duration behind which nothing is quicker."""


@dataclass(frozen=True)
class Direction:
    """One of the recipe's directions, by its number: where it is, and how often each slot is read there."""

    point: int
    incidence_deg: float
    exit_deg: float
    azimuth_deg: float
    exit_azimuth_deg: float
    readings: int
    filter_slot: int | None = None

    def through(self, stop: Stop) -> Target:
        """Where the bench stands for it, with slots of analyzer and generator in the beam."""
        where_deg = self.incidence_deg, self.exit_deg, self.azimuth_deg
        return Target(*where_deg, stop.slot, self.exit_azimuth_deg, stop.generator, self.filter_slot)


def expand(recipe: Recipe, slots: Slots, timing: BenchTiming, here: Target = HOME) -> tuple[Step, ...]:
    """Turn a recipe into its steps, in the order that takes the least time.

    A single axis takes the directions as it comes by, upwards or downwards as the recipe does; where several axes move,
    `routes` says in which order. `blocks` says how many directions are swept, forth and back, slot after slot. No block
    goes beyond the next reference, nor beyond a repeat of all.

    Parameters
    ----------
    recipe : Recipe
        What to measure.
    slots : Slots
        What the rig's analyzer holds.
    timing : BenchTiming
        Speeds of the rig, from which every step's duration follows.
    here : Target
        Where the bench stands before; from elsewhere than home, an order may as well begin with its end.

    Returns
    -------
    tuple of Step
        `point` of a step is the number of its direction in the recipe. `duration_s` counts its moves, settling and
        readings. With a reference in the recipe the last step reads it once more, so that every direction stands
        between two references.
    """
    listed, ways = _Listed(recipe, slots, timing), Ways(timing, Moving(timing))
    angles_deg = recipe.directions_deg()
    orders = routes(angles_deg, ways)
    if here != HOME:
        orders = [turned for order in orders for turned in (order, order[::-1])]
    found = [tuple(listed.steps(order, here)) for order in orders]
    if len(found) == 1:
        return found[0]
    blocked = [ways.blocked(angles_deg[order]) for order in orders]
    total_s = [round(sum(step.duration_s for step in steps), _SAME_S) for steps in found]
    return found[min(range(len(found)), key=lambda number: (blocked[number], total_s[number]))]


@dataclass(frozen=True)
class _Way:
    """Directions in the order of a route, and how long it takes from each to the next, and back."""

    directions: Sequence[Direction]
    forth_s: Sequence[float]
    back_s: Sequence[float]

    def part(self, first: int, end: int) -> _Way:
        """The stretch from a place up to, and without, another."""
        last = max(end - 1, first)
        return _Way(self.directions[first:end], self.forth_s[first:last], self.back_s[first:last])

    def turned(self) -> _Way:
        """The same from its end."""
        return _Way(self.directions[::-1], self.back_s[::-1], self.forth_s[::-1])


class _Listed:
    """The steps of a recipe that says beforehand all that is measured."""

    def __init__(self, recipe: Recipe, slots: Slots, timing: BenchTiming) -> None:
        self._recipe, self._timing = recipe, timing
        self._tours = tours(recipe, slots, timing)
        self._tour = self._tours[0]
        self._visits = Visits(recipe, slots, timing)
        self._moving_s = Moving(timing)
        self._ways = Ways(timing, self._moving_s)
        counts = set(recipe.readings_of_directions())
        self._taking_s = {readings: timing.readings_s(readings, recipe.exposure_s) for readings in counts}
        places = zip(recipe.directions_deg().tolist(), recipe.readings_of_directions(), strict=True)
        self._directions = [
            Direction(point, incidence_deg, exit_deg, azimuth_deg, exit_azimuth_deg, readings, slots.filter_slot)
            for point, ((incidence_deg, exit_deg, azimuth_deg, exit_azimuth_deg), readings) in enumerate(places)
        ]

    def steps(self, order: Order, here: Target = HOME) -> Iterator[Step]:
        """The steps in this order, and then back again for every repeat."""
        way = self._way(order)
        for cycle in range(self._recipe.repeats):
            for step in self._cycle(way, here):
                yield step if cycle == 0 else replace(step, cycle=cycle)
                here = step.target
            way = way.turned()
        if self._recipe.reference is not None:
            last = way.directions[0]
            (step,) = self._visits.reference(last.point, last.readings, here)
            yield replace(step, cycle=self._recipe.repeats - 1)

    def _way(self, order: Order) -> _Way:
        places_deg = self._recipe.directions_deg()[order]
        forth_s, back_s = self._ways.along_s(places_deg), self._ways.along_s(places_deg[::-1])[::-1]
        return _Way([self._directions[number] for number in order.tolist()], forth_s.tolist(), back_s.tolist())

    def _cycle(self, way: _Way, here: Target) -> Iterator[Step]:
        """The steps of all directions once."""
        reference, count = self._recipe.reference, len(way.directions)
        every = count if reference is None else reference.every_points
        for first in range(0, count, every):
            part = way.part(first, first + every)
            if reference is not None:
                beginning = part.directions[0]
                (step,) = self._visits.reference(beginning.point, beginning.readings, here)
                yield step
                here = step.target
            for block in blocks(self._sweep(part), self._recipe.direction_within_s):
                for step in self._swept(part.part(block.start, block.stop), here):
                    yield step
                    here = step.target

    def _sweep(self, part: _Way) -> Sweep:
        turns = itertools.pairwise(part.directions[0].through(stop) for stop in self._tour)
        return Sweep(
            onward_s=(np.array(part.forth_s) + np.array(part.back_s)) / 2,
            reading_s=np.array([self._taking_s[direction.readings] for direction in part.directions]),
            turn_s=sum(self._moving_s(one, other) for one, other in turns),
            slots=len(self._tour),
        )

    def _swept(self, block: _Way, here: Target) -> Iterator[Step]:
        """The steps of a block: from whichever end and whichever slot is reached sooner, and then forth and back."""
        exposure_s, wavelength_nm = self._recipe.exposure_s, self._recipe.one_wavelength_nm
        ways = [(order, stops) for order in (block, block.turned()) for stops in self._tours]
        block, tour = min(ways, key=lambda way: self._moving_s(here, way[0].directions[0].through(way[1][0])))
        reading_s = self._timing.reading_s(exposure_s)
        taking_s = [self._taking_s[direction.readings] for direction in block.directions]
        for stop in tour:
            moving_s = self._moving_s(here, block.directions[0].through(stop))
            kind, state = stop.kind, stop.state
            for direction, next_s, taken_s in zip(block.directions, [*block.forth_s, 0.0], taking_s, strict=True):
                here = direction.through(stop)
                duration_s = moving_s + taken_s
                yield Step(
                    *(direction.point, kind, here, state.polarizer_deg, direction.readings, exposure_s, duration_s),
                    *(state.retarder_deg, state.retardance_deg, reading_s),
                    made=stop.made,
                    wavelength_nm=wavelength_nm,
                )
                moving_s = next_s
            block, taking_s = block.turned(), taking_s[::-1]
