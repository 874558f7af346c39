"""The order of the states of generator and analyzer: every pair once, in the least time that there is."""

import itertools
from dataclasses import replace

import pytest
from numpy.testing import assert_allclose

from acquisition.expand import Slots, expand
from acquisition.recipe import Recipe
from acquisition.settings_tour import change_s, shortest_tour, tours
from acquisition.timing import AxisTiming, BenchTiming, RotatorTiming, WheelTiming

SLOTS = Slots(polarizers={0.0: 2, 45.0: 3, 90.0: 4, 135.0: 5}, offset_deg=10.0, blocked=6, open=1)
ARM = AxisTiming(velocity_deg_s=20, acceleration_deg_s2=80, settle_s=0.05)
TIMING = BenchTiming(ARM, ARM, ARM, WheelTiming(slots=6, slot_s=0.5, settle_s=0.05))
GENERATOR_DEG = (0.0, 45.0, 90.0, 135.0)
MADE = {angle: number for number, angle in enumerate(GENERATOR_DEG, 1)}


def recipe(**changes):
    return Recipe.model_validate(
        {
            "recipe": "x",
            "rig": "rig.yaml",
            "wavelength_nm": 550.0,
            "incidence_deg": 60.0,
            "exit_deg": [0.0, 1.0, 2.0, 3.0],
            "analyzer_deg": [0.0, 45.0, 90.0, 135.0],
            "readings": 3,
            "exposure_s": 0.03,
            "fit": {"lobes": ["diffuse"], "free": {"sigma": [0.1, 1.0]}},
            **changes,
        }
    )


def timing(speed_deg_s):
    turning = AxisTiming(speed_deg_s, 4 * speed_deg_s, 0.05)
    return replace(TIMING, generator=RotatorTiming({slot: angle for angle, slot in MADE.items()}, turning))


def slots():
    return replace(SLOTS, generator=Slots(polarizers=MADE, offset_deg=-5.0, blocked=None, open=None))


def tour_of(speed_deg_s, **changes):
    return shortest_tour(recipe(generator_deg=list(GENERATOR_DEG), **changes), slots(), timing(speed_deg_s))


def length_s(stops, when):
    pairs = itertools.pairwise((stop.slot, stop.generator) for stop in stops)
    return sum(sum(change_s(when, one, other)) for one, other in pairs)


def least_s(nodes, when):
    """The shortest way through all nodes, from wherever, by dynamic programming over what was visited."""
    count = len(nodes)
    way_s = [[sum(change_s(when, one, other)) for other in nodes] for one in nodes]
    best = {(1 << node, node): 0.0 for node in range(count)}
    for visited in range(1, 1 << count):
        for last in range(count):
            if (visited, last) not in best:
                continue
            for to in range(count):
                if not visited >> to & 1:
                    key = (visited | 1 << to, to)
                    best[key] = min(best.get(key, 1e9), best[visited, last] + way_s[last][to])
    return min(best[(1 << count) - 1, last] for last in range(count))


@pytest.mark.parametrize("speed_deg_s", [10.0, 100.0, 430.0], ids=["slower", "alike", "quicker"])
def test_no_order_of_all_pairs_takes_less_time(speed_deg_s):
    """Three states each, which is as many as can be tried; whichever of the two is quicker."""
    asked = recipe(generator_deg=[0.0, 45.0, 90.0], analyzer_deg=[0.0, 45.0, 90.0], dark=False)
    tour = shortest_tour(asked, slots(), timing(speed_deg_s))
    nodes = list(itertools.product((2, 3, 4), (1, 2, 3)))
    assert sorted((stop.slot, stop.generator) for stop in tour) == nodes
    assert_allclose(length_s(tour, timing(speed_deg_s)), least_s(nodes, timing(speed_deg_s)), rtol=1e-12)


@pytest.mark.parametrize(("speed_deg_s", "stays"), [(5.0, "generator"), (430.0, "slot")])
def test_the_quicker_one_turns_while_the_slower_one_stays(speed_deg_s, stays):
    tour = tour_of(speed_deg_s, dark=False)
    changes = sum(getattr(one, stays) != getattr(other, stays) for one, other in itertools.pairwise(tour))
    assert changes == 3


def test_every_pair_is_read_once_and_the_dark_once_with_the_light_that_was_made():
    steps = expand(recipe(generator_deg=list(GENERATOR_DEG), exit_deg=[0.0, 1.0]), slots(), timing(50.0))
    for point in (0, 1):
        lit = [step for step in steps if step.point == point and step.kind == "signal"]
        pairs = {(step.analyzer_deg, step.made.polarizer_deg) for step in lit}
        assert len(lit) == 16
        assert pairs == set(itertools.product((10.0, 55.0, 100.0, 145.0), (-5.0, 40.0, 85.0, 130.0)))
        (dark,) = (step for step in steps if step.point == point and step.kind == "dark")
        assert dark.target.slot == 6
    for step in steps:
        assert GENERATOR_DEG[step.target.generator - 1] - 5.0 == step.made.polarizer_deg


@pytest.mark.parametrize("speed_deg_s", [5.0, 430.0])
def test_the_dark_reading_comes_where_it_costs_least(speed_deg_s):
    tour, when = tour_of(speed_deg_s), timing(speed_deg_s)
    (dark,) = (stop for stop in tour if stop.kind == "dark")
    lit = [stop for stop in tour if stop.kind == "signal"]
    elsewhere = (
        [*lit[:place], dark._replace(generator=generator), *lit[place:]]
        for place in range(len(lit) + 1)
        for generator in MADE.values()
    )
    assert_allclose(length_s(tour, when), min(length_s(other, when) for other in elsewhere), rtol=1e-12)
    assert length_s(tour, when) > length_s(lit, when)


def test_sweeps_over_many_directions_take_no_longer_than_one_after_the_other():
    asked = {"generator_deg": list(GENERATOR_DEG), "exit_deg": [float(angle) for angle in range(12)], "readings": 1}
    swept, singly = (
        sum(step.duration_s for step in expand(recipe(**asked, direction_within_s=within), slots(), timing(20.0)))
        for within in (1e6, 0)
    )
    assert swept < 0.8 * singly


def test_references_are_read_in_one_light_only():
    asked = recipe(generator_deg=list(GENERATOR_DEG), reference={"exit_deg": 30.0, "every_points": 1})
    references = [step for step in expand(asked, slots(), timing(50.0)) if step.kind == "reference"]
    assert len(references) == 5
    ((generator, made),) = {(step.target.generator, step.made) for step in references}
    assert made.polarizer_deg == GENERATOR_DEG[generator - 1] - 5.0


def test_generator_and_analyzer_turn_at_the_same_time():
    when = timing(50.0)
    both, one, other = (change_s(when, (2, 1), there)[0] for there in ((5, 4), (5, 1), (2, 4)))
    assert both == max(one, other) > 0.0


def test_dark_comes_behind_all_pairs_where_its_number_of_readings_follows_from_theirs():
    until = {"at_least": 2, "at_most": 9, "signal_to_noise": 50}
    asked = recipe(generator_deg=list(GENERATOR_DEG), readings=until)
    one, other = tours(asked, slots(), timing(50.0))
    assert [stop.kind for stop in one] == [stop.kind for stop in other] == ["signal"] * 16 + ["dark"]
    assert one[:-1] == other[:-1][::-1]
    for tour in (one, other):
        assert (tour[-1].slot, tour[-1].generator) == (6, tour[-2].generator)


def test_several_incidences_and_repeats_take_every_pair_in_every_direction_each_time():
    asked = recipe(generator_deg=list(GENERATOR_DEG), incidence_deg=[30.0, 60.0], exit_deg=[0.0, 9.0], repeats=2)
    steps = [step for step in expand(asked, slots(), timing(50.0)) if step.kind == "signal"]
    for cycle, point in itertools.product((0, 1), range(4)):
        there = [step.target for step in steps if (step.cycle, step.point) == (cycle, point)]
        assert {(target.incidence_deg, target.exit_deg) for target in there} == {
            (30.0 + 30.0 * (point // 2), 9.0 * (point % 2))
        }
        assert sorted((target.slot, target.generator) for target in there) == list(
            itertools.product((2, 3, 4, 5), (1, 2, 3, 4))
        )
