"""In which order the states of generator and analyzer are taken at one place, so that it takes the least time."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

from acquisition.analyzer_matrix import AnalyzerState
from acquisition.generator import GeneratorState
from acquisition.readings import ReadingKind
from acquisition.recipe import Recipe
from acquisition.rotation import BACKWARDS, FORWARDS
from acquisition.steps import Slots
from acquisition.timing import BenchTiming


class Stop(NamedTuple):
    """A slot of the analyzer, what is read there, what the light then passes, and the same of the generator."""

    slot: int
    kind: ReadingKind
    state: AnalyzerState
    generator: int | None = None
    made: GeneratorState = GeneratorState()


def tours(recipe: Recipe, slots: Slots, timing: BenchTiming) -> tuple[list[Stop], list[Stop]]:
    """The stops at one direction in two orders, one opposite to the other.

    Where each slot is read until it is known well enough, the dark slot is the last of both: how often it is read
    follows from the others.
    """
    tour = shortest_tour(recipe, slots, timing)
    if recipe.analyzer_rotation is not None:
        return tour, tour  # each direction leaves the analyzer where the next one begins
    if recipe.averaging is None or recipe.averaging.signal_to_noise is None or not recipe.dark:
        return tour, tour[::-1]
    (dark,) = (stop for stop in tour if stop.kind == "dark")
    lit = shortest_tour(recipe.model_copy(update={"dark": False}), slots, timing)
    return [*lit, _seen_behind(lit[-1], dark)], [*lit[::-1], _seen_behind(lit[0], dark)]


def shortest_tour(recipe: Recipe, slots: Slots, timing: BenchTiming) -> list[Stop]:
    """The stops at one direction in the order that takes the least time.

    Of analyzer and generator the one that is quicker runs through all its slots while the other stays, forth and then
    back (both snake); the dark reading, once, comes where it costs least. An analyzer that turns while it is read has a
    stop for each turn.
    """
    if recipe.analyzer_rotation is not None:
        ends = (FORWARDS, BACKWARDS) * (recipe.analyzer_rotation.turns // 2)
        return [Stop(end, "signal", AnalyzerState()) for end in ends]
    analyzers = [_analyzer_stop(slots, setting) for setting in recipe.settings()]
    darks = []
    if recipe.dark:
        assert slots.blocked is not None, "a recipe with dark readings is only accepted with a blocked slot"
        darks = [Stop(slots.blocked, "dark", AnalyzerState())]
    if timing.generator is None or slots.generator is None:
        return _shortest([*analyzers, *darks], lambda stop: stop.slot, lambda stop: stop.state, timing)
    made = [_generator_stop(slots.generator, setting) for setting in recipe.generator_settings()]
    of_generator = _shortest(made, lambda stop: stop.generator or 0, lambda stop: stop.made.reversed, timing)
    of_analyzer = _shortest(analyzers, lambda stop: stop.slot, lambda stop: stop.state, timing)
    tours = (
        list(_snaking(of_generator, of_analyzer, _seen_behind)),
        list(_snaking(of_analyzer, of_generator, lambda analyzer, generator: _seen_behind(generator, analyzer))),
    )
    tour = min(tours, key=lambda tour: _length_s(tour, timing))
    for dark in darks:
        places = [(place, _seen_behind(stop, dark)) for place in range(len(tour) + 1) for stop in of_generator]
        place, stop = min(places, key=lambda at: _detour_s(tour, at[0], at[1], timing))
        tour = [*tour[:place], stop, *tour[place:]]
    return tour


def change_s(timing: BenchTiming, here: tuple[int, int | None], there: tuple[int, int | None]) -> tuple[float, float]:
    """How long analyzer and generator turn from slots to slots, at the same time, and how long they settle then.

    Both are asked where they are about the last reading, before one turns, and before the next, while it settles.
    """
    devices = (timing.analyzer, timing.generator)
    turning = [
        (device.move_s(start or 0, end) + timing.slots_s, max(device.settle_s, timing.slots_s))
        for device, start, end in zip(devices, here, there, strict=True)
        if device is not None and end is not None and start != end
    ]
    return max((way for way, _ in turning), default=0.0), max((settle for _, settle in turning), default=0.0)


def _length_s(tour: Sequence[Stop], timing: BenchTiming) -> float:
    ways = itertools.pairwise((stop.slot, stop.generator) for stop in tour)
    return sum(sum(change_s(timing, here, there)) for here, there in ways)


def _detour_s(tour: Sequence[Stop], place: int, stop: Stop, timing: BenchTiming) -> float:
    """How much longer a tour is with one more stop."""
    before, behind = tour[max(place - 1, 0) : place], tour[place : place + 1]
    return _length_s([*before, stop, *behind], timing) - _length_s([*before, *behind], timing)


def _snaking(outer: Sequence[Stop], inner: Sequence[Stop], joined: Callable[[Stop, Stop], Stop]) -> Iterator[Stop]:
    for stays in outer:
        yield from (joined(stays, turns) for turns in inner)
        inner = inner[::-1]


def _seen_behind(generator: Stop, analyzer: Stop) -> Stop:
    return analyzer._replace(generator=generator.generator, made=generator.made)


def _shortest(
    stops: Sequence[Stop], slot: Callable[[Stop], int], state: Callable[[Stop], AnalyzerState], timing: BenchTiming
) -> list[Stop]:
    """Stops in the order, round the wheel or along the angles, that takes the least time."""
    in_order = (
        sorted(stops, key=slot),
        sorted(stops, key=lambda stop: state(stop).polarizer_deg or 0.0),
        sorted(stops, key=lambda stop: state(stop).retarder_deg or 0.0),
    )
    rotated = (order[first:] + order[:first] for order in in_order for first in range(len(stops)))
    return min(rotated, key=lambda tour: _length_s(tour, timing))


def _analyzer_stop(slots: Slots, setting: tuple[float, float | None]) -> Stop:
    slot, state = slots.signal(*setting)
    return Stop(slot, "signal", state)


def _generator_stop(slots: Slots, setting: tuple[float, float | None]) -> Stop:
    slot, state = slots.signal(*setting)
    return Stop(0, "signal", AnalyzerState(), slot, GeneratorState.of(state))
