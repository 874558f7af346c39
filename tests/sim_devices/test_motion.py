"""Motion obeys its bounds, is smooth, and ends where and when it should."""

import math

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from sim_devices import motion
from sim_devices.axis import Axis
from sim_devices.wheel import Wheel

positions = st.floats(-400, 400)
speeds = st.floats(0.01, 50)
rates = st.floats(0.1, 500)
fractions = st.floats(0, 1)
quick = settings(max_examples=100, deadline=None)


@st.composite
def moves_from_motion(draw):
    """A move that interrupts another one at any moment."""
    limits = {"velocity_deg_s": draw(speeds), "acceleration_deg_s2": draw(rates), "deceleration_deg_s2": draw(rates)}
    first = motion.move(0.0, draw(positions), 0.0, draw(positions), **limits)
    interrupted_s = draw(fractions) * first.end_s
    limits["velocity_deg_s"] = draw(speeds)
    target = draw(positions)
    second = motion.move(interrupted_s, first.position(interrupted_s), first.velocity(interrupted_s), target, **limits)
    return first, second, target, limits


@quick
@given(moves_from_motion(), fractions, st.floats(1e-4, 1e-2))
def test_position_and_velocity_are_continuous_and_bounded(moves, fraction, step_s):
    first, second, _, limits = moves
    time_s = second.start_s + fraction * (second.end_s - second.start_s)
    top_speed = max(limits["velocity_deg_s"], abs(first.velocity(second.start_s)))
    top_rate = max(limits["acceleration_deg_s2"], limits["deceleration_deg_s2"])
    assert abs(second.velocity(time_s)) <= top_speed * (1 + 1e-9) + 1e-9
    change_deg = abs(second.position(time_s + step_s) - second.position(time_s))
    assert change_deg <= top_speed * step_s * (1 + 1e-9) + 1e-9
    # at the end, what is left of the velocity is its rounding error
    change_deg_s = abs(second.velocity(time_s + step_s) - second.velocity(time_s))
    assert change_deg_s <= top_rate * step_s * (1 + 1e-9) + 1e-6


@quick
@given(moves_from_motion())
def test_a_new_target_continues_from_the_state_of_motion_and_is_reached(moves):
    first, second, target, _ = moves
    assert_allclose(second.position(second.start_s), first.position(second.start_s), atol=1e-12)
    assert_allclose(second.velocity(second.start_s), first.velocity(second.start_s), atol=1e-12)
    assert second.position(second.end_s) == target
    assert second.velocity(second.end_s) == 0
    assert_allclose(second.position(second.end_s - 1e-9), target, atol=1e-5)


@quick
@given(moves_from_motion(), fractions)
def test_velocity_is_the_derivative_of_position(moves, fraction):
    _, second, _, limits = moves
    assume(second.end_s > second.start_s)
    time_s, step_s = second.start_s + fraction * (second.end_s - second.start_s), 1e-5
    assume(second.start_s + step_s <= time_s <= second.end_s - step_s)
    slope = (second.position(time_s + step_s) - second.position(time_s - step_s)) / (2 * step_s)
    top_rate = max(limits["acceleration_deg_s2"], limits["deceleration_deg_s2"])
    assert_allclose(second.velocity(time_s), slope, atol=top_rate * step_s + 1e-6)


@quick
@given(positions, positions, speeds, rates, rates)
def test_a_move_from_rest_takes_the_time_of_its_trapezoid_or_triangle(start, target, speed, rate, brake):
    profile = motion.move(
        5.0, start, 0.0, target, velocity_deg_s=speed, acceleration_deg_s2=rate, deceleration_deg_s2=brake
    )
    way, ramps = abs(target - start), speed**2 / 2 * (1 / rate + 1 / brake)
    if way >= ramps:
        expected_s = way / speed + speed / 2 * (1 / rate + 1 / brake)
    else:
        expected_s = math.sqrt(2 * way * (1 / rate + 1 / brake))
    assert_allclose(profile.end_s - 5.0, expected_s, rtol=1e-9, atol=1e-9)


@quick
@given(positions, st.floats(-50, 50), rates)
def test_a_stop_takes_its_distance_and_time(start, velocity, brake):
    profile = motion.stop(2.0, start, velocity, deceleration_deg_s2=brake)
    assert_allclose(profile.end_s, 2.0 + abs(velocity) / brake)
    assert_allclose(profile.end_deg - start, velocity * abs(velocity) / (2 * brake), atol=1e-9)
    assert profile.velocity(profile.end_s) == 0


def test_an_axis_that_is_too_fast_to_stop_before_its_target_comes_back():
    profile = motion.move(0.0, 0.0, 20.0, 1.0, velocity_deg_s=20, acceleration_deg_s2=80, deceleration_deg_s2=80)
    assert_allclose(max(profile.position(t / 1000) for t in range(1000)), 2.5, rtol=1e-6)
    assert profile.end_deg == 1.0


@quick
@given(moves_from_motion(), fractions)
def test_a_position_is_passed_when_it_says_so(moves, fraction):
    _, second, _, _ = moves
    way_deg = second.end_deg - second.start_deg
    wanted = second.start_deg + fraction * way_deg
    passes_s = second.passes_at(wanted, second.start_s)
    assert passes_s is not None
    assert_allclose(second.position(passes_s), wanted, atol=1e-6)


def test_a_position_beyond_the_target_is_never_passed():
    profile = motion.move(0.0, 0.0, 0.0, 10.0, velocity_deg_s=5, acceleration_deg_s2=9, deceleration_deg_s2=9)
    assert profile.passes_at(10.1, 0.0) is None
    assert profile.passes_at(-0.1, 0.0) is None
    assert profile.passes_at(2.0, 1.5) is None


@quick
@given(st.floats(-170, 170), st.sampled_from([0.0005, 0.02, 0.3]))
def test_an_axis_rests_on_the_nearest_encoder_step(target, step_deg):
    axis = Axis(step_deg)
    axis.move(target, 0.0, velocity_deg_s=20, acceleration_deg_s2=80, deceleration_deg_s2=80)
    rest = axis.position_deg(1e3)
    assert abs(rest - target) <= step_deg / 2 * (1 + 1e-9)
    assert_allclose(rest / step_deg, round(rest / step_deg), atol=1e-6)


def test_an_axis_stops_from_a_move_and_forgets_what_was_to_follow():
    axis = Axis(0.001)
    limits = {"velocity_deg_s": 20, "acceleration_deg_s2": 80, "deceleration_deg_s2": 80}
    axis.move(60, 0.0, **limits)
    axis.move(0, axis.end_s, **limits)
    axis.stop(1.0, deceleration_deg_s2=80)
    # 2.5 deg to get fast, 0.75 s at 20 deg/s, 2.5 deg to stop
    assert_allclose(axis.position_deg(100.0), 20.0)
    assert not axis.is_moving(1.25)
    assert axis.is_moving(1.249)


@pytest.mark.parametrize(
    ("start", "slot", "slots", "steps"),
    [(1, 2, 6, 1), (1, 6, 6, 1), (6, 1, 6, 1), (2, 5, 6, 3), (5, 2, 6, 3), (1, 1, 6, 0), (2, 11, 12, 3), (1, 7, 12, 6)],
)
def test_the_wheel_takes_the_shorter_way_round(start, slot, slots, steps):
    wheel = Wheel()
    arrived_s = wheel.turn(start, 0.0, slots=slots, slot_s=0.5)
    end_s = wheel.turn(slot, arrived_s + 1.0, slots=slots, slot_s=0.5)
    assert_allclose(end_s - arrived_s - 1.0, 0.5 * steps)
    assert wheel.slot(arrived_s + 0.5) == start
    assert wheel.slot(end_s) == slot
    if steps:
        assert wheel.slot(end_s - 1e-6) is None
