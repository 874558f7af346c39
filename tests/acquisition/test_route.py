"""The order of directions where several axes move: a short way, and nothing left out or done twice."""

import itertools
import time
from collections import Counter

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from acquisition.expand import HOME, Slots, _Listed, expand
from acquisition.moving import Moving
from acquisition.point_table import NAMES
from acquisition.recipe import Recipe
from acquisition.route import MOST_SEARCHED, path_s, routes
from acquisition.steps import Target
from acquisition.timing import AxisTiming, BenchTiming, WheelTiming
from acquisition.tour import improved, nearest_next
from acquisition.ways import Ways
from drivers.collision_zones import ArmsTooClose, Box

SLOTS = Slots(polarizers={0.0: 2, 45.0: 3, 90.0: 4}, offset_deg=0.0, blocked=6, open=1)
WHEEL = WheelTiming(slots=6, slot_s=0.5, settle_s=0.05)
ARM = AxisTiming(velocity_deg_s=20, acceleration_deg_s2=80, settle_s=0.05)
SLOW = AxisTiming(velocity_deg_s=2, acceleration_deg_s2=10, settle_s=0.3)
PLAYING = AxisTiming(velocity_deg_s=10, acceleration_deg_s2=30, settle_s=0.1, backlash_deg=1.5)
ASIDE = AxisTiming(velocity_deg_s=5, acceleration_deg_s2=20, settle_s=0.2, exchange_s=0.02)
TIMING = BenchTiming(SLOW, ARM, PLAYING, WHEEL, detector_azimuth=ASIDE)

ANGLES = st.tuples(
    st.integers(0, 80).map(float),
    st.integers(-80, 80).map(float),
    st.sampled_from([-30.0, 0.0, 12.5, 90.0]),
    st.sampled_from([0.0, 0.0, -40.0, 7.5]),
)


def ways_on(timing=TIMING):
    return Ways(timing, Moving(timing))


def recipe(**changes):
    written = {
        "recipe": "x",
        "rig": "rig.yaml",
        "wavelength_nm": 550.0,
        "analyzer_deg": [0.0, 45.0, 90.0],
        "readings": 2,
        "exposure_s": 0.03,
        "fit": {"lobes": ["diffuse"], "free": {"sigma": [0.1, 1.0]}},
        **changes,
    }
    return Recipe.model_validate(written)


def listed_points(angles):
    return [dict(zip(NAMES, point, strict=True)) for point in angles]


def target(incidence_deg, exit_deg, azimuth_deg, exit_azimuth_deg):
    return Target(incidence_deg, exit_deg, azimuth_deg, 1, exit_azimuth_deg)


def duration_s(steps):
    return sum(step.duration_s for step in steps)


@given(st.lists(ANGLES, min_size=2, max_size=6))
def test_ways_take_as_long_together_as_one_by_one(places):
    moving_s = Moving(TIMING)
    expected = [moving_s(target(*here), target(*there)) for here, there in itertools.pairwise(places)]
    assert_allclose(ways_on().along_s(np.array(places)), expected, atol=1e-9)


@given(st.lists(ANGLES, min_size=2, max_size=6))
def test_ways_of_arms_that_wait_for_each_other_take_as_long_together_as_one_by_one(places):
    timing = BenchTiming(ARM, ARM, ARM, WHEEL, zones=(ArmsTooClose(10.0),), detector_azimuth=ASIDE)
    moving_s = Moving(timing)
    expected = [moving_s(target(*here), target(*there)) for here, there in itertools.pairwise(places)]
    assert_allclose(ways_on(timing).along_s(np.array(places)), expected, atol=1e-9)


@pytest.mark.parametrize("seed", range(40))
def test_the_way_is_within_a_tenth_of_the_shortest_and_no_longer_than_the_list(seed):
    random = np.random.default_rng(seed)
    count = int(random.integers(3, 8))
    angles_deg = np.column_stack(
        [
            random.uniform(0, 80, count),
            random.uniform(-80, 80, count),
            random.choice([0.0, 20.0, 90.0], count),
            random.choice([0.0, -15.0], count),
        ]
    )
    ways = ways_on()
    found_s = min(path_s(order, angles_deg, ways) for order in routes(angles_deg, ways))
    best_s = min(path_s(np.array(order), angles_deg, ways) for order in itertools.permutations(range(count)))
    assert best_s - 1e-9 <= found_s <= 1.1 * best_s
    assert found_s <= path_s(np.arange(count), angles_deg, ways) + 1e-9


@pytest.mark.parametrize("seed", range(20))
def test_no_reversal_of_a_stretch_and_no_place_put_elsewhere_shortens_the_way(seed):
    random = np.random.default_rng(seed)
    places = random.uniform(0, 1, (9, 2))
    between = np.hypot(*(places[:, None] - places[None, :]).T)
    begun = nearest_next(between)
    order = improved(begun, between)
    assert sorted(order) == list(range(9))
    assert order[0] == 0

    def length(of):
        return float(between[of[:-1], of[1:]].sum())

    assert length(order) <= length(begun) + 1e-12
    for first, last in itertools.combinations(range(1, 10), 2):
        turned = np.concatenate([order[:first], order[first:last][::-1], order[last:]])
        assert length(turned) >= length(order) - 1e-8
    for place, behind in itertools.product(range(1, 9), range(8)):
        left = np.delete(order, place)
        assert length(np.insert(left, behind + 1, order[place])) >= length(order) - 1e-8


@settings(deadline=None, max_examples=60)
@given(
    st.lists(ANGLES, min_size=1, max_size=9),
    st.integers(1, 3),
    st.sampled_from([0.0, 3.0, 60.0]),
    st.sampled_from([None, 1, 2, 4]),
    st.booleans(),
)
def test_every_direction_is_read_in_every_slot_once_a_repeat(angles, repeats, within_s, every_points, dark):
    reference = {"exit_deg": 45.0, "every_points": every_points} if every_points else None
    measured = recipe(
        points=listed_points(angles), repeats=repeats, direction_within_s=within_s, reference=reference, dark=dark
    )
    steps = expand(measured, SLOTS, TIMING)
    slots = [2, 3, 4, *([6] if dark else [])]
    of_light = [step for step in steps if step.kind != "reference"]
    taken = Counter((step.point, step.target.slot, step.cycle) for step in of_light)
    assert taken == dict.fromkeys(itertools.product(range(len(angles)), slots, range(repeats)), 1)
    for step in of_light:
        assert tuple(step.target.axes_deg.values()) == angles[step.point]
        assert (step.kind == "dark") == (step.target.slot == 6)
    assert [step.cycle for step in steps] == sorted(step.cycle for step in steps)
    kinds = [step.kind for step in steps]
    if reference is None:
        assert "reference" not in kinds
        return
    assert kinds[0] == kinds[-1] == "reference"
    assert len({tuple(step.target.axes_deg.values()) for step in steps if step.kind == "reference"}) == 1
    between, points = [], set()
    for step in steps[1:]:
        if step.kind == "reference":
            between.append(len(points))
            points = set()
        points |= {step.point} if step.kind != "reference" else set()
    assert max(between) <= every_points


@settings(deadline=None, max_examples=60)
@given(st.lists(ANGLES, min_size=2, max_size=12), st.sampled_from([0.0, 10.0, 60.0]), st.integers(1, 2))
def test_a_scan_never_takes_longer_than_in_the_order_of_the_list(angles, within_s, repeats):
    measured = recipe(points=listed_points(angles), direction_within_s=within_s, repeats=repeats)
    as_listed = tuple(_Listed(measured, SLOTS, TIMING).steps(np.arange(len(angles))))
    assert duration_s(expand(measured, SLOTS, TIMING)) <= duration_s(as_listed) + 1e-6


def test_a_product_is_taken_line_by_line_along_the_axis_that_goes_soonest():
    measured = recipe(
        incidence_deg=[60.0, 30.0], azimuth_deg=[0.0, 90.0], exit_deg=[0.0, 5.0, 10.0, 15.0], direction_within_s=0
    )
    route = list(dict.fromkeys(step.point for step in expand(measured, SLOTS, TIMING)))
    places_deg = measured.directions_deg()[route]
    assert sorted(route) == list(range(16))
    assert ((np.diff(places_deg, axis=0) != 0.0).sum(axis=1) == 1).all(), "never two axes at once"
    assert np.abs(np.diff(places_deg, axis=0)).sum(axis=0).tolist() == [30.0, 4 * 15.0, 2 * 90.0, 0.0]


def test_repeats_go_back_the_way_they_came():
    measured = recipe(incidence_deg=60.0, exit_deg=[0.0, 10.0, 20.0], repeats=3, direction_within_s=0)
    steps = expand(measured, SLOTS, TIMING)
    route = [step.point for step in steps if step.kind == "dark"]
    assert route == [0, 1, 2, 2, 1, 0, 0, 1, 2]


def test_references_of_several_incidences_look_at_the_same_place():
    measured = recipe(incidence_deg=[40.0, 20.0], exit_deg=[0.0, 10.0], reference={"exit_deg": 30.0, "every_points": 1})
    references = [step.target for step in expand(measured, SLOTS, TIMING) if step.kind == "reference"]
    assert len(references) == 5
    assert set(references) == {Target(40.0, 30.0, 0.0, 1)}


def test_an_order_that_keeps_out_of_a_zone_wins_over_a_quicker_one():
    """Straight down the detector arm would go through the zone; the list goes round it by the source arm."""
    zone = Box({"source_arm": (-1.0, 20.0), "detector_arm": (20.0, 30.0)})
    timing = BenchTiming(SLOW, ARM, ARM, WHEEL, zones=(zone,))
    angles = [(10.0, 10.0, 0.0, 0.0), (40.0, 10.0, 0.0, 0.0), (40.0, 40.0, 0.0, 0.0), (10.0, 40.0, 0.0, 0.0)]
    ways = ways_on(timing)
    assert ways.blocked(np.array(angles)) == 0
    steps = expand(recipe(points=listed_points(angles), direction_within_s=0), SLOTS, timing)
    route = list(dict.fromkeys(step.point for step in steps))
    assert ways.blocked(np.array(angles)[route]) == 0
    assert ways.blocked(np.array([angles[0], angles[3]])) == 1, "else there is nothing to avoid"


def test_a_way_past_many_scattered_directions_is_far_shorter_than_the_list_and_found_soon():
    """Within half a second of a quiet processor; a loaded one is given three."""
    random = np.random.default_rng(3)
    angles_deg = np.zeros((100_000, 4))
    angles_deg[:, 0], angles_deg[:, 1] = random.uniform(0, 80, 100_000), random.uniform(-80, 80, 100_000)
    ways = ways_on(BenchTiming(ARM, ARM, ARM, WHEEL))
    begun_s = time.process_time()
    (order,) = routes(angles_deg, ways)
    assert time.process_time() - begun_s < 3.0
    assert sorted(order.tolist()) == list(range(100_000))
    assert path_s(order, angles_deg, ways) < 0.1 * path_s(np.arange(100_000), angles_deg, ways)
    few = angles_deg[:MOST_SEARCHED]
    begun_s = time.process_time()
    searched, *_ = routes(few, ways)
    assert time.process_time() - begun_s < 3.0
    assert path_s(searched, few, ways) < 0.25 * path_s(np.arange(len(few)), few, ways)


def test_the_bench_is_taken_to_stand_at_home():
    ways = ways_on()
    angles_deg = np.array([[50.0, 0.0, 0.0, 0.0], [10.0, 5.0, 0.0, 0.0], [30.0, 9.0, 0.0, 0.0]])
    first = routes(angles_deg, ways)[0][0]
    assert first == 1
    assert set(HOME.axes_deg.values()) == {0.0}
