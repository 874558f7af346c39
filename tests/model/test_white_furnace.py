"""Perfect mirrors reflect all light: integrated over all directions the bounces add up to 1, each to what rays do."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_less
from numpy.typing import NDArray

from model.bounce_bound import bounces_for
from model.raytrace import LitSurface, bounce_fractions
from model.vgroove import bounce_stokes

PERFECT = 1.0 + 1e8j  # reflects all but 4e-16


def shares(incidence_rad: float, sigma: float, a: float, panels: int, azimuths: int) -> NDArray[np.float64]:
    """Shares of the light that leave after 1, 2, … bounces, integrated in coordinates in which nothing is steep.

    With (rho, psi) the horizontal part of i + r in polar coordinates about the mirror direction, dω cos tr is
    rho d rho d psi, which takes the caustic away. The horizon is at rho = cos ti exp(w), sinh w = tan ti cos psi: even
    steps of w's own angle follow it at grazing incidence. rho grows as sinh from the width of the lobe, in steps that
    shorten towards the square root of cos tr at the horizon.
    """
    widest = max(np.arcsinh(np.tan(incidence_rad)), 1e-9)
    turn = (np.arange(azimuths)[:, None] + 0.5) / azimuths * np.pi
    w = widest * np.cos(turn)
    psi = np.arccos(np.sinh(w) / np.sinh(widest))
    d_psi = np.cosh(w) / np.sinh(widest) * widest * np.sin(turn) / np.sin(psi) * np.pi / azimuths

    node, weight = np.polynomial.legendre.leggauss(6)
    v = ((np.arange(panels)[:, None] + (node + 1.0) / 2.0) / panels).ravel()
    narrow = sigma * np.cos(incidence_rad)
    growth = np.arcsinh(np.cos(incidence_rad) * np.exp(w) / narrow)
    rho = narrow * np.sinh(growth * v * (2.0 - v))
    d_rho = np.hypot(narrow, rho) * growth * 2.0 * (1.0 - v) * np.tile(weight / (2.0 * panels), panels)

    x, y = rho * np.cos(psi) - np.sin(incidence_rad), rho * np.sin(psi)
    at = incidence_rad, np.arcsin(np.minimum(np.hypot(x, y), 1.0)), np.arctan2(y, x)
    area = 2.0 * rho * d_rho * d_psi  # on both sides of the plane of incidence
    return np.array(
        [
            (bounce_stokes(k, *at, sigma=sigma, asymmetry=a, index=PERFECT)[..., 0] * area).sum()
            for k in range(1, bounces_for(1e-8, sigma, a) + 1)
        ]
    )


@pytest.mark.parametrize(
    ("incidence_deg", "sigma", "a"),
    [
        (0.0, 0.3, 0.0),
        (30.0, 0.3, 0.5),
        (60.0, 1.0, 0.0),
        (60.0, 0.5, 0.9),
        (20.0, 1.0, 0.4),
        (75.0, 0.3, 0.2),
        (86.0, 0.05, 0.4),
        (86.0, 0.5, 0.0),
        (89.0, 1.0, 0.2),
    ],
)
def test_white_furnace(incidence_deg: float, sigma: float, a: float) -> None:
    assert_allclose(shares(np.radians(incidence_deg), sigma, a, 120, 200).sum(), 1.0, rtol=0.0, atol=1e-6)


@pytest.mark.long
@pytest.mark.parametrize("a", [0.0, 0.2, 0.5, 0.8, 0.9])
@pytest.mark.parametrize("sigma", [0.05, 0.1, 0.2, 0.5, 1.0, 2.0])
def test_white_furnace_at_every_incidence(sigma: float, a: float) -> None:
    incidences = np.radians([0.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0, 80.0, 86.0, 89.0])
    totals = [shares(incidence_rad, sigma, a, 300, 480).sum() for incidence_rad in incidences]
    assert_allclose(totals, 1.0, rtol=0.0, atol=1e-6)


def assert_rays_agree(setting: int, rays: int) -> None:
    """Within four standard errors, wherever more than 30 rays are expected."""
    random = np.random.default_rng([2024, setting])
    lit = LitSurface(random.uniform(0.0, np.radians(88.0)), 10.0 ** random.uniform(-1.2, 0.3), random.uniform(0.0, 0.9))
    expected = shares(lit.incidence_rad, lit.sigma, lit.asymmetry, 60, 100)
    counted = np.zeros_like(expected)
    sample = bounce_fractions(lit, rays=rays, seed=setting).mean
    assert not sample[counted.size :].any()
    counted[: sample.size] = sample[: counted.size]
    frequent = expected * rays > 30.0
    assert frequent[0]
    error = np.sqrt(expected * np.maximum(1.0 - expected, 1.0 / rays) / rays) + 1e-5
    assert_array_less(np.abs(counted - expected)[frequent], 4.0 * error[frequent], err_msg=str(lit))


@pytest.mark.parametrize("setting", range(4))
def test_every_bounce_takes_the_light_that_rays_take(setting: int) -> None:
    assert_rays_agree(setting, 50_000)


@pytest.mark.long
@pytest.mark.parametrize("setting", range(4, 104))
def test_every_bounce_takes_the_light_that_rays_take_at_a_hundred_settings(setting: int) -> None:
    assert_rays_agree(setting, 400_000)
