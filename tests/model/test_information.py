"""Fisher's information: derivatives against differences, and against what a fit reports."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from model.design.information import information, prior_information, standard_errors
from model.fit import Dataset, fit, lobe_family
from model.fit.observable import Ratios
from model.geometry import in_plane

TRUTH = {"sigma": 0.2, "n": 1.6, "rho_s": 0.7, "rho_d": 0.1, "rho_dd": 0.05}
EXIT_RAD, AZIMUTH_RAD = in_plane(np.radians(np.arange(-20.0, 71.0, 5.0)))
DIRECTIONS = (np.full(len(EXIT_RAD), np.radians(60.0)), EXIT_RAD, AZIMUTH_RAD)


def family(**changes):
    choice = {"free": {"sigma": (0.02, 1.0), "n": (1.1, 4.0)}, "fixed": {"k": 0.0}, **changes}
    return lobe_family(["specular", "diffuse", "directional"], **choice)


def covariance(seed=0, width=3):
    """Correlated errors, different in every direction."""
    roots = np.random.default_rng(seed).normal(size=(len(EXIT_RAD), width, width)) + 2.0 * np.eye(width)
    return 1e-8 * roots @ np.swapaxes(roots, 1, 2)


def test_it_is_made_of_derivatives_and_inverse_covariances():
    told = information(family(), DIRECTIONS, covariance(), TRUTH)
    step, slopes = 1e-6, []
    for name in family().names:
        up, down = (
            family().surface_of({**TRUTH, name: TRUTH[name] + side * step}).stokes(*DIRECTIONS)[:, :3]
            for side in (1.0, -1.0)
        )
        slopes.append((up - down) / (2.0 * step))
    expected = np.einsum("pnm,nml,qnl->npq", slopes, np.linalg.inv(covariance()), slopes)
    assert_allclose(told, expected, rtol=1e-5, atol=1e-7 * np.abs(expected).max())


def test_its_inverse_is_the_covariance_that_a_fit_reports():
    values = family().surface_of(TRUTH).stokes(*DIRECTIONS)[:, :3]
    result = fit(Dataset(*DIRECTIONS, values=values, covariance=covariance()), family())
    told = information(family(), DIRECTIONS, covariance(), TRUTH).sum(axis=0)
    assert result.names == family().names
    assert_allclose(np.linalg.inv(told), result.covariance, rtol=1e-4)
    assert_allclose(standard_errors(told), np.sqrt(np.diag(result.covariance)), rtol=1e-4)


def test_a_prior_tells_what_a_reading_of_the_parameter_itself_would():
    with_prior = family(prior={"n": (1.6, 0.01)})
    told = prior_information(with_prior)
    assert_allclose(told[1, 1], 1e4)
    assert np.count_nonzero(told) == 1
    assert_allclose(
        information(with_prior, DIRECTIONS, covariance(), TRUTH), information(family(), DIRECTIONS, covariance(), TRUTH)
    )


def test_ratios_leave_the_weights_open_and_nothing_else():
    told = information(family(), DIRECTIONS, covariance(width=2), TRUTH, Ratios()).sum(axis=0)
    stderr = dict(zip(family().names, standard_errors(told), strict=True))
    assert {name for name, error in stderr.items() if np.isinf(error)} == {"rho_s", "rho_d", "rho_dd"}
    unit = family(fixed={"k": 0.0, "rho_s": TRUTH["rho_s"]})
    known = standard_errors(information(unit, DIRECTIONS, covariance(width=2), TRUTH, Ratios()).sum(axis=0))
    assert_allclose([stderr["sigma"], stderr["n"]], known[:2], rtol=1e-6)


def test_the_gain_and_the_weights_cannot_be_told_apart():
    with_gain = family(free={"sigma": (0.02, 1.0), "n": (1.1, 4.0), "gain": (0.5, 2.0)})
    told = information(with_gain, DIRECTIONS, covariance(), {**TRUTH, "gain": 1.0}).sum(axis=0)
    is_open = np.isinf(standard_errors(told))
    assert [name for name, flag in zip(with_gain.names, is_open, strict=True) if flag] == [
        "rho_s",
        "rho_d",
        "rho_dd",
        "gain",
    ]


@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
def test_units_do_not_decide_what_is_open(unit):
    scale = np.array([unit, 1.0, 1.0])
    told = np.array([[4.0, 0.0, 0.0], [0.0, 1.0, 1.0], [0.0, 1.0, 1.0]]) / np.outer(scale, scale)
    assert_allclose(standard_errors(told), [0.5 * unit, np.inf, np.inf])
    assert_allclose(standard_errors(np.zeros((2, 2))), [np.inf, np.inf])
