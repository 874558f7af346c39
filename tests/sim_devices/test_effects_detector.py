"""Each effect of the detector changes its reading by the amount predicted on paper."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose

from sim_devices.world import World

PHOTON_J = 6.62607015e-34 * 299792458 / 550e-9


def readings_w(scene, count, exposure_s=0.03):
    world = World(scene)
    return np.array([world.measure_w(100.0, exposure_s) for _ in range(count)])


@pytest.fixture
def clear_w(scene_with):
    return World(scene_with()).power_w(100.0)


@pytest.fixture
def read(scene_with):
    """Readings of a bench at rest with some effects."""

    def read_with(*effects, count=1, exposure_s=0.03, **parts):
        return readings_w(scene_with(effects=effects, **parts), count, exposure_s)

    return read_with


def test_dark_current_adds(read, clear_w):
    dark_w = read({"effect": "dark_current", "power_w": 2e-10})
    assert_allclose(dark_w - clear_w, 2e-10, rtol=1e-6)


@pytest.mark.parametrize("exposure_s", [0.003, 0.3])
def test_shot_noise_is_that_of_counted_photons(read, clear_w, exposure_s):
    noisy_w = read({"effect": "shot_noise"}, count=2000, exposure_s=exposure_s)
    stddev_w = math.sqrt(clear_w * PHOTON_J / exposure_s)
    assert_allclose(noisy_w.std(), stddev_w, rtol=0.06)
    assert_allclose(noisy_w.mean(), clear_w, atol=4 * stddev_w / math.sqrt(2000))


def test_few_photons_are_whole_photons(read, clear_w):
    exposure_s = 3 * PHOTON_J / clear_w
    photons = read({"effect": "shot_noise"}, count=200, exposure_s=exposure_s) * exposure_s / PHOTON_J
    assert_allclose(photons, np.round(photons), atol=1e-9)
    assert 2.5 < np.mean(photons) < 3.5


@pytest.mark.parametrize("exposure_s", [0.003, 0.3])
def test_read_noise_falls_with_the_root_of_the_samples(read, clear_w, exposure_s):
    noisy_w = read({"effect": "read_noise", "power_w": 2e-9}, count=2000, exposure_s=exposure_s)
    stddev_w = 2e-9 * math.sqrt(0.003 / exposure_s)
    assert_allclose(noisy_w.std(), stddev_w, rtol=0.06)
    assert_allclose(noisy_w.mean(), clear_w, atol=4 * stddev_w / math.sqrt(2000))


def test_quantisation_keeps_its_digits(read, clear_w):
    (rounded_w,) = read({"effect": "quantisation", "digits": 4})
    assert rounded_w == float(f"{clear_w:.3e}")
    assert rounded_w != clear_w


def test_a_nonlinear_detector_misses_the_stated_share_at_the_stated_power(read, clear_w):
    at_power = {"effect": "nonlinearity", "relative_loss": 0.02, "at_power_w": clear_w}
    assert_allclose(read(at_power), 0.98 * clear_w, rtol=1e-12)


@pytest.mark.parametrize("times", [0.01, 0.5, 3.0])
def test_a_nonlinear_detector_misses_more_of_more_light(read, clear_w, times):
    # signal / reading = 1 + x, with x in proportion to the signal and 1 / (1 + x) = 0.9 at the stated power
    steep = {"effect": "nonlinearity", "relative_loss": 0.1, "at_power_w": clear_w / times}
    assert_allclose(clear_w / read(steep) - 1, times * (1 / 0.9 - 1), rtol=1e-9)


def test_a_nonlinear_detector_compresses_the_dark_signal_with_the_light(read, clear_w):
    dark = {"effect": "dark_current", "power_w": clear_w}
    steep = {"effect": "nonlinearity", "relative_loss": 0.1, "at_power_w": 2 * clear_w}
    assert_allclose(read(steep, dark), 0.9 * 2 * clear_w, rtol=1e-12)


def test_a_saturated_detector_is_over_its_range(read, clear_w):
    assert read({"effect": "saturation", "power_w": 1.001 * clear_w}) == clear_w
    assert read({"effect": "saturation", "power_w": 0.999 * clear_w}) == math.inf


def test_saturation_is_of_all_that_the_detector_adds_and_outlives_rounding(read, clear_w):
    limit = {"effect": "saturation", "power_w": 1.5 * clear_w}
    digits = {"effect": "quantisation", "digits": 3}
    assert read(digits, limit) < math.inf
    assert read(digits, limit, {"effect": "dark_current", "power_w": clear_w}) == math.inf
