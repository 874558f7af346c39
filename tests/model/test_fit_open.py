"""Parameters without a standard error: at a bound, beside it, less known than by their bounds, or known to nobody."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from goniometer.errors import FitError
from model.fit import Dataset, FitResult, fit, lobe_family
from model.fit.observable import Elements
from model.fit.profile import profile
from model.geometry import in_plane

LOBES = ("specular", "diffuse")
FREE = {"sigma": (0.02, 1.0), "n": (1.0, 6.0), "k": (0.0, 8.0)}
FAMILY = lobe_family(LOBES, FREE)
METAL = {"sigma": 0.2, "n": 2.9, "k": 3.0, "rho_s": 0.7, "rho_d": 0.1}
GLASS = METAL | {"n": 1.5, "k": 0.0}
SHAPES = {"sigma": 0.2, "n": 2.9, "k": 3.0}


def scan(truth: dict[str, float], seed: int, relative: float) -> Dataset:
    exit_rad, azimuth_rad = in_plane(np.radians(np.arange(-60.0, 81.0, 4.0)))
    at = np.full(len(exit_rad), np.radians(60.0)), exit_rad, azimuth_rad
    stokes = FAMILY.seen(truth).stokes(*at)[:, :3]
    stderr = np.hypot(1e-4, relative * stokes[:, :1]) * np.ones(3)
    noisy = stokes + stderr * np.random.default_rng(seed).standard_normal(stokes.shape)
    return Dataset(*at, noisy, stderr[:, :, None] ** 2 * np.eye(3))


def undetermined(result: FitResult) -> list[str]:
    return [name for name, known in result.parameters.items() if known.stderr is None and not known.at_bound]


@pytest.mark.parametrize("seed", [0, 1, 2, 3, 4, 6, 7, 8])
def test_no_error_is_wider_than_the_bounds_are_apart(seed: int) -> None:
    result = fit(scan(METAL, seed, 2.0), FAMILY)
    for name, estimate in result.parameters.items():
        low, high = FREE.get(name, (0.0, 100.0 * sum(result.values[weight] for weight in ("rho_s", "rho_d"))))
        assert low <= estimate.value <= high
        assert estimate.stderr is None or 0.0 < estimate.stderr <= high - low
        assert (name in result.names) == (estimate.stderr is not None)
        assert not (estimate.at_bound and estimate.stderr is not None)
    assert np.isfinite(result.correlation).all()
    json = result.to_dict()
    assert json["parameters"].keys() == result.parameters.keys()


def test_what_the_data_know_less_of_than_the_bounds_has_no_error_and_the_others_allow_for_it() -> None:
    data = scan(METAL, 0, 2.0)
    result = fit(data, FAMILY)
    assert undetermined(result) == ["n"]
    sure = fit(data, FAMILY.holding("n", result.values["n"]), start={"sigma": 0.3, "k": 1.0})
    assert result.parameters["rho_s"].stderr > 1.5 * sure.parameters["rho_s"].stderr
    assert result.degrees_of_freedom == sure.degrees_of_freedom - 1


def test_a_lobe_that_hardly_shines_where_it_was_measured_has_an_unknown_weight() -> None:
    # Beyond 8 slopes off the mirror direction the specular lobe of a smooth surface gives next to no light.
    family = lobe_family(LOBES, {}, {"sigma": 0.1, "n": 1.5, "k": 0.0})
    truth = {"rho_s": 0.7, "rho_d": 0.1}
    exit_rad, azimuth_rad = in_plane(np.radians(np.arange(-45.0, -24.0)))
    at = np.full(len(exit_rad), np.radians(60.0)), exit_rad, azimuth_rad
    stokes = family.seen(truth).stokes(*at)[:, :3]
    noise = 1e-3 * np.random.default_rng(3).standard_normal(stokes.shape)
    result = fit(Dataset(*at, stokes + noise, np.broadcast_to(1e-6 * np.eye(3), (21, 3, 3))), family)
    assert result.parameters["rho_s"].stderr is None
    assert_allclose(result.values["rho_d"], 0.1, atol=4.0 * result.parameters["rho_d"].stderr)


@pytest.mark.parametrize("seed", [0, 2, 3, 4, 5])
def test_k_that_ends_close_to_zero_is_zero(seed: int) -> None:
    data = scan(GLASS, seed, 5e-3)
    result, without = fit(data, FAMILY), fit(data, FAMILY.holding("k", 0.0))
    assert result.values["k"] == 0.0
    assert result.parameters["k"].at_bound
    assert_allclose(result.chi_square, without.chi_square, rtol=1e-9)
    assert_allclose(result.fitted, without.fitted, rtol=1e-6)
    assert_allclose(result.parameters["n"].stderr, without.parameters["n"].stderr, rtol=1e-5)


def test_k_that_the_data_want_above_zero_stays_there() -> None:
    data = scan(GLASS, 1, 5e-3)
    result, without = fit(data, FAMILY), fit(data, FAMILY.holding("k", 0.0))
    assert result.parameters["k"].stderr is not None
    assert result.chi_square < without.chi_square - 0.1


def test_values_without_errors_that_a_fit_goes_through_leave_every_error_unknown() -> None:
    data = scan(METAL, 1, 5e-3)
    one = Dataset(*(angle[25:26] for angle in data.directions), data.values[25:26, :2], None, Elements((0, 1)))
    result = fit(one, lobe_family(LOBES, {}, SHAPES))
    assert result.degrees_of_freedom == 0
    assert undetermined(result) == ["rho_s", "rho_d"]
    assert result.names == ()
    assert result.covariance.shape == (0, 0)
    assert result.p_value is None
    assert_allclose(result.fitted, one.values, rtol=1e-9)
    known = fit(replace(one, covariance=1e-8 * np.eye(2)[None]), lobe_family(LOBES, {}, SHAPES))
    assert known.names == ("rho_s", "rho_d")


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_whether_a_covariance_is_possible_depends_on_no_unit(scale: float) -> None:
    data = scan(METAL, 1, 5e-3)
    units = np.array([scale, 1.0, 1.0])
    covariance = data.covariance * np.outer(units, units)
    assert len(replace(data, covariance=covariance)) == len(data)
    # Of two columns that err alike the difference has no error, whatever rounding makes of it.
    stderr = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    alike = stderr[:, :, None] * stderr[:, None, :] * np.array([[1, 0, 0], [0, 1, 1 - 1e-15], [0, 1 - 1e-15, 1]])
    with pytest.raises(FitError, match=r"Row 0 .* not positive definite"):
        replace(data, covariance=alike)


@pytest.mark.parametrize("factor", [1e-3, 1.0, 1e3])
def test_the_profile_of_a_weight_at_its_bound_counts_in_the_weights_own_unit(factor: float) -> None:
    data = scan(METAL | {"rho_d": 0.0}, 2, 5e-3)
    data = replace(data, values=factor * data.values, covariance=factor**2 * data.covariance)
    result = fit(data, FAMILY)
    assert result.parameters["rho_d"].at_bound
    found = profile(data, FAMILY, result, "rho_d")
    assert found.values[0] == 0.0
    low, high = found.interval()
    assert low == 0.0
    assert_allclose(high, 2e-4 * factor, rtol=0.9)
    assert 4 <= len(found.values) <= 30


def test_the_profile_of_k_leaves_zero_where_nothing_has_a_slope() -> None:
    data = scan(GLASS, 0, 5e-3)
    found = profile(data, FAMILY, fit(data, FAMILY), "k")
    low, high = found.interval()
    assert low == 0.0
    assert 0.02 < high < 0.5
    assert len(found.values) <= 30
    inside = found.excess[(found.values > 0.0) & (found.values < high)]
    assert len(inside) >= 3
