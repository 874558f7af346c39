"""The printed reading of eq. (6): one facet, one Fresnel matrix, masking summed over bounces."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from numpy.testing import assert_allclose
from numpy.typing import NDArray

from model.lobes import Specular
from model.surface import Surface

SIGMA, IRON = 0.6, 2.95 + 2.932j
PERFECT = 1.0 + 1e8j
RANDOM = np.random.default_rng(17)
AT = RANDOM.uniform(0.0, 1.54, 4000), RANDOM.uniform(0.0, 1.54, 4000), RANDOM.uniform(-3.1, 3.1, 4000)


def surface(bounces: int, index: complex = IRON, sigma: float = SIGMA) -> Surface:
    return Surface([Specular(1.0, sigma, index, bounces=bounces, reading="single-fresnel")])


def masking(bounces: int) -> NDArray:
    """G of a perfect mirror, the lobe over D/(4 cos ti cos tr) with D from vectors."""
    ti, tr, phi = AT
    h_x, h_y = np.sin(ti) + np.sin(tr) * np.cos(phi), np.sin(tr) * np.sin(phi)
    h_z = np.cos(ti) + np.cos(tr)
    slope2, cos4 = (h_x**2 + h_y**2) / h_z**2, (h_z**2 / (h_x**2 + h_y**2 + h_z**2)) ** 2
    density = np.exp(-slope2 / (2.0 * SIGMA**2)) / (2.0 * np.pi * SIGMA**2 * cos4)
    light = surface(bounces, PERFECT).stokes(*AT)[:, 0]
    lit = density > 1e-200
    assert lit.mean() > 0.8
    return np.where(lit, light / np.where(lit, density / (4.0 * np.cos(ti) * np.cos(tr)), 1.0), np.nan)


def incoming_masking() -> NDArray:
    """min(1, 2 cos theta_h cos ti/cos beta)."""
    ti, tr, phi = AT
    i = np.stack([np.sin(ti), np.zeros_like(ti), np.cos(ti)])
    r = np.stack([np.sin(tr) * np.cos(phi), np.sin(tr) * np.sin(phi), np.cos(tr)])
    h = (i + r) / np.linalg.norm(i + r, axis=0)
    return np.minimum(1.0, 2.0 * h[2] * i[2] / (h * i).sum(axis=0))


def counted_share(bounces: int) -> NDArray:
    """Σ Δp_k/p_1 over the first bounces, each by section 4: which rays meet k spokes of the unfolded groove."""
    ti, tr, phi = AT
    s = np.stack([np.sin(ti) + np.sin(tr) * np.cos(phi), np.sin(tr) * np.sin(phi)])
    s /= np.linalg.norm(s, axis=0)
    t_i = np.arctan2(np.sin(ti) * s[0], np.cos(ti))
    t_r = np.arctan2(np.sin(tr) * (np.cos(phi) * s[0] + np.sin(phi) * s[1]), np.cos(tr))
    alpha = (t_i + t_r) / 2.0
    to_spoke = t_i - alpha + np.arange(bounces + 1)[:, None] * (np.pi - 2.0 * alpha)
    p = np.where(np.abs(to_spoke) < np.pi / 2.0, np.cos(to_spoke), 0.0)
    shadow = np.where(alpha + t_i > np.pi / 2.0, -np.cos(alpha + t_i), 0.0)
    share = np.zeros_like(ti)
    for k in range(1, bounces + 1):
        share += np.maximum(0.0, p[:k].min(axis=0) - np.maximum(p[k], shadow))
    return share / p[0]


def test_one_bounce_is_the_same_in_both_readings() -> None:
    kaleidoscope = Surface([Specular(1.0, SIGMA, IRON)]).mueller(*AT)
    assert_allclose(surface(1).mueller(*AT), kaleidoscope, rtol=0.0, atol=2e-13 * kaleidoscope[:, :1, :1].max())
    lit = kaleidoscope[:, 0, 0] > 1e-100
    assert_allclose(surface(1).mueller(*AT)[lit, 0, 0], kaleidoscope[lit, 0, 0], rtol=1e-12)


@pytest.mark.parametrize("bounces", [1, 2, 3, 4, 7])
def test_the_share_of_the_facet_is_that_of_the_rays_counted_bounce_by_bounce(bounces: int) -> None:
    share = masking(bounces)
    lit = ~np.isnan(share)
    assert_allclose(share[lit], counted_share(bounces)[lit], rtol=0.0, atol=1e-10)


def test_with_all_bounces_the_incoming_light_alone_is_masked() -> None:
    # No more than ceil(pi/opening) bounces are left out here; 40 are enough for openings above 4.5 degrees.
    share = masking(40)
    assert_allclose(share, np.where(np.isnan(share), np.nan, incoming_masking()), rtol=0.0, atol=1e-11)


def test_every_bounce_adds_light_up_to_that_limit() -> None:
    shares = [masking(bounces) for bounces in (1, 2, 3, 5)]
    for fewer, more in pairwise(shares):
        assert np.nanmin(more - fewer) > -1e-12
    assert np.nanmax(shares[1] - shares[0]) > 0.1
    assert np.nanmax(shares[-1] - incoming_masking()) < 1e-11


@pytest.mark.parametrize("bounces", [2, 3, 5])
def test_beyond_one_bounce_the_lobe_is_not_reciprocal(bounces: int) -> None:
    there, back = surface(bounces).stokes(0.2, 1.2, 2.5)[0], surface(bounces).stokes(1.2, 0.2, 2.5)[0]
    assert abs(there - back) > 0.05 * there
    single, single_back = surface(1).stokes(0.2, 1.2, 2.5)[0], surface(1).stokes(1.2, 0.2, 2.5)[0]
    assert_allclose(single, single_back, rtol=1e-13)


@pytest.mark.parametrize("bounces", [1, 2, 4])
def test_polarization_is_that_of_the_one_facet(bounces: int) -> None:
    one, more = surface(1).mueller(*AT), surface(bounces).mueller(*AT)
    lit = one[:, 0, 0] > 1e-100
    assert_allclose(more[lit] / more[lit, :1, :1], one[lit] / one[lit, :1, :1], rtol=0.0, atol=1e-12)


def test_the_mirror_direction_itself_is_finite() -> None:
    lobe = Specular(1.0, SIGMA, IRON, bounces=4, reading="single-fresnel")
    assert not lobe.has_caustic
    assert np.isfinite(Surface([lobe]).mueller([0.0, 0.5], [0.0, 0.5], np.pi)).all()


def test_describe_says_which_reading_it_is() -> None:
    assert "Read as single-fresnel" in surface(3).describe()
    assert "not reciprocal beyond one bounce" in surface(3).describe()
    assert "caustic" not in surface(3).describe()


def test_other_readings_and_asymmetric_grooves_are_refused() -> None:
    with pytest.raises(ValueError, match="reading is 'single'; it is kaleidoscope or single-fresnel"):
        Specular(1.0, 0.3, IRON, reading="single")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=r"asymmetry is 0\.2; the single-fresnel reading is of symmetric grooves"):
        Specular(1.0, 0.3, IRON, 0.2, reading="single-fresnel")
