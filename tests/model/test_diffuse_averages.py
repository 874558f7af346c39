"""C1 and C2 of eq. (8): averages over Beckmann slopes with m = sigma, and the power laws that were fitted to them."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import quad

from model.lobes import Diffuse
from model.lobes.diffuse import exact_averages, printed_averages
from model.surface import Surface

SIGMAS = [1e-8, 1e-3, 0.03, 0.0999, 0.1, 0.1001, 0.25, 0.5, 1.0, 3.0, 30.0]


def average(weight: float, cosine_power: int, m: float, by_m: bool = False) -> float:
    """⟨(m² s)^weight (1 + m² s)^(-cosine_power/2)⟩ over s = tan²/m², with density exp(-s); or its derivative by m."""

    def integrand(s: float) -> float:
        slope2 = m * m * s
        value = slope2**weight * (1.0 + slope2) ** (-cosine_power / 2.0)
        if by_m:
            value *= 2.0 / m * (weight - cosine_power / 2.0 * slope2 / (1.0 + slope2))
        return float(value * np.exp(-s))

    edges = [0.0, 1e-4, 1e-2, 0.3, 3.0, 12.0, 45.0]
    return sum(quad(integrand, low, high, epsabs=0.0, epsrel=1e-13)[0] for low, high in pairwise(edges))


def test_at_half_they_are_the_known_numbers() -> None:
    (c1, c2), _ = exact_averages(0.5)
    assert_allclose([c1, c2], [0.905354, 0.103908], rtol=0.0, atol=5e-7)


@pytest.mark.parametrize("sigma", SIGMAS)
def test_they_are_the_mean_cosine_and_half_the_mean_of_tan_times_sin(sigma: float) -> None:
    (c1, c2), _ = exact_averages(sigma)
    assert_allclose(c1, average(0, 1, sigma), rtol=1e-12)
    assert_allclose(c2, average(1, 1, sigma) / 2.0, rtol=1e-11)


@pytest.mark.parametrize("sigma", SIGMAS[1:])
def test_their_derivatives_are_those_of_the_integrals(sigma: float) -> None:
    _, (d_c1, d_c2) = exact_averages(sigma)
    assert_allclose(d_c1, average(0, 1, sigma, by_m=True), rtol=1e-10)
    assert_allclose(d_c2, average(1, 1, sigma, by_m=True) / 2.0, rtol=1e-10)


def test_series_and_function_meet_smoothly() -> None:
    # On both sides of 0.1: the second difference of what is smooth on the scale of 1 is that of its curvature alone.
    step = 1e-7
    (below, at, above) = (exact_averages(0.1 + side * step) for side in (-1, 0, 1))
    for values in (0, 1):
        low, middle, high = (np.array(result[values]) for result in (below, at, above))
        assert_allclose(low + high - 2.0 * middle, 0.0, atol=1e-12)
    assert_allclose(np.subtract(above[0], below[0]), 2.0 * step * np.array(at[1]), rtol=0.0, atol=1e-14)


@pytest.mark.parametrize("sigma", [0.1, 0.2, 0.3, 0.4, 0.5])
def test_the_printed_power_laws_approximate_them(sigma: float) -> None:
    exact, printed = np.array(exact_averages(sigma)[0]), np.array(printed_averages(sigma)[0])
    assert_allclose(printed, exact, rtol=0.0, atol=0.07)
    slopes = printed_averages(sigma)[1]
    high, low = (np.array(printed_averages(sigma + side * 1e-5)[0]) for side in (1.0, -1.0))
    assert_allclose((high - low) / 2e-5, slopes, rtol=1e-7)


def test_a_smooth_surface_is_lambertian() -> None:
    light = Surface([Diffuse(0.3, 1e-4, "exact")]).stokes(0.2, [0.0, 0.4, 0.7], 1.0)
    assert_allclose(light[:, 0], 0.3 / np.pi, rtol=1e-7)
    assert not light[:, 1:].any()


@pytest.mark.parametrize("averages", ["printed", "exact"])
def test_the_lobe_takes_them(averages: str) -> None:
    # At the normal the lobe is rho_d/pi C1; with ti = tr, phi = 90 degrees it is G C1; the rest is C2.
    sigma, ti = 0.4, 0.3
    (c1, c2), _ = exact_averages(sigma) if averages == "exact" else printed_averages(sigma)
    surface = Surface([Diffuse(1.0, sigma, averages)])  # type: ignore[arg-type]
    assert_allclose(surface.stokes(0.0, 0.0, 0.0)[0], c1 / np.pi, rtol=1e-14)
    across, towards_source = surface.stokes(ti, ti, [np.pi / 2.0, 0.0])[:, 0]
    assert_allclose(across, c1 / np.pi, rtol=1e-13)
    assert_allclose(towards_source - across, c2 * np.tan(ti) ** 2 / np.pi, rtol=1e-11)
    text = surface.describe()
    assert ("averaged exactly" in text) == (averages == "exact")
