"""The signs that everything else keeps to; each test names the mistake it would catch."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from model.fresnel import reflection
from model.geometry import angles, facet, in_plane
from model.groove_reflectance import facet_mueller
from model.lobes import Specular
from model.mueller import polarizer_row
from model.stokes import aolp
from model.surface import Surface

GLASS, IRON = complex(1.525), 2.95 + 2.932j
UNPOLARIZED = np.array([1.0, 0.0, 0.0, 0.0])


def forward(angle_deg: float, index: complex) -> np.ndarray:
    """Mueller matrix of a facet that lies in the macro surface, mirror direction in plane."""
    angle = np.radians(angle_deg)
    return np.array(facet_mueller(facet(angles(angle, angle, np.pi)), index.real, index.imag))


def jones_of_mirror(angle_deg: float, index: complex) -> tuple[complex, complex]:
    """Textbook Fresnel coefficients r_s, r_p with exp(-i omega t), (s, p, q) right-handed on both sides."""
    c = np.cos(np.radians(angle_deg))
    w = np.sqrt(index**2 - 1.0 + c**2 + 0j)
    assert w.imag >= 0.0
    return (c - w) / (c + w), (index**2 * c - w) / (index**2 * c + w)


@pytest.mark.parametrize("index", [GLASS, IRON])
def test_s1_is_positive_for_reflected_unpolarized_light(index: complex) -> None:
    # A rig whose analyzer zero is horizontal in a horizontal plane of incidence measures p as +S1; the model stays s.
    assert (forward(60.0, index) @ UNPOLARIZED)[1] > 0.0


def test_p_polarized_light_is_negative_s1_and_vanishes_at_brewsters_angle() -> None:
    brewster_deg = np.degrees(np.arctan(GLASS.real))
    p_light = np.array([1.0, -1.0, 0.0, 0.0])
    assert_allclose(forward(brewster_deg, GLASS) @ p_light, 0.0, atol=1e-16)
    reflected = forward(brewster_deg, GLASS) @ UNPOLARIZED
    assert_allclose(reflected[1] / reflected[0], 1.0, rtol=1e-14)


def test_an_analyzer_along_s_passes_more_than_one_along_p() -> None:
    reflected = forward(60.0, GLASS) @ UNPOLARIZED
    assert polarizer_row(0.0) @ reflected > polarizer_row(np.pi / 2.0) @ reflected


def test_s3_is_positive_for_light_that_turns_clockwise_for_the_receiver() -> None:
    # E = Re[(Ex x + Ey y) exp(-i omega t)]; the receiver looks at the source and sees x to the right, y up.
    ex, ey = 1.0, -1.0j
    s3 = 2.0 * (ex * np.conj(ey)).imag
    now, later = ([(component * np.exp(-1j * t)).real for component in (ex, ey)] for t in (0.0, 0.1))
    turn = now[0] * later[1] - now[1] * later[0]
    assert s3 > 0.0
    assert turn < 0.0


@pytest.mark.parametrize("angle_deg", [20.0, 60.0, 80.0])
def test_m23_and_m32_of_a_metal_have_the_sign_of_the_jones_product(angle_deg: float) -> None:
    # Taking r_s r_p* as real breaks metals; mixing n + ik with the other time dependence flips these two elements only.
    r_s, r_p = jones_of_mirror(angle_deg, IRON)
    cross = r_s * np.conj(r_p)
    matrix = forward(angle_deg, IRON)
    assert cross.imag > 0.01
    assert_allclose([matrix[2, 2], matrix[3, 3]], cross.real, rtol=1e-13)
    assert_allclose([matrix[3, 2], -matrix[2, 3]], cross.imag, rtol=1e-13)


def test_light_at_45_degrees_becomes_clockwise_on_a_metal() -> None:
    assert (forward(70.0, IRON) @ [1.0, 0.0, 1.0, 0.0])[3] > 0.0


def test_the_other_sign_of_the_index_is_refused() -> None:
    with pytest.raises(ValueError, match="k of at least 0"):
        Specular(1.0, 0.2, 2.95 - 2.932j)


@pytest.mark.parametrize("index", [GLASS, IRON])
def test_at_normal_incidence_r_p_is_minus_r_s(index: complex) -> None:
    matrix = np.array(reflection(1.0, 0.0, index.real, index.imag))
    assert_allclose(matrix, matrix[0, 0] * np.diag([1.0, 1.0, -1.0, -1.0]), rtol=1e-15)
    assert_allclose(matrix[0, 0], abs((index - 1.0) / (index + 1.0)) ** 2, rtol=1e-14)


@pytest.mark.parametrize("angle_deg", [0.0, 1e-6, 30.0, 89.0])
def test_a_mirror_keeps_s_and_turns_45_degrees_over(angle_deg: float) -> None:
    # Looked at against the light, before and after, the picture is mirrored: +45° comes back as -45°.
    matrix = forward(angle_deg, 1e-6 + 1e6j)
    assert_allclose(matrix, np.diag([1.0, 1.0, -1.0, -1.0]), atol=3e-4)


@pytest.mark.parametrize("azimuth_deg", [0.0, 37.0, 90.0, 180.0, -120.0])
def test_at_the_normal_the_frames_follow_the_azimuth(azimuth_deg: float) -> None:
    # Incoming x = (0, -1, 0), outgoing x = (-sin phi, cos phi, 0): an electric field along y stays along y.
    phi = np.radians(azimuth_deg)
    matrix = np.array(facet_mueller(facet(angles(0.0, 0.0, phi)), 1e-6, 1e6))
    along_y = matrix @ [1.0, 1.0, 0.0, 0.0]
    x_out, y_out = np.array([-np.sin(phi), np.cos(phi)]), np.array([-np.cos(phi), -np.sin(phi)])
    ex, ey = x_out[1], y_out[1]
    assert_allclose(along_y, [1.0, ex**2 - ey**2, 2.0 * ex * ey, 0.0], atol=1e-5)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_s2_out_of_plane_follows_the_side_of_the_detector(sign: float) -> None:
    # Rotation angles by plain arccos (Priest-Germer) lose this sign for half of all azimuths. At ti = tr = 45° and
    # phi = +90° the facet's s-direction i × r is (-1, -1, 1)/2, in the frame x = (-1, 0, 0), y = (0, -1, 1)/sqrt 2:
    e = np.array([0.5, np.sqrt(0.5)]) * [1.0, sign]
    angle = np.radians(45.0)
    stokes = Surface([Specular(1.0, 0.5, GLASS)]).stokes(angle, angle, sign * np.pi / 2.0)
    expected = np.array([e[0] ** 2 - e[1] ** 2, 2.0 * e[0] * e[1]]) / (e @ e)
    polarized = np.hypot(stokes[1], stokes[2])
    assert_allclose(stokes[1:3] / polarized, expected, rtol=1e-12)
    assert sign * stokes[2] > 0.0


def test_the_angle_of_polarization_turns_from_x_to_y() -> None:
    turned = np.radians([-89.0, -45.0, 0.0, 30.0, 90.0])
    stokes = np.stack([np.ones(5), np.cos(2 * turned), np.sin(2 * turned)], axis=-1)
    assert_allclose(aolp(stokes), turned, atol=1e-15)
    for angle, state in zip(turned, stokes, strict=True):
        assert_allclose(polarizer_row(angle)[:3] @ state, 1.0, rtol=1e-15)


def test_p_polarized_light_has_one_angle_whatever_the_rounding_of_s2() -> None:
    states = [[1.0, -1.0, s2] for s2 in (0.0, -0.0, 1e-20, -1e-20)]
    assert_allclose(aolp(states), np.pi / 2.0, rtol=1e-15)


def test_a_positive_signed_exit_angle_is_the_mirror_side() -> None:
    exit_rad, azimuth_rad = in_plane([-0.5, 0.0, 0.5])
    assert_allclose(exit_rad, [0.5, 0.0, 0.5])
    assert_allclose(azimuth_rad, [0.0, np.pi, np.pi])
    surface = Surface([Specular(1.0, 0.2, GLASS)])
    backward, _, towards_mirror = surface.stokes(0.5, exit_rad, azimuth_rad)[:, 0]
    assert towards_mirror > 10.0 * backward


def test_sigma_is_the_rms_slope_per_axis() -> None:
    # Beckmann's alpha (Mitsuba) and SCATMECH's facet slope are sqrt 2 sigma: at slope sigma the lobe is at exp(-1/2).
    sigma = 0.3
    tilt = np.arctan(sigma)
    mirror = 1e-6 + 1e6j
    surface = Surface([Specular(1.0, sigma, mirror)])
    straight, tilted = (surface.stokes(angle, angle, 0.0)[0] * np.cos(angle) ** 6 for angle in (0.0, tilt))
    # Retro-reflection: facet slope tan(ti), D/(4 cos² ti) with the cos⁴ of D.
    assert_allclose(tilted / straight, np.exp(-0.5), rtol=1e-5)
