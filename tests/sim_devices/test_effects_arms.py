"""Effects of arms and encoders: the light sees where an arm is, the controller what its encoder tells."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from model.lobes import Diffuse, Directional, Specular
from model.surface import Surface
from sim_devices.axis import Axis
from sim_devices.effects.backlash import Load
from sim_devices.world import World

FAST = {"velocity_deg_s": 1e3, "acceleration_deg_s2": 1e4, "deceleration_deg_s2": 1e4}
SLOW = {"velocity_deg_s": 5.0, "acceleration_deg_s2": 10.0, "deceleration_deg_s2": 10.0}
ARMS = ("source_arm", "detector_arm")


def expected_w(incidence_deg, exit_deg):
    index = 2.950 + 2.932j
    surface = Surface([Specular(0.7, 0.1764, index), Diffuse(0.1, 0.1764), Directional(0.05, 0.1764, index)])
    s0 = surface.stokes(math.radians(incidence_deg), math.radians(exit_deg), math.pi)[0]
    return 1e-6 * math.cos(math.radians(exit_deg)) * s0


def moved(world, incidence_deg, exit_deg, start_s=0.0):
    """Turn both motors; they rest 90 s later."""
    world.axes["source_arm"].move(incidence_deg, start_s, **FAST)
    world.axes["detector_arm"].move(exit_deg, start_s, **FAST)
    return world


@pytest.mark.parametrize(("axis", "true_deg"), [("source_arm", (40.3, 25.0)), ("detector_arm", (40.0, 25.3))])
def test_an_offset_zero_shifts_the_arm(scene_with, axis, true_deg):
    offset = {"effect": "zero_offset", "axis": axis, "offset_deg": 0.3}
    world = moved(World(scene_with(effects=[offset])), 40.0, 25.0)
    assert_allclose(world.power_w(100.0), expected_w(*true_deg), rtol=1e-12)
    assert world.axes[axis].position_deg(100.0) in (40.0, 25.0)


def test_the_specular_peak_of_an_arm_with_an_offset_zero_is_where_the_offset_says(scene_with):
    offset = {"effect": "zero_offset", "axis": "detector_arm", "offset_deg": -0.8}
    shifted, straight = World(scene_with(effects=[offset])), World(scene_with())
    for arm_deg in (10.0, 18.0, 25.0):
        there, here = moved(shifted, 20.0, arm_deg), moved(straight, 20.0, arm_deg - 0.8)
        assert_allclose(there.power_w(100.0), here.power_w(100.0), rtol=1e-9)


def test_an_arm_bends_by_the_sine_of_its_angle(scene_with):
    bend = {"effect": "flexure", "axis": "detector_arm", "amplitude_deg": 0.4}
    world = moved(World(scene_with(effects=[bend])), 40.0, 60.0)
    assert_allclose(world.power_w(100.0), expected_w(40.0, 60.0 + 0.4 * math.sqrt(0.75)), rtol=1e-12)
    assert moved(world, 40.0, 0.0, 200.0).power_w(300.0) == moved(World(scene_with()), 40.0, 0.0).power_w(100.0)


def test_an_arm_bends_by_its_true_angle(scene_with):
    bend = {"effect": "flexure", "axis": "detector_arm", "amplitude_deg": 0.4}
    offset = {"effect": "zero_offset", "axis": "detector_arm", "offset_deg": 5.0}
    world = moved(World(scene_with(effects=[bend, offset])), 40.0, 25.0)
    assert_allclose(world.power_w(100.0), expected_w(40.0, 30.0 + 0.4 * 0.5), rtol=1e-12)


def test_an_arm_with_play_lags_its_motor_by_half_of_it(scene_with):
    play = {"effect": "backlash", "axis": "detector_arm", "play_deg": 0.2}
    world = moved(World(scene_with(effects=[play])), 40.0, 30.0)
    assert_allclose(world.power_w(100.0), expected_w(40.0, 29.9), rtol=1e-12)
    # a reversal by less than the play moves no light, the rest does
    assert_allclose(moved(world, 40.0, 29.85, 100.0).power_w(200.0), expected_w(40.0, 29.9), rtol=1e-12)
    assert_allclose(moved(world, 40.0, 25.0, 200.0).power_w(300.0), expected_w(40.0, 25.1), rtol=1e-12)
    assert_allclose(world.axes["detector_arm"].position_deg(300.0), 25.0)


def test_approached_from_one_side_play_is_a_constant_offset_and_from_both_it_is_the_play(scene_with):
    play = {"effect": "backlash", "axis": "source_arm", "play_deg": 0.05}
    world = World(scene_with(effects=[play]))
    arm, angle_deg = world.axes["source_arm"], world.angle_deg["source_arm"]
    seen = []
    for start_s, target_deg in enumerate([10.0, 20.0, 30.0, 40.0, 30.0]):
        arm.move(target_deg, 100.0 * start_s, **FAST)
        seen.append(angle_deg(100.0 * start_s + 99) - target_deg)
    assert_allclose(seen, [-0.025, -0.025, -0.025, -0.025, 0.025], atol=1e-12)


def played(axis, play_deg, times_s):
    """The play operator by brute force, along a fine grid of times."""
    angle_deg, angles = 0.0, []
    for motor_deg in map(axis.motor_deg, times_s):
        if motor_deg - angle_deg > play_deg / 2:
            angle_deg = motor_deg - play_deg / 2
        elif angle_deg - motor_deg > play_deg / 2:
            angle_deg = motor_deg + play_deg / 2
        angles.append(angle_deg)
    return np.array(angles)


COMMANDS = st.lists(st.tuples(st.floats(-30, 30), st.floats(0.01, 8), st.booleans()), min_size=1, max_size=8)


@settings(max_examples=60, deadline=None)
@given(COMMANDS, st.floats(0.01, 5))
def test_play_follows_every_turning_point_of_the_motor(commands, play_deg):
    axis = Axis(0.0005)
    load, now_s = Load(axis, play_deg), 0.0
    for target_deg, wait_s, stops in commands:
        axis.move(target_deg, now_s, **SLOW)
        now_s += wait_s
        if stops:
            axis.stop(now_s, deceleration_deg_s2=10.0)
            now_s += 0.3
    times_s = np.linspace(0.0, now_s + 20, 4001)
    seen = np.array([load.angle_deg(time_s) for time_s in times_s])
    # between two times of the grid the motor turns by no more than that, and no turning point lies deeper
    step_deg = 5.0 * times_s[1]
    assert_allclose(seen, played(axis, play_deg, times_s), atol=step_deg)
    assert np.abs(seen - [axis.motor_deg(time_s) for time_s in times_s]).max() <= play_deg / 2 + 1e-12


def test_play_remembers_more_steps_than_an_axis_does():
    axis = Axis(0.0005)
    load = Load(axis, 1.0)
    for step in range(1, 301):
        axis.move(0.001 * step, float(step), **FAST)
    assert load.angle_deg(400.0) == 0.0
    axis.move(0.6, 500.0, **FAST)
    for step in range(1, 301):
        axis.move(0.6 - 0.001 * step, 600.0 + step, **FAST)
    assert_allclose(load.angle_deg(1000.0), 0.1, atol=1e-12)


def test_play_forgets_a_motion_that_was_queued_and_never_came():
    axis = Axis(0.0005)
    load = Load(axis, 1.0)
    axis.move(20.0, 100.0, **FAST)
    axis.move(5.0, 50.0, **FAST)
    assert_allclose(load.angle_deg(99.0), 4.5)
    assert_allclose(load.angle_deg(200.0), 4.5)
    assert load.angle_deg(10.0) == 0.0


def ask(world, command, now_s):
    return b"".join(text for _, text in world.devices["arms"].session().receive(command, now_s))


def test_a_coarse_encoder_tells_its_own_steps_and_the_light_does_not_care(scene_with):
    coarse = {"effect": "encoder_step", "axis": "source_arm", "step_deg": 0.05}
    world, plain = World(scene_with(effects=[coarse])), World(scene_with())
    for bench in (world, plain):
        ask(bench, b"1MO;1PA12.34\r", 0.0)
    assert ask(plain, b"1TP\r", 50.0) == b"12.340000\r\n"
    assert ask(world, b"1TP\r", 50.0) == b"12.350000\r\n"
    assert world.power_w(50.0) == plain.power_w(50.0)


def test_a_noisy_encoder_scatters_about_where_the_axis_is(scene_with):
    noisy = {"effect": "encoder_noise", "axis": "detector_arm", "stddev_deg": 0.02}
    world = moved(World(scene_with(effects=[noisy])), 40.0, 25.0)
    told_deg = np.array([world.axes["detector_arm"].position_deg(100 + 0.001 * tick) for tick in range(4000)])
    assert_allclose(told_deg.std(), 0.02, rtol=0.05)
    assert_allclose(told_deg.mean(), 25.0, atol=4 * 0.02 / math.sqrt(4000))
    assert world.axes["source_arm"].position_deg(100.0) == 40.0
    assert world.power_w(100.0) == moved(World(scene_with()), 40.0, 25.0).power_w(100.0)


def test_the_noise_of_an_encoder_is_a_function_of_seed_axis_and_time(scene_with):
    noisy = [{"effect": "encoder_noise", "axis": axis, "stddev_deg": 0.02} for axis in ARMS]
    times_s = [5.0, 1.0, 5.0, 2.5]
    one, again, other = (World(scene_with(effects=noisy, seed=seed)) for seed in (1, 1, 2))
    again.axes["source_arm"].position_deg(3.0)
    told = [[world.axes[axis].position_deg(time_s) for time_s in times_s] for world in (one, again) for axis in ARMS]
    assert told[:2] == told[2:]
    assert told[0][0] == told[0][2] != told[0][1]
    assert told[0][0] != told[1][0]
    assert other.axes["source_arm"].position_deg(5.0) != told[0][0]


def test_a_controller_asks_its_encoder_and_moves_its_motor(scene_with):
    noisy = {"effect": "encoder_noise", "axis": "source_arm", "stddev_deg": 0.5}
    world = World(scene_with(effects=[noisy]))
    ask(world, b"1MO;1PA12.34\r", 0.0)
    ask(world, b"1PR1\r", 50.0)
    assert_allclose([world.angle_deg["source_arm"](time_s) for time_s in (50.0, 100.0)], [12.34, 13.34], atol=1e-9)
    assert abs(float(ask(world, b"1TP\r", 100.0)) - 13.34) > 1e-3
