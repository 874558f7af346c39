"""The order of the steps, and how long they take."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from pydantic import ValidationError

from acquisition.expand import HOME, Slots, expand
from acquisition.recipe import Recipe
from acquisition.timing import READING_S, AxisTiming, BenchTiming, WheelTiming

SLOTS = Slots(polarizers={0.0: 2, 45.0: 3, 90.0: 4, 135.0: 5}, offset_deg=10.0, blocked=6, open=1)
ARM = AxisTiming(velocity_deg_s=20, acceleration_deg_s2=80, settle_s=0.05)
TIMING = BenchTiming(ARM, ARM, ARM, WheelTiming(slots=6, slot_s=0.5, settle_s=0.05))


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


def steps_of(**changes):
    return expand(recipe(**changes), SLOTS, TIMING)


def test_the_wheel_snakes_where_every_direction_is_taken_in_one_go():
    slots = [step.target.slot for step in steps_of(direction_within_s=0)]
    assert slots == [2, 3, 4, 5, 6, 6, 5, 4, 3, 2, 2, 3, 4, 5, 6, 6, 5, 4, 3, 2]


def test_the_wheel_leaves_out_its_longest_empty_stretch():
    slots = Slots(polarizers={0.0: 1, 45.0: 2, 90.0: 6}, offset_deg=0.0, blocked=5, open=None)
    order = [step.target.slot for step in expand(recipe(analyzer_deg=[0.0, 45.0, 90.0], exit_deg=[0.0]), slots, TIMING)]
    assert order in ([5, 6, 1, 2], [2, 1, 6, 5])


def test_every_point_has_every_slot_once_and_the_angles_with_their_offset():
    for point in range(4):
        of_point = [step for step in steps_of() if step.point == point]
        held = {step.target.slot: (step.kind, step.analyzer_deg) for step in of_point}
        assert held == {
            2: ("signal", 10.0),
            3: ("signal", 55.0),
            4: ("signal", 100.0),
            5: ("signal", 145.0),
            6: ("dark", None),
        }
        assert {step.target.exit_deg for step in of_point} == {float(point)}


def test_references_stand_before_every_nth_point_through_the_open_slot():
    steps = steps_of(reference={"exit_deg": 45.0, "every_points": 2})
    references = [step for step in steps if step.kind == "reference"]
    assert [step.point for step in references] == [0, 2, 3]
    assert {(step.target.exit_deg, step.target.slot) for step in references} == {(45.0, 1)}
    assert len(steps) == 4 * 5 + 3


@pytest.mark.parametrize("every_points", [1, 2, 3, 100])
def test_a_reference_closes_the_scan_and_takes_its_time(every_points):
    steps = steps_of(reference={"exit_deg": 45.0, "every_points": every_points}, readings=[3, 3, 3, 7])
    *others, closing = steps
    assert (closing.kind, closing.point, closing.readings) == ("reference", 3, 7)
    assert {step.kind for step in others[-4:]} <= {"signal", "dark"}
    arm_s = 42 / 20 + 20 / 80
    assert closing.duration_s > arm_s + 7 * (0.03 + READING_S)
    assert steps_of()[-1].kind != "reference"


@given(st.floats(0.001, 300), st.floats(0.1, 100), st.floats(0.1, 1000))
def test_a_move_lasts_as_long_as_its_speed_profile(distance_deg, velocity_deg_s, acceleration_deg_s2):
    """The profile is integrated here: the distance under it must be the move's."""
    duration_s = AxisTiming(velocity_deg_s, acceleration_deg_s2, 0.0).move_s(distance_deg)
    ramp_s = min(velocity_deg_s / acceleration_deg_s2, duration_s / 2)
    top_deg_s = ramp_s * acceleration_deg_s2
    assert top_deg_s <= velocity_deg_s * (1 + 1e-12)
    assert_allclose(top_deg_s * (duration_s - ramp_s), distance_deg, rtol=1e-9)


@pytest.mark.parametrize(("start", "end", "slots"), [(1, 6, 1), (6, 1, 1), (2, 5, 3), (1, 4, 3), (3, 3, 0), (5, 1, 2)])
def test_the_wheel_goes_the_shorter_way(start, end, slots):
    assert WheelTiming(6, 0.5, 0.0).move_s(start, end) == slots * 0.5


def test_a_step_lasts_as_long_as_its_slowest_move_and_its_readings():
    first, second = steps_of(exit_deg=[30.0], readings=1, exposure_s=2.0)[:2]
    arm_s = 60 / 20 + 20 / 80
    assert first.target.slot != HOME.slot
    assert arm_s + 2.0 < first.duration_s < arm_s + 2.0 + 0.25
    assert 0.5 + 2.0 < second.duration_s < 0.5 + 2.0 + 0.25
    assert math.isfinite(first.duration_s)


def test_each_exit_angle_has_its_own_readings():
    steps = steps_of(readings=[1, 20, 3, 4], reference={"exit_deg": 45.0, "every_points": 2})
    for point, readings in enumerate((1, 20, 3, 4)):
        assert {step.readings for step in steps if step.point == point} == {readings}


def test_readings_take_the_time_that_they_take_whichever_way_they_are_written():
    once, listed = steps_of(readings=5), steps_of(readings=[5, 5, 5, 5])
    assert once == listed
    more = steps_of(readings=[5, 9, 5, 5])
    extra_s = sum(step.duration_s for step in more) - sum(step.duration_s for step in once)
    slots = 5
    assert_allclose(extra_s, slots * 4 * (0.03 + READING_S))


@pytest.mark.parametrize(
    ("readings", "message"),
    [
        ([3, 3], "got a list of 2; allowed: one number for each of the 4 exit angles, or one for all"),
        ([], "got a list of 0"),
        ([1, 2, 0, 4], "greater than or equal to 1"),
        ([1, 2, 2.5, 4], "valid integer"),
    ],
)
def test_a_list_of_readings_that_fits_no_angles_is_refused(readings, message):
    with pytest.raises(ValidationError, match=message):
        recipe(readings=readings)


def quick_arms(**changes):
    """A bench whose arms come to the next direction sooner than its wheel to the next slot."""
    return expand(recipe(exit_deg=[float(angle) for angle in range(40)], **changes), SLOTS, TIMING)


def begins_s(steps):
    """When the readings of each step begin, by direction."""
    now_s, begins = 0.0, {}
    for step in steps:
        now_s += step.duration_s
        begins.setdefault(step.point, []).append(now_s - step.readings * step.reading_s)
    return begins


@pytest.mark.parametrize("dark", [True, False])
@pytest.mark.parametrize("within_s", [0, 5, 20, 45, 1e6])
def test_the_readings_of_a_direction_lie_no_farther_apart_than_is_asked_for(within_s, dark):
    """Or it is taken in one go, which nothing makes shorter; with odd and even numbers of slots."""
    one_go_s = max(max(times) - min(times) for times in begins_s(quick_arms(direction_within_s=0, dark=dark)).values())
    steps = quick_arms(direction_within_s=within_s, dark=dark)
    spans_s = [max(times) - min(times) for times in begins_s(steps).values()]
    assert max(spans_s) <= max(within_s, one_go_s) + 1e-9
    assert {(step.point, step.target.slot) for step in steps} == {
        (point, slot) for point in range(40) for slot in (2, 3, 4, 5, 6)[: 4 + dark]
    }
    assert len(steps) == 40 * (4 + dark)


def test_the_longer_a_direction_may_take_the_shorter_the_scan():
    durations_s = [
        sum(step.duration_s for step in quick_arms(direction_within_s=within_s)) for within_s in (0, 5, 15, 60, 1e6)
    ]
    assert durations_s == sorted(durations_s, reverse=True)
    assert durations_s[-1] < 0.75 * durations_s[0]


def test_no_other_length_of_block_is_quicker():
    """Every length is tried here, by the durations of the whole scan."""
    best_s = sum(step.duration_s for step in quick_arms(direction_within_s=1e6))
    for within_s in range(1, 120):
        assert sum(step.duration_s for step in quick_arms(direction_within_s=within_s)) >= best_s - 1e-9


def test_where_slots_are_quicker_than_arms_every_direction_is_taken_in_one_go():
    quick = BenchTiming(ARM, ARM, ARM, WheelTiming(slots=6, slot_s=0.05, settle_s=0.0))
    steps = expand(recipe(direction_within_s=1e6), SLOTS, quick)
    assert [step.point for step in steps] == sorted(step.point for step in steps)


def test_no_sweep_leads_beyond_the_next_reference():
    steps = quick_arms(direction_within_s=1e6, reference={"exit_deg": 0.0, "every_points": 7})
    between, points = [], set()
    for step in steps:
        if step.kind == "reference":
            between.append(points)
            points = set()
        else:
            points.add(step.point)
    assert not points, "a reference closes the scan"
    assert [len(points) for points in between] == [0, 7, 7, 7, 7, 7, 5]
    assert set().union(*between) == set(range(40))


def test_the_arm_takes_the_directions_as_it_comes_by_whatever_their_order_in_the_recipe():
    steps = steps_of(exit_deg=[10.0, 0.0, 20.0, 30.0], readings=[4, 1, 3, 2], direction_within_s=0)
    assert list(dict.fromkeys(step.point for step in steps)) == [1, 0, 2, 3]
    assert all(step.readings == {0: 4, 1: 1, 2: 3, 3: 2}[step.point] for step in steps)
    downwards = steps_of(exit_deg=[20.0, 30.0, 10.0, 0.0], direction_within_s=0)
    assert list(dict.fromkeys(step.point for step in downwards)) == [1, 0, 2, 3]
