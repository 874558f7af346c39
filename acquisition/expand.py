"""From a recipe to steps: the only place that decides what is done in which order, and how long it takes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from acquisition.readings import ReadingKind
from acquisition.recipe import Recipe
from acquisition.timing import EXCHANGE_S, POLL_S, READING_POLL_S, BenchTiming


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
    """Turn a recipe into its steps, in the order that moves least.

    The arms take the directions in the recipe's order; at each direction the analyzer runs through its slots from
    whichever end is nearer to where it stands (the wheel snakes).

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
    steps: list[Step] = []
    here = HOME
    for point, kind, target, analyzer_deg in _places(recipe, slots, timing):
        duration_s = _moving_s(here, target, timing) + recipe.readings * (recipe.exposure_s + READING_POLL_S)
        steps.append(Step(point, kind, target, analyzer_deg, recipe.readings, recipe.exposure_s, duration_s))
        here = target
    return tuple(steps)


def _places(
    recipe: Recipe, slots: Slots, timing: BenchTiming
) -> Iterator[tuple[int, ReadingKind, Target, float | None]]:
    tour = _wheel_tour(recipe, slots, timing.analyzer.slots)
    slot = HOME.slot
    for point, exit_deg in enumerate(recipe.exit_angles_deg()):
        if recipe.reference is not None and point % recipe.reference.every_points == 0:
            assert slots.open is not None, "a recipe with a reference is only accepted with an open slot"
            slot = slots.open
            place = Target(recipe.incidence_deg, recipe.reference.exit_deg, recipe.azimuth_deg, slot)
            yield point, "reference", place, None
        if timing.analyzer.distance(slot, tour[-1][0]) < timing.analyzer.distance(slot, tour[0][0]):
            tour = tour[::-1]
        for slot, kind, analyzer_deg in tour:
            place = Target(recipe.incidence_deg, exit_deg, recipe.azimuth_deg, slot)
            yield point, kind, place, analyzer_deg


def _wheel_tour(recipe: Recipe, slots: Slots, count: int) -> list[tuple[int, ReadingKind, float | None]]:
    """The slots of one point in the order round the wheel that leaves out its longest empty stretch."""
    stops: list[tuple[int, ReadingKind, float | None]] = [
        (slots.polarizers[angle], "signal", angle + slots.offset_deg) for angle in recipe.analyzer_deg
    ]
    if recipe.dark:
        assert slots.blocked is not None, "a recipe with dark readings is only accepted with a blocked slot"
        stops.append((slots.blocked, "dark", None))
    stops.sort(key=lambda stop: stop[0])
    gaps = [(stops[i][0] - stops[i - 1][0]) % count for i in range(len(stops))]
    first = gaps.index(max(gaps))
    return stops[first:] + stops[:first]


def _moving_s(here: Target, there: Target, timing: BenchTiming) -> float:
    arms = (
        (timing.source_arm, there.incidence_deg - here.incidence_deg),
        (timing.detector_arm, there.exit_deg - here.exit_deg),
        (timing.sample_azimuth, there.azimuth_deg - here.azimuth_deg),
    )
    moves_s = [axis.move_s(distance) for axis, distance in arms if distance]
    settles_s = [axis.settle_s for axis, distance in arms if distance]
    if here.slot != there.slot:
        moves_s.append(timing.analyzer.move_s(here.slot, there.slot))
        settles_s.append(timing.analyzer.settle_s)
    position_check_s = 4 * EXCHANGE_S
    if not moves_s:
        return position_check_s
    return max(moves_s) + POLL_S / 2 + 2 * EXCHANGE_S + max(settles_s) + position_check_s
