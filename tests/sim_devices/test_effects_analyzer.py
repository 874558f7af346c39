"""Each effect of the analyzer changes the signal by the amount predicted on paper."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose

from model.lobes import Diffuse, Directional, Specular
from model.surface import Surface
from sim_devices.analyzer import RotatingPolarizer, turned
from sim_devices.axis import Axis
from sim_devices.world import World

FAST = {"velocity_deg_s": 1e3, "acceleration_deg_s2": 1e4, "deceleration_deg_s2": 1e4}
ANGLES_DEG = {2: 0.0, 3: 45.0, 4: 90.0, 5: 135.0}
ERRORS = {"effect": "slot_angle_errors", "errors_deg": {3: 1.5, 4: -0.7}}
SHARES = {"effect": "slot_transmissions", "relative": {1: 0.9, 3: 0.97}}
LEAK = {"effect": "extinction_ratio", "ratio": 200.0}
WOBBLE = {"effect": "wheel_wobble", "stddev_deg": 0.8}


@pytest.fixture
def bench(scene_with):
    """A world with some effects that looks at light of every linear state: exit 20 deg under 60 deg of incidence."""

    def at_rest(*effects, slot=1, **parts):
        world = World(scene_with(effects=effects, **parts))
        world.axes["source_arm"].move(60.0, 0.0, **FAST)
        world.axes["detector_arm"].move(20.0, 0.0, **FAST)
        world.analyzer.wheel.turn(slot, 0.0, slots=6, slot_s=0.5)
        return world

    return at_rest


@pytest.fixture
def arriving_w():
    index = 2.950 + 2.932j
    surface = Surface([Specular(0.7, 0.1764, index), Diffuse(0.1, 0.1764), Directional(0.05, 0.1764, index)])
    return 1e-6 * math.cos(math.radians(20)) * surface.stokes(math.radians(60), math.radians(20), math.pi)


def passed_w(stokes_w, angle_deg, leak=0.0):
    """Malus: the intensity along the axis, and a share of that across it."""
    twice_rad = math.radians(2 * angle_deg)
    polarized_w = math.cos(twice_rad) * stokes_w[1] + math.sin(twice_rad) * stokes_w[2]
    return (stokes_w[0] + polarized_w) / 2 + leak * (stokes_w[0] - polarized_w) / 2


@pytest.mark.parametrize(("slot", "error_deg"), [(1, None), (2, 0.0), (3, 1.5), (4, -0.7), (5, 0.0)])
def test_a_polarizer_stands_off_its_angle_by_its_error(bench, arriving_w, slot, error_deg):
    expected_w = arriving_w[0] if error_deg is None else passed_w(arriving_w, ANGLES_DEG[slot] + error_deg)
    assert_allclose(bench(ERRORS, slot=slot).power_w(100.0), expected_w, rtol=1e-12)


def test_an_error_of_angle_changes_the_signal_to_first_order_where_the_polarizer_is_aslant(bench, arriving_w):
    small = {"effect": "slot_angle_errors", "errors_deg": {3: 0.01}}
    change_w = bench(small, slot=3).power_w(100.0) - bench(slot=3).power_w(100.0)
    # d/dψ ½ (S0 + S1 cos 2ψ + S2 sin 2ψ) at 45 deg is -S1
    assert_allclose(change_w, -arriving_w[1] * math.radians(0.01), rtol=1e-3)


@pytest.mark.parametrize(("slot", "share"), [(1, 0.9), (2, 1.0), (3, 0.97), (4, 1.0), (6, 1.0)])
def test_a_slot_passes_its_share(bench, slot, share):
    assert_allclose(bench(SHARES, slot=slot).power_w(100.0), share * bench(slot=slot).power_w(100.0), rtol=1e-12)


@pytest.mark.parametrize("slot", ANGLES_DEG)
def test_a_polarizer_leaks_one_part_in_its_extinction_ratio(bench, arriving_w, slot):
    assert_allclose(bench(LEAK, slot=slot).power_w(100.0), passed_w(arriving_w, ANGLES_DEG[slot], 1 / 200), rtol=1e-12)


def test_crossed_light_is_down_by_the_extinction_ratio(bench):
    row = bench(LEAK, slot=4).row(100.0)
    p_light, s_light = np.array([1, -1, 0, 0]), np.array([1, 1, 0, 0])
    assert_allclose((row @ p_light) / (row @ s_light), 200.0, rtol=1e-12)


def test_an_open_slot_has_no_axis_to_leak_across(bench):
    assert bench(LEAK, slot=1).power_w(100.0) == bench().power_w(100.0)
    assert bench(LEAK, slot=6).power_w(100.0) == 0.0


def test_all_that_is_wrong_with_a_slot_adds_up(bench, arriving_w):
    expected_w = 0.97 * passed_w(arriving_w, 46.5, 1 / 200)
    assert_allclose(bench(SHARES, LEAK, ERRORS, slot=3).power_w(100.0), expected_w, rtol=1e-12)


def arrivals_deg(world, arriving_w, times_s):
    """Angles at which the polarizer of slot 3 came to rest at these times, each after a turn away and back."""
    found = []
    for time_s in times_s:
        world.analyzer.wheel.turn(4, time_s, slots=6, slot_s=0.5)
        world.analyzer.wheel.turn(3, time_s + 1, slots=6, slot_s=0.5)
        # ½ (S0 + S1 cos(90 deg + 2δ)) with S2 = 0
        passed = world.power_w(time_s + 2)
        found.append(math.degrees(math.asin((arriving_w[0] - 2 * passed) / arriving_w[1])) / 2)
    return np.array(found)


def test_a_wobbling_wheel_comes_to_rest_at_another_angle_each_time(bench, arriving_w):
    found_deg = arrivals_deg(bench(WOBBLE), arriving_w, 100.0 + 10 * np.arange(1000))
    assert_allclose(found_deg.std(), 0.8, rtol=0.1)
    assert_allclose(found_deg.mean(), 0.0, atol=4 * 0.8 / math.sqrt(1000))
    # one arrival knows nothing of the next
    assert abs(np.corrcoef(found_deg[1:], found_deg[:-1])[0, 1]) < 4 / math.sqrt(1000)


def test_a_wobble_depends_on_seed_and_number_of_the_arrival_not_on_time(bench, arriving_w):
    slow = arrivals_deg(bench(WOBBLE), arriving_w, 100.0 + 10 * np.arange(20))
    fast = arrivals_deg(bench(WOBBLE), arriving_w, 100.0 + 3 * np.arange(20))
    other = arrivals_deg(bench(WOBBLE, seed=2), arriving_w, 100.0 + 3 * np.arange(20))
    assert np.array_equal(slow, fast)
    assert not np.any(slow == other)


def test_a_wheel_at_rest_does_not_wobble_nor_does_one_told_to_stay(bench):
    world = bench(WOBBLE, slot=3)
    at_rest_w = world.power_w(100.0)
    assert world.power_w(200.0) == world.power_w(100.0) != bench(slot=3).power_w(100.0)
    world.analyzer.wheel.turn(3, 300.0, slots=6, slot_s=0.5)
    assert world.power_w(400.0) == at_rest_w
    world.analyzer.wheel.turn(4, 500.0, slots=6, slot_s=0.5)
    world.analyzer.wheel.turn(3, 600.0, slots=6, slot_s=0.5)
    assert world.power_w(700.0) != at_rest_w


def test_a_turn_to_come_does_not_wobble_what_is_in_the_beam(bench):
    world = bench(WOBBLE, slot=3)
    now_w = world.power_w(100.0)
    world.analyzer.wheel.turn(4, 200.0, slots=6, slot_s=0.5)
    assert world.power_w(100.0) == now_w


def test_an_open_slot_may_wobble_as_it_likes(bench):
    assert bench(WOBBLE, slot=1).power_w(100.0) == bench(slot=1).power_w(100.0)


@pytest.mark.parametrize("angle_deg", [0.0, 30.0, -75.0])
def test_a_turned_row_is_that_of_the_turned_polarizer(angle_deg):
    axis = Axis(0.001)
    axis.move(angle_deg + 20.0, 0.0, **FAST)
    # what an encoder tells turns no polarizer
    axis.position_deg = lambda time_s: 0.0
    twice_rad = math.radians(2 * angle_deg)
    row = 0.5 * np.array([1, math.cos(twice_rad), math.sin(twice_rad), 0])
    assert_allclose(turned(row, 20.0), RotatingPolarizer(axis.motor_deg).row(100.0), atol=1e-15)


def test_turning_an_element_leaves_what_it_does_to_circular_light():
    assert_allclose(turned(np.array([0.5, 0.0, 0.0, 0.5]), 33.0), [0.5, 0.0, 0.0, 0.5])


@pytest.mark.parametrize("angle_deg", [0.0, 30.0, 45.0, 100.0])
def test_behind_a_reference_polarizer_the_analyzer_follows_malus(bench, arriving_w, angle_deg):
    """Without a leak: the intensity along the reference, times cos² of the angle to the slot's polarizer."""
    reference = {"effect": "reference_polarizer", "angle_deg": angle_deg - 2.0, "error_deg": 2.0}
    for slot, slot_deg in ANGLES_DEG.items():
        expected_w = passed_w(arriving_w, angle_deg) * math.cos(math.radians(slot_deg - angle_deg)) ** 2
        found_w = bench(reference | {"extinction_ratio": 1e12}, slot=slot).power_w(100.0)
        assert_allclose(found_w, expected_w, rtol=1e-5, atol=1e-6 * arriving_w[0])


def test_a_reference_polarizer_leaks_amplitudes_and_so_turns_polarized_light(bench):
    """Jones: light at 45 degrees passes an element diag(1, √e) as (1, √e)/√2, polarized at atan √e."""
    leak = 1e-4
    world = bench({"effect": "reference_polarizer", "extinction_ratio": 1 / leak})
    (effect,) = world.scene.effects
    out = effect.mueller() @ [1.0, 0.0, 1.0, 0.0]
    assert_allclose(0.5 * math.atan2(out[2], out[1]), math.atan(math.sqrt(leak)), rtol=1e-9)
    assert_allclose(out[0], (1 + leak) / 2, rtol=1e-12)
    assert_allclose(math.hypot(out[1], out[2]), out[0], rtol=1e-9)
