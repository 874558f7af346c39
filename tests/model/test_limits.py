"""Normal, grazing, mirror and retro directions; indices near 1; vanishing roughness."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from model.fresnel import reflection
from model.geometry import angles, facet, horizontal_sum
from model.groove_passage import single_bounce
from model.lobes import Diffuse, Directional, Specular
from model.slopes import normal_density
from model.surface import Surface

ANGLES = np.radians([0.0, 1e-8, 30.0, 60.0, 89.9999, 90.0])
IRON = 2.95 + 2.932j


def everything(sigma: float) -> Surface:
    return Surface([Specular(0.7, sigma, IRON), Diffuse(0.1, sigma), Directional(0.05, sigma, IRON)])


@pytest.mark.parametrize("sigma", [1e-3, 0.1764, 5.0])
def test_is_finite_everywhere_and_dark_at_the_horizon(sigma: float) -> None:
    ti, tr, phi = np.meshgrid(ANGLES, ANGLES, np.radians([0.0, 1e-8, 90.0, 180.0, -180.0, 360.0]), indexing="ij")
    matrices = everything(sigma).mueller(ti, tr, phi)
    assert np.isfinite(matrices).all()
    assert (matrices[..., 0, 0] >= 0.0).all()
    at_horizon = (ti == np.pi / 2.0) | (tr == np.pi / 2.0)
    assert (matrices[at_horizon] == 0.0).all()


def test_is_continuous_towards_the_normal() -> None:
    exits = np.radians([0.0, 1e-8, 1e-4])
    f = everything(0.3).mueller(np.radians(60.0), exits, np.pi)
    assert_allclose(f[1], f[0], atol=1e-7)
    assert_allclose(f[2], f[0], atol=1e-3)


@pytest.mark.parametrize("incidence_deg", [1.0, 45.0, 89.0])
@pytest.mark.parametrize("offset", [1e-3, 1e-9, 1e-14])
def test_the_horizontal_sum_keeps_its_digits_near_the_mirror_direction(incidence_deg: float, offset: float) -> None:
    # For small offsets: rho² = (cos ti · d_tr)² + (sin ti · d_phi)². Adding i and r as vectors loses it below 1e-16.
    ti = np.radians(incidence_deg)
    tr, phi = ti + offset, np.pi + offset
    d_tr, d_phi = tr - ti, (phi - np.pi) - 1.2246467991473532e-16
    x, y = horizontal_sum(angles(ti, tr, phi))
    assert_allclose(np.hypot(x, y), np.hypot(np.cos(ti) * d_tr, np.sin(ti) * d_phi), rtol=max(2.0 * offset, 1e-14) * 30)


def test_the_horizontal_sum_is_that_of_the_vectors() -> None:
    ti, tr, phi = 0.7, 1.1, -0.4
    x, y = horizontal_sum(angles(ti, tr, phi))
    assert_allclose([x, y], [np.sin(ti) + np.sin(tr) * np.cos(phi), np.sin(tr) * np.sin(phi)], rtol=1e-14)


def test_the_facet_in_the_mirror_direction_is_flat() -> None:
    wall = facet(angles(ANGLES[:-1], ANGLES[:-1], np.pi))
    # The double nearest to pi is not pi, which grazing angles magnify.
    assert_allclose(wall.slope, 0.0, atol=1e-10)
    assert_allclose(wall.cos, np.cos(ANGLES[:-1]), rtol=1e-10)


def test_the_facet_angle_keeps_its_digits_in_retro_reflection() -> None:
    offset = 1e-9
    wall = facet(angles(0.7, 0.7 + offset, 0.0))
    assert_allclose(wall.sin2, ((0.7 + offset - 0.7) / 2.0) ** 2, rtol=1e-12)


@pytest.mark.parametrize("index", [1.5 + 0j, 1.0 + 1e-9 + 0j, 0.97 + 6.4j, 2.0 + 50.0j])
def test_rs_minus_rp_keeps_its_digits_near_normal_incidence(index: complex) -> None:
    # Expanded about the normal: Rs - Rp = 4 R0 sin² Re(1/N) (1 + O(sin²)). Textbook forms subtract and lose it.
    sin2 = 1e-10
    half_difference = reflection(np.sqrt(1.0 - sin2), sin2, index.real, index.imag)[0][1]
    r0 = abs((index - 1.0) / (index + 1.0)) ** 2
    # The reference subtracts 1 from n as well: allow for the rounding of n itself.
    tolerance = 1e-8 + 1e-15 / abs(index - 1.0)
    assert_allclose(2.0 * half_difference, 4.0 * r0 * sin2 * (1.0 / index).real, rtol=tolerance)


def test_nothing_reflects_where_the_index_does_not_change() -> None:
    cosines = np.array([1.0, 0.5, 0.0])
    assert_array_equal(reflection(cosines, 1.0 - cosines**2, 1.0, 0.0)[0][0], 0.0)


def test_an_index_near_one_keeps_its_digits_at_grazing_incidence() -> None:
    # N² - sin² as N² - (1 - cos²) would leave seven digits; with N - 1 = 2^-30 every step below is exact.
    excess, c = 2.0**-30, 1e-5
    w = np.sqrt(excess * (2.0 + excess) + c * c)
    r_s2 = ((c - w) / (c + w)) ** 2
    mean, half_difference, *_ = reflection(c, 1.0 - c * c, 1.0 + excess, 0.0)[0]
    assert_allclose(mean + half_difference, r_s2, rtol=1e-13)


def test_beyond_the_critical_angle_all_light_is_reflected() -> None:
    sines = np.array([0.7, 0.9, 1.0])
    matrix = reflection(np.sqrt(1.0 - sines**2), sines**2, 1.0 / 1.5, 0.0)
    assert_allclose(matrix[0][0], 1.0, rtol=1e-14)
    assert_allclose(matrix[0][1], 0.0, atol=1e-15)
    assert_allclose(np.hypot(matrix[2][2], matrix[3][2]), 1.0, rtol=1e-14)


def test_every_metal_reflects_all_light_at_grazing_incidence() -> None:
    grazing = np.cos(np.pi / 2.0)
    assert_allclose(reflection(grazing, 1.0, IRON.real, IRON.imag)[0][0], 1.0, rtol=1e-14)


def test_a_far_slope_underflows_to_nothing() -> None:
    with np.errstate(divide="raise", over="raise", invalid="raise"):
        assert normal_density(np.array([1e3, 1e15]), 0.01).tolist() == [0.0, 0.0]


@pytest.mark.parametrize("sigma", [0.05, 0.5, 2.0])
def test_the_facets_projected_areas_add_up_to_the_surface(sigma: float) -> None:
    # ∫ D cos(theta) d omega = 1, in u = tan theta: d omega cos = u du d phi/(1 + u²)².
    slope = np.linspace(0.0, 10.0 * sigma, 20001)
    integrand = normal_density(slope, sigma) * 2.0 * np.pi * slope / (1.0 + slope**2) ** 2
    assert_allclose(np.trapezoid(integrand, slope), 1.0, rtol=1e-7)


def test_masking_is_one_face_on_and_vanishes_at_grazing() -> None:
    def masking(ti: float, tr: float, phi: float) -> float:
        wall = facet(angles(ti, tr, phi))
        unmasked = normal_density(wall.slope, 2.0) / (4.0 * wall.cos_incidence * wall.cos_exit)
        return single_bounce(wall, 2.0, 0.0) / unmasked

    assert_allclose(masking(0.3, 0.3, np.pi), 1.0, rtol=1e-14)
    # Towards the horizon 2 cos theta_h cos tr/cos beta, here with the limits of its other factors.
    from_horizon = 1e-9
    at_horizon = facet(angles(0.3, np.pi / 2.0, 1.0))
    edge = 2.0 * at_horizon.sum_of_cosines / (2.0 * at_horizon.cos**2) * from_horizon
    assert_allclose(masking(0.3, np.pi / 2.0 - from_horizon, 1.0), edge, rtol=1e-6)
