"""The noise of a camera's region, by simulating its pixels."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from acquisition.imaging.light.camera_noise import camera_noise
from acquisition.imaging.stokes.pixel_formula import SensorNoise

WATTS = 3e-13


@pytest.mark.parametrize("exposure_s", [0.02, 0.5])
@pytest.mark.parametrize("light_counts", [0.0, 30.0, 2000.0])
@pytest.mark.parametrize(("read_counts", "electrons_per_count", "pixels"), [(3.0, 2.5, 24), (12.0, 0.4, 6)])
def test_variance_is_that_of_simulated_pixels(exposure_s, light_counts, read_counts, electrons_per_count, pixels):
    generator = np.random.default_rng(11)
    readings = 20_000
    electrons = generator.poisson(light_counts * electrons_per_count, (readings, pixels))
    counts = electrons / electrons_per_count + generator.normal(0.0, read_counts, (readings, pixels))
    powers_w = counts.mean(axis=1) / exposure_s * WATTS
    noise = camera_noise(SensorNoise(read_counts, electrons_per_count), WATTS, pixels, 550.0)
    power_w = np.array([light_counts / exposure_s * WATTS])
    stated = noise.variance(power_w, np.array([exposure_s]))
    np.testing.assert_allclose(stated, powers_w.var(), rtol=5 * np.sqrt(2 / readings))


def test_below_zero_there_are_no_photons_and_the_wavelength_does_not_matter():
    noise = camera_noise(SensorNoise(2.0, 5.0), WATTS, 10, 550.0)
    dark = noise.variance(np.array([-1e-9, 0.0]), np.array([0.1, 0.1]))
    np.testing.assert_allclose(dark, WATTS**2 * 4.0 / (0.01 * 10), rtol=1e-12)
    bright = np.array([1e-9]), np.array([0.1])
    np.testing.assert_array_equal(replace(noise, wavelength_nm=700.0).variance(*bright), noise.variance(*bright))
