"""The diffuse and directional lobes as eqs. (8) and (10) print them, and what may not be asked for."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from model.bounce_bound import Tolerance
from model.lobes import Diffuse, Directional, Specular
from model.mueller import depolarizer
from model.stokes import dolp
from model.surface import Surface

IRON = 2.95 + 2.932j


def masking(ti: float, tr: float, phi: float) -> float:
    """G = min(1, 2 cos theta_h cos ti/cos beta, the same with tr), from vectors."""
    i = np.array([np.sin(ti), 0.0, np.cos(ti)])
    r = np.array([np.sin(tr) * np.cos(phi), np.sin(tr) * np.sin(phi), np.cos(tr)])
    h = (i + r) / np.linalg.norm(i + r)
    return min(1.0, 2.0 * h[2] * min(i[2], r[2]) / (h @ i))


def test_the_diffuse_lobe_is_eq_8() -> None:
    sigma, ti, tr, phi = 0.25, 0.9, 1.2, 0.8
    assert masking(ti, tr, phi) < 0.9
    c1, c2 = 0.8532 * sigma**-0.095, 0.3595 * sigma**1.785
    bracket = c1 + c2 * np.tan(ti) * np.tan(tr) * np.cos(phi)
    expected = 0.3 / np.pi * masking(ti, tr, phi) * bracket * depolarizer()
    assert_allclose(Surface([Diffuse(0.3, sigma)]).mueller(ti, tr, phi), expected, rtol=1e-13)


def test_facets_make_the_diffuse_lobe_brighter_towards_the_source() -> None:
    # phi is counted between source and detector: cos phi > 0 is the source side, where Lambertian facets face both.
    surface = Surface([Diffuse(1.0, 0.4)])
    towards_source, towards_mirror = (surface.stokes(1.0, 1.0, phi)[0] / masking(1.0, 1.0, phi) for phi in (0.0, np.pi))
    assert towards_source > towards_mirror


def test_the_diffuse_lobe_is_zero_where_the_printed_bracket_is_negative() -> None:
    sigma, angle = 0.5, np.radians(75.0)
    assert 0.8532 * sigma**-0.095 < 0.3595 * sigma**1.785 * np.tan(angle) ** 2
    assert Surface([Diffuse(1.0, sigma)]).stokes(angle, angle, np.pi)[0] == 0.0


def test_the_directional_lobe_is_eq_10() -> None:
    # The exponent is the printed tan, not tan²; the prefactor sqrt(2 pi) sigma of (10), not sqrt(2 pi sigma) of (11).
    sigma, ti, tr = 0.4, 0.6, 0.2
    f = Surface([Directional(0.05, sigma, 1.5 + 0j)]).mueller(ti, tr, np.pi)
    specular = Surface([Specular(1.0, sigma, 1.5 + 0j)]).mueller(ti, tr, np.pi)
    size = 0.05 * np.exp(-2.0 * np.tan(tr) / sigma**2) / (np.sqrt(2.0 * np.pi) * sigma)
    assert_allclose(f / f[0, 0], specular / specular[0, 0], rtol=0.0, atol=1e-14)
    c = np.cos(0.4)
    w = np.sqrt(1.5**2 - 1.0 + c**2)
    mean_reflectance = (((c - w) / (c + w)) ** 2 + ((1.5**2 * c - w) / (1.5**2 * c + w)) ** 2) / 2.0
    assert_allclose(f[0, 0], size * mean_reflectance, rtol=1e-13)


def test_the_smooth_exponent_has_the_tangent_squared() -> None:
    sigma, tr = 0.4, np.array([0.0, 1e-3, 0.2, 0.5])
    printed, smooth = (Surface([Directional(0.05, sigma, 1.5 + 0j, p)]).stokes(0.6, tr, np.pi)[:, 0] for p in (1, 2))
    ratio = np.exp(-2.0 * (np.tan(tr) ** 2 - np.tan(tr)) / sigma**2)
    assert_allclose(smooth / printed, ratio, rtol=1e-13)
    # Towards the normal the one has a cusp, the other a flat top.
    slopes = [
        Surface([Directional(0.05, sigma, IRON, exponent)]).stokes(0.0, 1e-6, 0.0)[0]
        / Surface([Directional(0.05, sigma, IRON, exponent)]).stokes(0.0, 0.0, 0.0)[0]
        - 1.0
        for exponent in (1, 2)
    ]
    assert_allclose(slopes, [-2e-6 / sigma**2, 0.0], atol=1e-10)


@pytest.mark.parametrize(("exponent", "half_width"), [(1, 0.4**2 / 2.0), (2, 0.4 / np.sqrt(2.0))])
def test_the_directional_lobe_falls_to_one_e_th_where_it_says(exponent: int, half_width: float) -> None:
    lobe = Directional(1.0, 0.4, 1e-6 + 1e6j, exponent)
    top, side = Surface([lobe]).stokes(0.0, [0.0, np.arctan(half_width)], 1.0)[:, 0]
    assert_allclose(side / top, np.exp(-1.0), rtol=1e-5)  # the reflectance varies with 1e-6
    assert f"{np.degrees(np.arctan(half_width)):.2g}°" in lobe.describe()


def test_lobes_add_up() -> None:
    lobes = [Specular(0.7, 0.2, 1.5 + 0j), Diffuse(0.1, 0.2), Directional(0.05, 0.2, 1.5 + 0j)]
    at = (1.0, np.radians([0.0, 20.0, 70.0]), np.pi)
    together = Surface(lobes).mueller(*at)
    assert_allclose(together, sum(Surface([lobe]).mueller(*at) for lobe in lobes), rtol=1e-14, atol=1e-16)


def test_degree_of_polarization_comes_from_the_summed_stokes_vector() -> None:
    # The square printed in eq. (13) drops a cross term between the lobes.
    specular, directional = Specular(0.7, 0.4, 1.5 + 0j), Directional(0.5, 0.4, 1.5 + 0j)
    at = (1.0, 0.05, 2.5)
    parts = [Surface([lobe]).stokes(*at) for lobe in (specular, directional)]
    total = Surface([specular, directional]).stokes(*at)
    expected = np.hypot(parts[0][1] + parts[1][1], parts[0][2] + parts[1][2]) / (parts[0][0] + parts[1][0])
    assert_allclose(dolp(total), expected, rtol=1e-14)
    assert np.isnan(dolp([0.0, 0.0, 0.0]))


def test_shapes_broadcast() -> None:
    surface = Surface([Specular(0.7, 0.2, 1.5 + 0j), Diffuse(0.1, 0.2), Directional(0.05, 0.2, 1.5 + 0j)])
    exits, azimuths = np.zeros((5, 1)), np.zeros(3)
    assert surface.mueller(0.5, exits, azimuths).shape == (5, 3, 4, 4)
    assert surface.stokes(0.5, exits, azimuths).shape == (5, 3, 4)
    assert surface.stokes(0.5, exits, azimuths, np.ones((5, 3, 4))).shape == (5, 3, 4)
    assert surface.stokes(0.5, 0.5, 0.5).shape == (4,)


def test_describe_says_what_is_in_and_what_is_left_out() -> None:
    text = Surface([Specular(0.7, 0.1764, 2.95 + 2.932j)]).describe()
    assert "rho_s = 0.7" in text
    assert "2.95 + 2.932i" in text
    assert "twice or more" in text
    assert "caustic" in text
    assert "Left out because not asked for: diffuse, directional diffuse lobe." in text


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Specular(-0.1, 0.2, 1.5 + 0j), "rho_s is -0.1"),
        (lambda: Diffuse(np.nan, 0.2), "rho_d is nan"),
        (lambda: Directional(np.inf, 0.2, 1.5 + 0j), "rho_dd is inf"),
        (lambda: Specular(0.1, 0.0, 1.5 + 0j), "sigma is 0.0"),
        (lambda: Specular(0.1, 0.2, 0j), "n above 0"),
        (lambda: Directional(0.1, 0.2, 1.5 + 0j, 3), r"exponent is 3; it is 1 \(printed\) or 2 \(smooth\)"),
        (lambda: Diffuse(0.1, 0.2, "right"), "averages is 'right'; they are printed or exact"),
        (lambda: Surface([]), "at least one lobe"),
        (lambda: Surface([Diffuse(1.0, 0.2)]).mueller(-0.1, 0.0, 0.0), r"incidence_rad holds -0.1 rad.*0 to pi/2"),
        (lambda: Surface([Diffuse(1.0, 0.2)]).stokes(0.1, [0.5, 60.0], 0.0), r"exit_rad holds 60 rad.*0 to pi/2"),
        (lambda: Surface([Diffuse(1.0, 0.2)]).stokes(0.1, 0.5, np.nan), "azimuth_rad holds nan"),
        (lambda: Surface([Diffuse(1.0, 0.2)]).stokes(0.1, 0.5, 0.0, [1.0, 0.0, 0.0]), r"shape \(3,\).*four elements"),
    ],
)
def test_what_cannot_be_is_refused(make, message) -> None:
    with pytest.raises(ValueError, match=message):
        make()


@pytest.mark.parametrize("azimuth", [np.pi, -np.pi, 3.0 * np.pi])
@pytest.mark.parametrize("kind", [np.float64, np.float32])
def test_the_mirror_direction_is_refused_as_its_angles_are_rounded(azimuth: float, kind: type) -> None:
    surface = Surface([Specular(0.7, 0.4, 1.5 + 0j, bounces=3)])
    at = kind(np.radians(60.0)), kind(np.radians(60.0)), kind(azimuth)
    for evaluate in (surface.mueller, surface.stokes, lambda *at: surface.jacobian(["rho_s"], *at)):
        with pytest.raises(ValueError, match=r"incidence 60°, exit 60°.*mirror direction itself.*acceptance cone"):
            evaluate(*at)
    assert np.isfinite(surface.stokes(at[0], at[1] + kind(1e-4), at[2])).all()
    assert np.isfinite(Surface([Specular(0.7, 0.4, 1.5 + 0j)]).stokes(*at)).all()


def test_a_tolerance_that_asks_for_endless_bounces_is_refused() -> None:
    assert Specular(1.0, 0.3, 1.5 + 0j, bounces=Tolerance(1e-4)).followed == 3
    with pytest.raises(ValueError, match="more than 32 bounces at sigma = 10"):
        Specular(1.0, 10.0, 1.5 + 0j, bounces=Tolerance(1e-4))


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_an_incoming_state_that_is_no_number_is_refused(bad: float) -> None:
    with pytest.raises(ValueError, match=r"incoming holds .*finite elements"):
        Surface([Diffuse(1.0, 0.3)]).stokes(0.1, 0.2, 0.3, [1.0, bad, 0.0, 0.0])
