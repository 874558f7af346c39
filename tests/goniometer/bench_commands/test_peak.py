"""The centre of a peak: right within its own error, for any symmetric shape, and refused where it means nothing."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from goniometer.bench_commands.peak import fit_peak
from goniometer.errors import FitError

CENTRE, WIDTH = 29.3127, 0.8
SHAPES = {
    "gaussian": lambda u: np.exp(-0.5 * u**2),
    "lorentzian": lambda u: 1 / (1 + u**2),
    "flat, with edges": lambda u: 1 / (1 + np.exp(6 * (np.abs(u) - 1.5))),
    "cusp": lambda u: np.exp(-np.abs(u)),
}


def scan(shape, *, noise=0.0, step=0.1, start=26.0, end=33.0, seed=0):
    angle_deg = np.arange(start, end, step)
    power = 1e-7 + 1e-5 * shape((angle_deg - CENTRE) / WIDTH)
    return angle_deg, power + 1e-5 * noise * np.random.default_rng(seed).standard_normal(angle_deg.size)


def fitted(angle_deg, power_w, noise=1e-3):
    return fit_peak(angle_deg, power_w, np.full(angle_deg.size, 1e-5 * noise))


@pytest.mark.parametrize("shape", SHAPES)
def test_a_symmetric_peak_of_any_shape_has_its_centre_found(shape):
    peak = fitted(*scan(SHAPES[shape], noise=1e-3), 1e-3)
    assert abs(peak.centre_deg - CENTRE) < 4 * peak.uncertainty_deg
    assert peak.uncertainty_deg < 0.02


def test_the_standard_error_is_the_scatter_of_the_centre():
    peaks = [fitted(*scan(SHAPES["gaussian"], noise=0.02, seed=seed), 0.02) for seed in range(150)]
    centres = np.array([peak.centre_deg for peak in peaks])
    assert_allclose(np.std(centres), np.mean([peak.stderr_deg for peak in peaks]), rtol=0.2)
    # of a Gaussian with noise s at points d apart: s sqrt(2 d w / sqrt(pi)) (Cramér and Rao)
    assert_allclose(np.std(centres), 0.02 * np.sqrt(2 * 0.1 * WIDTH / np.sqrt(np.pi)), rtol=0.2)
    assert_allclose(np.mean(centres), CENTRE, atol=4 * np.std(centres) / np.sqrt(len(peaks)))


def test_the_error_comes_from_the_residuals_not_from_what_the_noise_was_said_to_be():
    angle_deg, power_w = scan(SHAPES["gaussian"], noise=0.02)
    assert_allclose(fitted(angle_deg, power_w, 0.002).stderr_deg, fitted(angle_deg, power_w, 0.2).stderr_deg, rtol=1e-3)


def test_height_width_and_background_are_those_of_the_peak():
    peak = fitted(*scan(SHAPES["gaussian"]))
    assert_allclose(peak.fwhm_deg, 2.354820045 * WIDTH, rtol=1e-4)
    assert_allclose([peak.height_w, peak.background_w], [1e-5, 1e-7], rtol=1e-2)


@pytest.mark.parametrize("place", [28, 30, 41, 60])
def test_single_outliers_are_left_out_and_named(place):
    angle_deg, power_w = scan(SHAPES["gaussian"], noise=0.005)
    power_w[place] += 5e-6
    peak = fitted(angle_deg, power_w, 0.005)
    assert_allclose(peak.left_out, [angle_deg[place]])
    assert abs(peak.centre_deg - CENTRE) < 4 * peak.stderr_deg


@pytest.mark.parametrize(("start", "end"), [(29.0, 33.0), (26.0, 29.8), (30.0, 33.0), (24.0, 28.0)])
def test_a_peak_at_the_edge_is_refused(start, end):
    with pytest.raises(FitError, match=r"at the edge of the scan|is flat"):
        fitted(*scan(SHAPES["gaussian"], noise=0.001, start=start, end=end, step=0.05), 0.001)


@pytest.mark.parametrize("seed", range(20))
def test_noise_is_no_peak(seed):
    angle_deg = np.linspace(0, 10, 41)
    power_w = 1e-9 + 1e-11 * np.random.default_rng(seed).standard_normal(41)
    with pytest.raises(FitError, match=r"is flat|edge|coarse|symmetric"):
        fit_peak(angle_deg, power_w, np.full(41, 1e-11))


def test_darkness_is_no_peak():
    with pytest.raises(FitError, match="The scan is flat: every point has the same power"):
        fit_peak(np.linspace(0, 10, 41), np.zeros(41), np.zeros(41))


def test_a_saturated_peak_is_refused():
    angle_deg, power_w = scan(SHAPES["gaussian"], noise=0.001)
    with pytest.raises(FitError, match=r"saturated: 1\d points from 28\.\d to 30"):
        fitted(angle_deg, np.minimum(power_w, 7e-6))


def test_a_coarse_scan_is_refused_with_a_step_that_would_do():
    with pytest.raises(FitError, match=r"too coarse: 2 of its points .* --step of 0\.1[89] or less"):
        fitted(*scan(SHAPES["gaussian"], noise=1e-3, step=0.9, start=20, end=40))


@pytest.mark.parametrize("skew", [-0.35, 0.35])
def test_a_skewed_peak_is_refused(skew):
    def skewed(u):
        return np.exp(-0.5 * (u / (1 + skew * np.tanh(2 * u))) ** 2)

    with pytest.raises(FitError, match=r"not symmetric.*put a mirror"):
        fitted(*scan(skewed, noise=0.001))
