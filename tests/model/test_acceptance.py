"""The mean over the cones of detector and source: against a ray tracer, through the caustic, and by its symmetries."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from model.acceptance import Acceptance, half_angle_rad
from model.cone_quadrature import cones
from model.literature import Baek2018
from model.lobes import Diffuse, Directional, Lobe, Specular
from model.raytrace import LitSurface
from model.raytrace_cone import Cone, cone_mueller
from model.surface import Surface

REVERSAL = np.diag([1.0, 1.0, 1.0, -1.0])
IRON = 2.95 + 2.932j


def grooves(sigma: float, index: complex = IRON, asymmetry: float = 0.0, bounces: int = 4) -> Surface:
    return Surface([Specular(1.0, sigma, index, asymmetry, bounces)])


@pytest.mark.parametrize("pole_deg", [(60.0, 180.0), (60.4, 180.3), (61.5, 179.0), (20.0, 10.0), (0.0, 0.0)])
@pytest.mark.parametrize("half_angle_deg", [0.2, 1.0, 20.0])
@pytest.mark.parametrize("stretch", [1.0, 0.4])
def test_the_rule_integrates_the_cone_exactly(
    pole_deg: tuple[float, float], half_angle_deg: float, stretch: float
) -> None:
    # Over a circular cone about c the mean of a direction is c (1 + cos δ)/2.
    polar, azimuth, half = np.radians([60.0]), np.radians([180.0]), np.radians(half_angle_deg)
    pole = np.radians([pole_deg[0]]), np.radians([pole_deg[1]])
    nodes = cones(polar, azimuth, half, *pole, np.array([stretch]), 16, 1)
    horizontal = np.sin(nodes.polar_rad)
    mean = [
        (nodes.weight * part).sum()
        for part in (
            horizontal * np.cos(nodes.azimuth_rad),
            horizontal * np.sin(nodes.azimuth_rad),
            np.cos(nodes.polar_rad),
        )
    ]
    centre = np.array([-np.sin(polar[0]), 0.0, np.cos(polar[0])])
    assert_allclose(mean, centre * (1.0 + np.cos(half)) / 2.0, rtol=0.0, atol=1e-6)


def test_the_mean_of_one_over_the_distance_is_two_over_the_radius() -> None:
    # The caustic goes as 1/ρ; over a disc of radius e centred on it the mean of 1/ρ is 2/e.
    half = np.radians(0.1)
    nodes = cones(np.array([0.7]), np.array([np.pi]), half, np.array([0.7]), np.array([np.pi]), np.array([1.0]), 6, 1)
    x = np.sin(nodes.polar_rad) * np.cos(nodes.azimuth_rad) + np.sin(0.7)
    y = np.sin(nodes.polar_rad) * np.sin(nodes.azimuth_rad)
    distance = np.hypot(x / np.cos(0.7), y)
    assert_allclose((nodes.weight / distance).sum(), 2.0 / half, rtol=1e-5)


@pytest.mark.parametrize(
    ("exit_deg", "azimuth_deg", "half_angle_deg", "asymmetry"),
    [(60.0, 180.0, 1.0, 0.0), (60.5, 180.0, 1.0, 0.4), (0.0, 180.0, 1.0, 0.0), (40.0, 120.0, 2.0, 0.4)],
)
def test_agrees_with_the_ray_tracer(
    exit_deg: float, azimuth_deg: float, half_angle_deg: float, asymmetry: float
) -> None:
    incidence, exit_, azimuth, half = np.radians([60.0, exit_deg, azimuth_deg, half_angle_deg])
    expected = cone_mueller(
        LitSurface(incidence_rad=incidence, sigma=0.3, asymmetry=asymmetry),
        Cone(exit_, azimuth, half),
        index=IRON,
        rays=100_000,
        seed=3,
    )
    mean = Acceptance(grooves(0.3, IRON, asymmetry), half).mueller(incidence, exit_, azimuth)
    assert (np.abs(mean - expected.mean) <= 4.0 * expected.stderr + 1e-6 * expected.mean[0, 0]).all()


@pytest.mark.parametrize("exit_deg", [60.0, 60.2, 60.6, 61.0])
def test_converges_through_the_mirror_direction(exit_deg: float) -> None:
    at = np.radians([60.0, exit_deg, 180.0])
    default, fine = (Acceptance(grooves(0.3), np.radians(0.6), nodes=nodes).mueller(*at) for nodes in (6, 24))
    assert np.isfinite(fine).all()
    assert_allclose(default, fine, rtol=0.0, atol=1e-4 * fine[0, 0])


@pytest.mark.parametrize(
    ("lobe", "at_deg", "half_angle_deg"),
    [
        (Specular(1.0, 1e-3, 1.5 + 0j, bounces=2), (60.0, 60.3, 180.0), 1.0),
        (Specular(1.0, 1e-2, 1.5 + 0j), (85.0, 85.0, 180.0), 2.0),
        (Specular(1.0, 0.4, 1.5 + 0j, bounces=4), (80.0, 80.0, 180.0), 0.3),
        (Directional(1.0, 0.02, 1.5 + 0j), (60.0, 0.0, 180.0), 0.5),
        (Directional(1.0, 0.1, 1.5 + 0j), (60.0, 2.0, 30.0), 5.0),
        (Baek2018(1.0, 0.0, 0.001, 1.5).lobes[0], (30.0, 30.0, 180.0), 1.0),
    ],
    ids=str,
)
def test_a_lobe_narrower_than_the_cone_is_resolved(
    lobe: Lobe, at_deg: tuple[float, float, float], half_angle_deg: float
) -> None:
    surface, half_angle = Surface([lobe]), np.radians(half_angle_deg)
    default, fine = (Acceptance(surface, half_angle, nodes=nodes).stokes(*np.radians(at_deg)) for nodes in (6, 40))
    assert_allclose(default, fine, rtol=0.0, atol=1e-3 * fine[0])


def test_a_source_with_a_cone_and_a_collimated_detector() -> None:
    seen = Acceptance(grooves(0.4), 0.0, np.radians(0.5)).mueller(0.9, 0.9, np.pi)
    back = Acceptance(grooves(0.4), np.radians(0.5), 0.0).mueller(0.9, 0.9, np.pi)
    assert_allclose(REVERSAL @ back.T @ REVERSAL, seen, rtol=0.0, atol=1e-12 * seen[0, 0])
    with pytest.raises(ValueError, match="mirror direction itself"):
        Acceptance(grooves(0.4), 0.0).mueller(0.9, 0.9, np.pi)


def test_all_of_a_narrow_lobe_in_a_cone_is_what_the_facets_reflect() -> None:
    # Light of irradiance E cos ti leaves within the cone, on a perfect mirror all of it: mean F · Ω cos tr = 1.
    half, incidence = np.radians(3.0), np.radians(30.0)
    mean = Acceptance(grooves(1e-3, 1.0 + 1e8j, bounces=1), half).stokes(incidence, incidence, np.pi)[0]
    assert_allclose(mean * 4.0 * np.pi * np.sin(half / 2.0) ** 2 * np.cos(incidence), 1.0, rtol=1e-4)


def test_is_reciprocal_with_the_cones_exchanged() -> None:
    one, other = np.radians([0.5, 0.3])
    there = Acceptance(grooves(0.4), one, other).mueller(0.9, 1.1, 2.8)
    back = Acceptance(grooves(0.4), other, one).mueller(1.1, 0.9, 2.8)
    assert_allclose(REVERSAL @ back.T @ REVERSAL, there, rtol=0.0, atol=1e-12 * there[0, 0])


def test_a_small_cone_away_from_the_caustic_sees_the_point_value() -> None:
    surface = Surface([Specular(0.7, 0.3, IRON, 0.2, 3), Diffuse(0.1, 0.3), Directional(0.05, 0.3, IRON)])
    at = (1.0, np.array([0.2, 0.7, 1.3]), np.array([3.0, 2.0, 0.3]))
    seen = Acceptance(surface, 1e-6, 1e-6, nodes=4)
    assert_allclose(seen.mueller(*at), surface.mueller(*at), rtol=0.0, atol=1e-5)
    state = np.array([[1.0, 0.5, -0.3, 0.2], [1.0, 0.0, 0.0, 0.0], [2.0, 0.0, 1.0, 0.0]])
    assert_allclose(seen.stokes(*at, state), surface.stokes(*at, state), rtol=0.0, atol=1e-5)
    names = ["sigma", "n", "asymmetry", "rho_d"]
    assert_allclose(seen.jacobian(names, *at), surface.jacobian(names, *at), rtol=0.0, atol=2e-4)
    assert seen.parameters == surface.parameters


def test_the_analyzer_does_not_turn_with_the_ray() -> None:
    # About the normal s-directions of neighbouring rays point all ways: averaged in them, polarization would vanish.
    surface = grooves(0.3, bounces=1)
    mean = Acceptance(surface, np.radians(2.0)).stokes(1.0, 0.0, np.pi)
    assert_allclose(mean, surface.stokes(1.0, 0.0, np.pi), rtol=0.0, atol=0.02 * mean[0])
    assert mean[1] > 0.05 * mean[0]


def test_stokes_is_mueller_times_the_state_with_cones_too() -> None:
    seen = Acceptance(grooves(0.4, asymmetry=0.3), np.radians(1.0), np.radians(0.5), nodes=3)
    state = np.array([2.0, -0.4, 1.0, 0.7])
    assert_allclose(seen.stokes(1.0, 1.01, 3.1, state), seen.mueller(1.0, 1.01, 3.1) @ state, rtol=1e-12)


def test_shapes_broadcast_and_may_be_empty() -> None:
    seen = Acceptance(grooves(0.4), np.radians(1.0), nodes=2)
    assert seen.mueller(1.0, np.zeros((5, 1)), np.zeros(3)).shape == (5, 3, 4, 4)
    assert seen.stokes(1.0, np.zeros(0), 1.0).shape == (0, 4)
    assert seen.stokes(1.0, 0.3, 1.0).shape == (4,)


def test_a_cone_that_reaches_below_the_horizon_is_dark_there() -> None:
    seen = Acceptance(Surface([Diffuse(1.0, 0.3)]), np.radians(2.0))
    assert 0.0 < seen.stokes(0.5, np.pi / 2.0, np.pi)[0] < seen.stokes(0.5, np.pi / 2.0 - 0.035, np.pi)[0]


def test_half_angle_of_a_solid_angle() -> None:
    assert_allclose(2.0 * np.pi * (1.0 - np.cos(half_angle_rad(1e-2))), 1e-2, rtol=1e-10)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((1e-200,), "detector_half_angle_rad is 1e-200; allowed is 0, or 1e-09 rad to 30°"),
        ((0.6,), "detector_half_angle_rad is 0.6; allowed"),
        ((0.1, -0.1), "source_half_angle_rad is -0.1; allowed"),
        ((0.1, 0.0, 0), "at least one"),
    ],
)
def test_what_cannot_be_is_refused(arguments, message) -> None:
    with pytest.raises(ValueError, match=message):
        Acceptance(grooves(0.3), *arguments)
