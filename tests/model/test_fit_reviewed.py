"""Faults that were found once, each with numbers that looked fine."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from goniometer.errors import FitError
from model.fit import Dataset, fit, lobe_family
from model.fit.bootstrap import bootstrap
from model.fit.profile import profile
from model.geometry import in_plane

TRUTH = {"sigma": 0.2, "n": 2.9, "k": 3.0, "rho_s": 0.7, "rho_d": 0.1}
FREE = {"sigma": (0.02, 1.0), "n": (1.0, 6.0), "k": (0.0, 8.0)}
LOBES = ("specular", "diffuse")
FAMILY = lobe_family(LOBES, FREE)


def scan(truth: dict[str, float], seed: int, scale: float = 1.0, relative: float = 5e-3) -> Dataset:
    exit_rad, azimuth_rad = in_plane(np.radians(np.arange(-60.0, 81.0, 4.0)))
    at = np.full(len(exit_rad), np.radians(60.0)), exit_rad, azimuth_rad
    stokes = FAMILY.seen(truth).stokes(*at)[:, :3]
    stddev = np.hypot(1e-4, relative * stokes[:, :1]) * np.ones(3)
    noisy = stokes + stddev * np.random.default_rng(seed).standard_normal(stokes.shape)
    return Dataset(*at, scale * noisy, scale**2 * stddev[:, :, None] ** 2 * np.eye(3))


def test_a_prior_needs_data_with_errors() -> None:
    known = lobe_family(LOBES, FREE, prior={"n": (1.8, 0.05)})
    with pytest.raises(FitError, match="cannot be weighed"):
        fit(replace(scan(TRUTH, 1), covariance=None), known)
    with pytest.raises(FitError, match="cannot be weighed"):
        fit(scan(TRUTH, 1), known, objective="rms")


def test_a_profile_of_ratios_holds_what_the_fit_held() -> None:
    data = scan(TRUTH, 1)
    result = fit(data, FAMILY, objective="normalised")
    estimate = result.parameters["rho_d"]
    low, high = profile(data, FAMILY, result, "rho_d", objective="normalised").interval()
    assert_allclose([low, high], estimate.value + np.array([-1.96, 1.96]) * estimate.stderr, atol=1.0 * estimate.stderr)


def test_the_bootstrap_of_what_a_prior_knows_scatters_as_the_prior() -> None:
    known = lobe_family(LOBES, FREE, prior={"n": (2.9, 0.02)})
    data = scan(TRUTH, 1, relative=0.1)
    result = fit(data, known)
    assert_allclose(bootstrap(data, known, result, count=400).stderr["n"], result.parameters["n"].stderr, rtol=0.15)


def test_the_bootstrap_leaves_the_bound_where_k_has_no_slope() -> None:
    data = scan(TRUTH | {"n": 1.5, "k": 0.0}, 0, relative=0.02)
    result = fit(data, FAMILY)
    found = bootstrap(data, FAMILY, result, count=200)
    assert (found.samples[:, found.names.index("k")] > 0.01).mean() > 0.2


@pytest.mark.parametrize("width", [1.0, 1e3, 1e6])
def test_a_wide_box_has_no_wide_border(width: float) -> None:
    wide = lobe_family(LOBES, FREE | {"rho_s": (0.0, width), "rho_d": (0.0, width)})
    found, unbounded = fit(scan(TRUTH, 1, 1e-3), wide), fit(scan(TRUTH, 1, 1e-3), FAMILY)
    for name, estimate in unbounded.parameters.items():
        assert not found.parameters[name].at_bound
        assert_allclose(found.parameters[name].stderr, estimate.stderr, rtol=1e-3)


@pytest.mark.parametrize("scale", [1e-3, 1e3])
def test_units_do_not_matter_where_the_scatter_tells_the_errors(scale: float) -> None:
    data = replace(scan(TRUTH | {"n": 1.5, "k": 0.0}, 3), covariance=None)
    one, other = fit(data, FAMILY), fit(replace(data, values=scale * data.values), FAMILY)
    assert one.degrees_of_freedom == other.degrees_of_freedom
    for name, estimate in one.parameters.items():
        factor = scale if name.startswith("rho_") else 1.0
        assert other.parameters[name].at_bound == estimate.at_bound
        if estimate.stderr:
            assert_allclose(other.parameters[name].stderr, factor * estimate.stderr, rtol=1e-3)


def test_the_profile_of_the_only_parameter_is_its_parabola() -> None:
    family = lobe_family(LOBES, {"n": (1.0, 6.0)}, {"sigma": 0.2, "k": 3.0, "rho_s": 0.7, "rho_d": 0.1})
    data = scan(TRUTH, 1)
    result = fit(data, family)
    estimate = result.parameters["n"]
    interval = profile(data, family, result, "n").interval(0.6827)
    assert_allclose(interval, estimate.value + np.array([-1.0, 1.0]) * estimate.stderr, atol=0.1 * estimate.stderr)


def test_an_arm_off_its_zero_is_found_whatever_the_seed() -> None:
    family = lobe_family(LOBES, FREE | {"exit_offset_rad": (-0.02, 0.02)})
    data = scan(TRUTH, 7, relative=0.02).some(np.arange(1, 36))
    chi_squares = [fit(data, family, seed=seed).chi_square for seed in range(6)]
    assert_allclose(chi_squares, min(chi_squares), atol=0.05)
