"""Each effect of lamp, room and cones changes the light by the amount predicted on paper."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose

from model.lobes import Diffuse, Directional, Specular
from model.surface import Surface
from sim_devices.world import World

FAST = {"velocity_deg_s": 1e3, "acceleration_deg_s2": 1e4, "deceleration_deg_s2": 1e4}
DRIFT = {"effect": "lamp_drift", "relative_per_hour": -0.05}
WALK = {"effect": "lamp_walk", "relative_per_root_hour": 0.02}
FLICKER = {"effect": "flicker", "relative_amplitude": 0.1, "frequency_hz": 7.0}
STRAY = {"effect": "stray_light", "power_w": 3e-9}
CONE = {"effect": "source_cone", "half_angle_deg": 3.0}


@pytest.fixture
def bench(scene_with):
    """A world with some effects that rests at a geometry from 10 s on."""

    def at_rest(*effects, incidence_deg=50.0, exit_deg=35.0, slot=1, **parts):
        world = World(scene_with(effects=effects, **parts))
        world.axes["source_arm"].move(incidence_deg, 0.0, **FAST)
        world.axes["detector_arm"].move(exit_deg, 0.0, **FAST)
        world.analyzer.wheel.turn(slot, 0.0, slots=6, slot_s=0.5)
        return world

    return at_rest


@pytest.mark.parametrize("hours", [0.01, 1.0, 7.0])
@pytest.mark.parametrize("rate", [-0.05, 0.2])
def test_a_drifting_lamp_changes_by_its_rate(bench, hours, rate):
    world, steady_w = bench(DRIFT | {"relative_per_hour": rate}), bench().power_w(3600 * hours)
    assert_allclose(world.power_w(3600 * hours) / steady_w, math.exp(rate * hours), rtol=1e-12)
    assert_allclose(world.measure_w(3600 * hours - 0.15, 0.3), world.power_w(3600 * hours), rtol=1e-12)


@pytest.mark.parametrize("hours", [0.25, 1.0])
def test_a_walking_lamp_spreads_with_the_root_of_time(scene_with, hours):
    steady_w = World(scene_with()).power_w(0.0)
    worlds = [World(scene_with(effects=[WALK], seed=seed)) for seed in range(300)]
    walked = np.log([world.power_w(3600 * hours) / steady_w for world in worlds])
    assert_allclose(walked.std(), 0.02 * math.sqrt(hours), rtol=0.15)
    assert_allclose(walked.mean(), 0.0, atol=4 * 0.02 * math.sqrt(hours / 300))


def test_a_walking_lamp_is_a_function_of_time_alone(bench):
    times_s = np.array([1000.0, 10.0, 503.7, 9000.0, 503.7])
    walked_w = [bench(WALK).power_w(time_s) for time_s in times_s]
    asked_in_turn = bench(WALK)
    assert [asked_in_turn.power_w(time_s) for time_s in times_s] == walked_w
    assert len(set(walked_w)) == 4
    other = bench(WALK, seed=2)
    assert not any(other.power_w(time_s) == power_w for time_s, power_w in zip(times_s, walked_w, strict=True))


def test_a_walking_lamp_does_not_jump(bench):
    world = bench(WALK)
    powers_w = np.array([world.power_w(100 + 0.1 * step) for step in range(2000)])
    # ten seconds' step, 0.02 sqrt(10 / 3600), in 100 parts; five times that is never reached
    assert np.abs(np.diff(np.log(powers_w))).max() < 5 * 0.02 * math.sqrt(10 / 3600) / 100


def test_a_flickering_lamp_is_a_sine_at_an_instant(bench):
    steady_w, world = bench().power_w(100.0), bench(FLICKER)
    # 700 whole periods and a quarter, a half, three quarters
    for quarters, factor in enumerate([1.0, 1.1, 1.0, 0.9]):
        assert_allclose(world.power_w(100.0 + quarters / 28), factor * steady_w, rtol=1e-9)


@pytest.mark.parametrize("exposure_s", [0.003, 0.05, 1 / 7, 0.3, 2.0])
def test_flicker_is_averaged_over_the_exposure(bench, exposure_s):
    world, middles = bench(FLICKER), (np.arange(20_000) + 0.5) / 20_000
    mean_w = np.mean([world.power_w(100.02 + exposure_s * middle) for middle in middles])
    assert_allclose(world.measure_w(100.02, exposure_s), mean_w, rtol=1e-8)


def test_an_exposure_of_whole_periods_sees_no_flicker(bench):
    assert_allclose(bench(FLICKER).measure_w(100.02, 2 / 7), bench().power_w(100.0), rtol=1e-12)


@pytest.mark.parametrize(("slot", "share"), [(1, 1.0), (2, 0.5), (3, 0.5), (6, 0.0)])
def test_stray_light_is_unpolarized_and_stopped_by_a_lid(bench, slot, share):
    added_w = bench(STRAY, slot=slot).power_w(100.0) - bench(slot=slot).power_w(100.0)
    assert_allclose(added_w, share * 3e-9, rtol=1e-6, atol=1e-25)


def test_stray_light_is_there_where_the_sample_is_not_lit(bench):
    assert_allclose(bench(STRAY, incidence_deg=95.0).power_w(100.0), 3e-9)


def test_stray_light_does_not_follow_the_lamp(bench):
    drifting = {**DRIFT, "relative_per_hour": -1.0}
    with_stray, without = bench(STRAY, drifting), bench(drifting)
    assert_allclose(with_stray.power_w(36000.0) - without.power_w(36000.0), 3e-9, rtol=1e-6)


def mean_over_source_cone(half_angle_rad, incidence_rad, exit_rad):
    """Mean S0 over directions to the source that fill a cone evenly, by a product rule about its axis."""
    index = 2.950 + 2.932j
    surface = Surface([Specular(0.7, 0.1764, index), Diffuse(0.1, 0.1764), Directional(0.05, 0.1764, index)])
    nodes, weights = np.polynomial.legendre.leggauss(20)
    cos_off = 1 - (1 - math.cos(half_angle_rad)) * (nodes[:, None] + 1) / 2
    turn = 2 * np.pi * np.arange(64) / 64
    sin_off = np.sqrt(1 - cos_off**2)
    along = np.array([math.sin(incidence_rad), 0.0, math.cos(incidence_rad)])
    in_plane, across = np.array([math.cos(incidence_rad), 0.0, -math.sin(incidence_rad)]), np.array([0.0, 1.0, 0.0])
    to_source = (
        cos_off[..., None] * along
        + (sin_off * np.cos(turn))[..., None] * in_plane
        + (sin_off * np.sin(turn))[..., None] * across
    )
    # the detector stands on the mirror side, at an azimuth of pi
    azimuth_rad = np.pi - np.arctan2(to_source[..., 1], to_source[..., 0])
    s0 = surface.stokes(np.arccos(to_source[..., 2]), np.full(azimuth_rad.shape, exit_rad), azimuth_rad)[..., 0]
    return float((weights / 2) @ s0.mean(axis=1))


@pytest.mark.parametrize("exit_deg", [35.0, 50.0, 62.0])
def test_a_source_that_is_not_collimated_lights_from_a_cone(bench, exit_deg):
    mean = mean_over_source_cone(math.radians(3.0), math.radians(50.0), math.radians(exit_deg))
    predicted_w = 1e-3 * 1e-3 * math.cos(math.radians(exit_deg)) * mean
    collimated_w = bench(exit_deg=exit_deg).power_w(100.0)
    seen_w = bench(CONE, exit_deg=exit_deg).power_w(100.0)
    assert_allclose(seen_w - collimated_w, predicted_w - collimated_w, rtol=1e-3)
    assert abs(seen_w / collimated_w - 1) > 1e-3


def test_a_narrow_source_is_a_collimated_one(bench):
    assert_allclose(bench(CONE | {"half_angle_deg": 1e-3}).power_w(100.0), bench().power_w(100.0), rtol=1e-6)


def test_both_cones_together_are_wider_than_either(bench):
    both = {"effect": "acceptance_cone"}, CONE | {"half_angle_deg": math.degrees(math.sqrt(1e-3 / math.pi))}
    # at the top of a lobe the mean falls by half its curvature times the variance; the variances of two cones add
    peak_w, one_w, other_w, both_w = (
        bench(*effects, incidence_deg=0.0, exit_deg=0.0).power_w(100.0) for effects in ((), both[:1], both[1:], both)
    )
    assert peak_w > one_w > both_w
    assert_allclose(peak_w - both_w, (peak_w - one_w) + (peak_w - other_w), rtol=2e-2)


@pytest.mark.parametrize("incidence_deg", [50.0, -50.0])
@pytest.mark.parametrize("slot", [1, 2, 3, 4])
def test_a_polarized_lamp_lights_the_sample_with_its_stokes_vector(bench, incidence_deg, slot):
    """Also from the other side: with the arm, the lamp's own axes turn to there."""
    lamp = {"effect": "polarized_lamp", "s1": 0.3, "s2": 0.6, "s3": -0.5}
    index, exit_deg = 2.950 + 2.932j, math.copysign(35.0, incidence_deg)
    surface = Surface([Specular(0.7, 0.1764, index), Diffuse(0.1, 0.1764), Directional(0.05, 0.1764, index)])
    s0, s1, s2, _ = surface.mueller(math.radians(50.0), math.radians(35.0), math.pi) @ [1.0, 0.3, 0.6, -0.5]
    passed = {1: s0, 2: (s0 + s1) / 2, 3: (s0 + s2) / 2, 4: (s0 - s1) / 2}[slot]
    world = bench(lamp, incidence_deg=incidence_deg, exit_deg=exit_deg, slot=slot)
    assert_allclose(world.power_w(100.0), 1e-3 * 1e-3 * math.cos(math.radians(35.0)) * passed, rtol=1e-9)
