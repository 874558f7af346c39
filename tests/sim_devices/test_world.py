"""The light at the detector follows its formula; effects act in their order and draw their own random numbers."""

import math

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from model.acceptance import Acceptance, half_angle_rad
from model.lobes import Diffuse, Directional, Specular
from model.surface import Surface
from sim_devices.analyzer import analyzer_row
from sim_devices.world import World

FAST = {"velocity_deg_s": 1e3, "acceleration_deg_s2": 1e4, "deceleration_deg_s2": 1e4}
DARK = {"effect": "dark_current", "power_w": 2e-10}
SHOT = {"effect": "shot_noise"}
READ = {"effect": "read_noise", "power_w": 2e-9}
DIGITS = {"effect": "quantisation", "digits": 4}


def aimed(world, incidence_deg, exit_deg, slot):
    """Turn the bench to a geometry; it rests there at 100 s."""
    world.axes["source_arm"].move(incidence_deg, 0.0, **FAST)
    world.axes["detector_arm"].move(exit_deg, 0.0, **FAST)
    world.analyzer.wheel.turn(slot, 0.0, slots=6, slot_s=0.5)
    return world


def expected_w(incidence_deg, exit_deg, slot):
    index = 2.950 + 2.932j
    surface = Surface([Specular(0.7, 0.1764, index), Diffuse(0.1, 0.1764), Directional(0.05, 0.1764, index)])
    azimuth_rad = math.pi if exit_deg >= 0 else 0.0
    s0, s1, s2, _ = surface.stokes(math.radians(incidence_deg), math.radians(abs(exit_deg)), azimuth_rad)
    angles_deg = {2: 0, 3: 45, 4: 90, 5: 135}
    if slot == 6:
        return 0.0
    seen = s0
    if slot in angles_deg:
        psi = math.radians(angles_deg[slot])
        seen = (s0 + math.cos(2 * psi) * s1 + math.sin(2 * psi) * s2) / 2
    return 1e-3 * 1e-3 * math.cos(math.radians(exit_deg)) * seen


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.integers(0, 1798), st.integers(-1798, 1798), st.integers(1, 6))
def test_power_is_the_lamp_seen_through_surface_acceptance_and_analyzer(scene_with, incidence, exit_, slot):
    incidence_deg, exit_deg = incidence / 20, exit_ / 20
    world = aimed(World(scene_with()), incidence_deg, exit_deg, slot)
    assert_allclose(world.power_w(100.0), expected_w(incidence_deg, exit_deg, slot), rtol=1e-9, atol=1e-25)


@pytest.mark.parametrize("exit_deg", [-20.0, 59.9, 60.0, 60.5])
def test_light_of_several_bounces_is_averaged_over_the_meters_cone(scene_with, exit_deg):
    sample = {"material": "Fe", "sigma": 0.4, "asymmetry": 0.3, "bounces": 3, "rho_s": 0.7, "rho_d": 0, "rho_dd": 0}
    world = aimed(World(scene_with(sample=sample, effects=[{"effect": "acceptance_cone"}])), 60.0, exit_deg, 1)
    surface = Surface([Specular(0.7, 0.4, 2.950 + 2.932j, 0.3, 3)])
    seen = Acceptance(surface, half_angle_rad(1e-3))
    s0 = seen.stokes(math.radians(60.0), math.radians(abs(exit_deg)), math.pi if exit_deg >= 0 else 0.0)[0]
    assert_allclose(world.power_w(100.0), 1e-3 * 1e-3 * math.cos(math.radians(exit_deg)) * s0, rtol=1e-9)
    assert "acceptance_cone" in world.describe()


@pytest.mark.parametrize("angle_deg", [0, 30, 45, 90, 135, -20])
def test_an_analyzer_passes_light_along_its_axis_and_stops_light_across(angle_deg):
    twice_rad = math.radians(2 * angle_deg)
    along = np.array([1, math.cos(twice_rad), math.sin(twice_rad), 0])
    assert_allclose(analyzer_row(angle_deg) @ along, 1)
    assert_allclose(analyzer_row(angle_deg) @ (along * [1, -1, -1, 1]), 0, atol=1e-15)


def test_s_polarized_light_is_what_the_zero_degree_slot_passes(scene_with):
    through_s = aimed(World(scene_with()), 60, 60, 2).power_w(100.0)
    through_p = aimed(World(scene_with()), 60, 60, 4).power_w(100.0)
    assert through_s > 1.5 * through_p


def test_light_from_the_other_side_is_the_mirror_image(scene_with):
    one = aimed(World(scene_with()), 40, 25, 3).power_w(100.0)
    other = aimed(World(scene_with()), -40, -25, 3).power_w(100.0)
    assert_allclose(other, one, rtol=1e-12)


@pytest.mark.parametrize(("incidence_deg", "exit_deg"), [(90, 10), (10, 90), (10, -95), (120, 0)])
def test_below_the_horizon_it_is_dark(scene_with, incidence_deg, exit_deg):
    assert aimed(World(scene_with()), incidence_deg, exit_deg, 1).power_w(100.0) == 0


def test_no_light_passes_while_the_wheel_turns(scene_with):
    world = World(scene_with())
    world.analyzer.wheel.turn(2, 10.0, slots=6, slot_s=0.5)
    assert world.power_w(9.99) > 0
    assert world.power_w(10.25) == 0
    assert world.power_w(10.5) > 0


def test_a_reading_is_of_the_geometry_at_its_middle(scene_with):
    world = World(scene_with())
    world.analyzer.wheel.turn(2, 10.0, slots=6, slot_s=0.5)
    assert world.measure_w(10.3, 0.3) == 0
    assert world.measure_w(10.3, 0.5) > 0
    world.axes["detector_arm"].move(30, 20.0, velocity_deg_s=1, acceleration_deg_s2=1e3, deceleration_deg_s2=1e3)
    moving = world.measure_w(35.0, 2.0)
    assert moving == world.power_w(36.0)
    assert len({moving, world.power_w(35.0), world.power_w(100.0)}) == 3


def test_the_sample_is_computed_once_while_the_arms_stand_and_anew_when_one_has_moved(scene_with, monkeypatch):
    world, computed = World(scene_with()), []
    (sample,) = world._samples.values()
    stokes = sample.stokes

    def noted(*geometry):
        computed.append(geometry)
        return stokes(*geometry)

    monkeypatch.setattr(sample, "stokes", noted)
    aimed(world, 50, 20, 1)
    powers_w = [world.power_w(time_s) for time_s in (100.0, 101.0, 102.0)]
    assert (len(computed), len(set(powers_w))) == (1, 1)
    # light of another slot, of the same sample
    world.analyzer.wheel.turn(2, 110.0, slots=6, slot_s=0.5)
    assert world.power_w(120.0) != powers_w[0]
    assert len(computed) == 1
    world.axes["detector_arm"].move(30, 130.0, velocity_deg_s=10, acceleration_deg_s2=1e3, deceleration_deg_s2=1e3)
    world.analyzer.wheel.turn(1, 130.0, slots=6, slot_s=0.5)
    assert world.power_w(140.0) != powers_w[0]
    assert len(computed) == 2


def test_a_lobe_of_no_weight_is_not_part_of_the_surface(scene_with):
    sample = {"material": "Fe", "sigma": 0.2, "rho_s": 0, "rho_d": 0.3, "rho_dd": 0}
    world = aimed(World(scene_with(sample=sample)), 50, 20, 2)
    whole = aimed(World(scene_with(sample=sample)), 50, 20, 1)
    assert_allclose(world.power_w(100.0), whole.power_w(100.0) / 2, rtol=1e-12)


def readings(scene, count, exposure_s=0.03):
    world = World(scene)
    return np.array([world.measure_w(100.0, exposure_s) for _ in range(count)])


def test_without_effects_a_reading_is_the_power_to_the_last_bit(scene_with):
    world = World(scene_with())
    assert world.measure_w(100.0, 0.003) == world.power_w(100.0)


def test_effects_act_in_the_order_of_light_and_electrons_whatever_the_file_says(scene_with):
    forward = readings(scene_with(effects=[DARK, SHOT, READ, DIGITS]), 5)
    backward = readings(scene_with(effects=[DIGITS, READ, SHOT, DARK]), 5)
    assert np.array_equal(forward, backward)


def test_the_world_says_which_effects_it_has(scene_with):
    play = {"effect": "backlash", "axis": "source_arm", "play_deg": 0.1}
    present, absent = World(scene_with(effects=[SHOT, DARK, play])).describe().split(". ")
    assert present.endswith(": backlash of source_arm, dark_current, shot_noise")
    assert absent.endswith("nonlinearity, read_noise, saturation, quantisation.")
    assert not any(name in absent for name in ("backlash", "dark_current", "shot_noise"))
    assert World(scene_with()).describe().startswith("Between motors and readings: nothing.")


def test_same_seed_same_readings_and_another_seed_others(scene_with):
    noise = [SHOT, READ]
    one, again = readings(scene_with(effects=noise), 20), readings(scene_with(effects=noise), 20)
    other = readings(scene_with(effects=noise, seed=2), 20)
    assert np.array_equal(one, again)
    assert not np.any(one == other)


def test_the_noise_of_a_measurement_depends_on_its_number_only(scene_with):
    world = World(scene_with(effects=[READ]))
    world.measure_w(0.0, 0.3)
    second = world.measure_w(7.0, 0.003)
    assert second == readings(scene_with(effects=[READ]), 2, 0.003)[1]


@pytest.mark.parametrize("turns", [-360, 360, 720])
def test_whole_turns_of_an_arm_make_no_difference(scene_with, turns):
    once = aimed(World(scene_with()), 60, 40, 1).power_w(100.0)
    assert_allclose(aimed(World(scene_with()), 60, 40 + turns, 1).power_w(100.0), once, rtol=1e-9)
