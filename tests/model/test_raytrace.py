"""The ray tracer against tables of another tracer, and against what is known of mirrors and of single bounces."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_less

from model.raytrace import LitSurface, bounce_fractions, draw_grooves, reflections
from model.raytrace_cone import Cone, cone_mueller, cone_stokes
from model.vgroove import bounce_mueller

METAL = 0.97 + 6.4j

# sigma, asymmetry, angle of incidence: fractions of 10^7 rays after 1, 2, ... bounces, by another tracer.
FRACTIONS = [
    (0.1, 0.5, 80.0, [0.9437233, 0.0562767]),
    (0.3, 0.0, 0.0, [0.9494642, 0.0505309, 0.0000049]),
    (0.5, 0.0, 60.0, [0.8567798, 0.1404534, 0.0027512, 0.0000156]),
    (0.5, 0.5, 30.0, [0.8319173, 0.1666107, 0.0014710, 0.0000010]),
    (1.0, 0.0, 0.0, [0.2638822, 0.4333968, 0.2203750, 0.0674128, 0.0131254]),
    (1.0, 0.5, 80.0, [0.9069022, 0.0828897, 0.0094483, 0.0007248, 0.0000342]),
]


@pytest.mark.parametrize(("sigma", "asymmetry", "incidence_deg", "expected"), FRACTIONS)
def test_bounce_fractions(sigma: float, asymmetry: float, incidence_deg: float, expected: list[float]) -> None:
    rays = 200_000
    sample = bounce_fractions(LitSurface(np.radians(incidence_deg), sigma, asymmetry), rays=rays, seed=1)
    assert_allclose(sample.mean.sum(), 1.0, rtol=1e-12)
    fractions = np.zeros(len(expected))
    known = min(len(expected), len(sample.mean))
    fractions[:known] = sample.mean[:known]
    error = np.sqrt(np.multiply(expected, np.subtract(1.0, expected)) * (1.0 / rays + 1e-7))
    assert_array_less(np.abs(fractions - expected), 4.0 * error)
    assert_allclose(sample.stderr[:1], error[:1], rtol=0.05)


# Exit angle and half-angle of the cone in degrees, sigma, asymmetry, index; M00, M01, M22, M32 and standard errors, for
# light at 60 degrees in plane, by another tracer.
CONES = [
    (55.0, 1.0, 0.15, 0.0, METAL, [6.49246, 0.570843, -5.30184, 1.01849], [0.0045, 0.00077, 0.0031, 0.0033]),
    (40.0, 0.25, 0.3, 0.0, 1.5 + 0j, [0.0686452, 0.0651749, -0.0186108, 0.0], [3.6e-05, 3.4e-05, 1e-05, 0.0]),
    (60.0, 0.25, 0.3, 0.0, 1.5 + 0j, [3.33616, 2.78777, 1.62557, 0.0], [0.022, 0.018, 0.011, 0.0]),
    (40.0, 1.0, 0.5, 0.0, METAL, [0.461657, 0.0328957, -0.385818, 0.0226758], [0.00026, 3.9e-05, 0.00019, 0.00019]),
    (20.0, 0.25, 0.3, 0.4, 1.5 + 0j, [0.0195348, 0.0139131, -0.0131572, 0.0], [1.7e-05, 1.2e-05, 1.2e-05, 0.0]),
    (61.0, 1.0, 0.5, 0.4, METAL, [3.72967, 0.310728, -2.50737, 0.462875], [0.027, 0.003, 0.021, 0.012]),
]


@pytest.mark.parametrize(("exit_deg", "half_deg", "sigma", "asymmetry", "index", "expected", "stderr"), CONES)
def test_cone_averages(
    exit_deg: float,
    half_deg: float,
    sigma: float,
    asymmetry: float,
    index: complex,
    expected: list[float],
    stderr: list[float],
) -> None:
    lit, cone = LitSurface(np.pi / 3.0, sigma, asymmetry), Cone(np.radians(exit_deg), np.pi, np.radians(half_deg))
    sample = cone_mueller(lit, cone, index=index, rays=100_000, seed=2)
    elements = ([0, 0, 2, 3], [0, 1, 2, 2])
    error = np.hypot(sample.stderr[elements], stderr)
    assert sample.stderr[0, 0] < 0.1 * sample.mean[0, 0]
    assert_array_less(np.abs(sample.mean[elements] - expected), 4.0 * error + 1e-15)


@pytest.mark.parametrize("azimuth_deg", [30.0, 100.0, -130.0])
@pytest.mark.parametrize("index", [1.5 + 0j, 2.95 + 2.932j])
def test_one_bounce_out_of_plane_is_the_known_lobe_with_its_signs(azimuth_deg: float, index: complex) -> None:
    ti, tr, phi = 0.7, 0.5, np.radians(azimuth_deg)
    sample = cone_mueller(LitSurface(ti, 0.4, 0.0), Cone(tr, phi, 0.01), index=index, rays=50_000, seed=3, bounces=1)
    point = bounce_mueller(1, ti, tr, phi, sigma=0.4, asymmetry=0.0, index=index)
    # Over so small a cone the mean differs from the value at its centre by less than 0.1 %.
    assert_array_less(np.abs(sample.mean - point), 4.0 * sample.stderr + 1e-3 * point[0, 0])


def test_a_nearly_flat_metal_is_a_mirror() -> None:
    ti, half = 0.9, 0.02
    cone = Cone(ti, np.pi, half)
    sample = cone_mueller(LitSurface(ti, 1e-4, 0.3), cone, index=METAL, rays=20_000, seed=4)
    c = np.cos(ti)
    w = np.sqrt(METAL**2 - 1.0 + c**2)
    r_s, r_p = (c - w) / (c + w), (METAL**2 * c - w) / (METAL**2 * c + w)
    m = sample.mean * cone.solid_angle_sr * c
    assert_allclose([m[0, 0] + m[0, 1], m[0, 0] - m[0, 1]], [abs(r_s) ** 2, abs(r_p) ** 2], rtol=0.05)
    assert_allclose(m[2, 2] + 1j * m[3, 2], r_s * np.conj(r_p), rtol=0.05)


def test_all_light_is_the_sum_over_bounces() -> None:
    lit, cone = LitSurface(0.6, 0.8, 0.3), Cone(0.4, 2.0, 0.05)
    total = cone_mueller(lit, cone, index=METAL, rays=50_000, seed=5)
    parts = [cone_mueller(lit, cone, index=METAL, rays=50_000, seed=6, bounces=k) for k in range(1, 7)]
    error = np.sqrt(total.stderr**2 + sum(part.stderr**2 for part in parts))
    assert_array_less(np.abs(sum(part.mean for part in parts) - total.mean), 4.0 * error)
    assert parts[1].mean[0, 0] > 10.0 * parts[1].stderr[0, 0]


def test_a_stokes_vector_is_the_matrix_times_the_incoming_light() -> None:
    lit, cone = LitSurface(0.6, 0.3, 0.0), Cone(0.4, 2.0, 0.05)
    incoming = [1.0, 0.3, -0.2, 0.1]
    matrix = cone_mueller(lit, cone, index=METAL, rays=20_000, seed=7)
    stokes = cone_stokes(lit, cone, index=METAL, rays=20_000, seed=7, incoming=incoming)
    assert_allclose(stokes.mean, matrix.mean @ incoming, rtol=1e-12)
    unpolarized = cone_stokes(lit, cone, index=METAL, rays=20_000, seed=7)
    assert_allclose(unpolarized.stderr, matrix.stderr[:, 0], rtol=1e-12)


def test_rays_alternate_between_walls_and_keep_their_part_along_the_groove() -> None:
    random = np.random.default_rng(8)
    slope, azimuth = random.uniform(0.5, 8.0, 2000), random.uniform(-np.pi, np.pi, 2000)
    grooves = draw_grooves(slope, azimuth, 0.4, random)
    travel = LitSurface(1.0, 1.0, 0.4).travel
    axis = np.stack([-np.sin(azimuth), np.cos(azimuth), np.zeros(2000)], axis=-1)
    last, leaving = np.zeros((2000, 3)), np.tile(travel, (2000, 1))
    for rays, normals, before, after in reflections(grooves, travel):
        assert (np.einsum("ri,ri->r", before, normals) < 0.0).all()
        assert (np.linalg.norm(normals - last[rays], axis=-1) > 1e-3).all()
        last[rays], leaving[rays] = normals, after
    assert (leaving[:, 2] > 0.0).all()
    assert_allclose(np.einsum("ri,ri->r", leaving, axis), axis @ travel, atol=1e-13)
    assert_allclose(np.linalg.norm(leaving, axis=-1), 1.0, rtol=1e-12)


def test_walls_end_at_one_height_and_have_the_slopes_asked_for() -> None:
    random = np.random.default_rng(9)
    grooves = draw_grooves(np.full(1000, 0.6), np.zeros(1000), 0.5, random)
    slopes = np.abs(grooves.normals[..., 0] / grooves.normals[..., 2])
    assert_allclose(np.sort(slopes, axis=0), np.array([[0.3], [0.9]]) * np.ones(1000), rtol=1e-14)
    assert 400 < (slopes[0] > slopes[1]).sum() < 600
    # From the bottom edge each wall rises to the lid; both together are as wide as the groove.
    assert_allclose((-grooves.bottom[:, 2] / slopes).sum(axis=0), 1.0, rtol=1e-14)


def test_a_seed_repeats_a_sample() -> None:
    lit, cone = LitSurface(0.6, 0.3, 0.0), Cone(0.4, 2.0, 0.05)
    first, again, other = (cone_mueller(lit, cone, index=METAL, rays=2000, seed=seed).mean for seed in (1, 1, 2))
    assert (first == again).all()
    assert (first != other).any()


def test_settings_out_of_range_are_refused() -> None:
    with pytest.raises(ValueError, match=r"incidence_rad is 1\.6"):
        LitSurface(1.6, 0.3, 0.0)
    with pytest.raises(ValueError, match="asymmetry is 1; allowed is 0 to below 1"):
        LitSurface(0.5, 0.3, 1.0)
    with pytest.raises(ValueError, match="sigma is 0"):
        LitSurface(0.5, 0.0, 0.0)
    with pytest.raises(ValueError, match=r"half_angle_rad is 0 about an exit_rad of 0\.5"):
        Cone(0.5, 0.0, 0.0)
    with pytest.raises(ValueError, match="above the horizon"):
        Cone(1.5, 0.0, 0.1)
    with pytest.raises(ValueError, match="k of at least 0"):
        cone_mueller(LitSurface(0.5, 0.3, 0.0), Cone(0.5, 0.0, 0.1), index=1.5 - 1j, rays=10, seed=0)
