"""Directions and axes of map pixels, against the model's conventions."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acquisition.fit_points import directions
from acquisition.imaging.place.arms import Arms
from acquisition.imaging.place.exit_directions import exit_directions, turned
from acquisition.imaging.place.map_grid import MapGrid
from acquisition.imaging.place.pose import Pose
from model.geometry import Rotation
from model.mueller import rotate

ALONE = MapGrid(-0.05, 0.05, 0.1, 1, 1)  # one pixel, where the optical axis meets the plate


def looking(arms, distance_mm=300.0):
    return Pose(arms.rotation(), np.array([0.0, 0.0, distance_mm]))


@pytest.mark.parametrize("azimuth_deg", [0.0, 35.0, -120.0])
@pytest.mark.parametrize("exit_azimuth_deg", [0.0, 25.0])
@pytest.mark.parametrize("exit_deg", [-50.0, 20.0, 65.0])
def test_the_middle_is_seen_from_where_the_arms_are_and_in_the_analyzers_own_axes(
    exit_deg, exit_azimuth_deg, azimuth_deg
):
    arms = Arms(60.0, exit_deg, azimuth_deg, exit_azimuth_deg)
    found = exit_directions(looking(arms), ALONE, arms.source())
    incidence, exit_rad, azimuth = directions(60.0, exit_deg, exit_azimuth_deg=exit_azimuth_deg)
    assert_allclose(found.incidence_rad, incidence)
    assert_allclose(found.exit_rad[0, 0], exit_rad, atol=1e-12)
    assert_allclose(np.exp(1j * found.azimuth_rad[0, 0]), np.exp(1j * azimuth), atol=1e-12)
    assert_allclose(found.to_exit_frame.cos2, 1.0, atol=1e-12)
    assert_allclose(found.to_exit_frame.sin2, 0.0, atol=1e-12)


@pytest.mark.parametrize("azimuth_deg", [0.0, 40.0])
def test_beside_the_middle_directions_and_s_axes_are_those_of_vectors(azimuth_deg):
    arms = Arms(50.0, 30.0, azimuth_deg)
    grid = MapGrid(-20.0, 15.0, 10.0, 4, 3)
    found = exit_directions(looking(arms, 120.0), grid, arms.source())
    turn = np.radians(azimuth_deg)
    to_bench = np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 1]]) @ np.array(
        [[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1]]
    )
    camera = 120.0 * np.array([-np.sin(np.radians(30.0)), 0.0, np.cos(np.radians(30.0))])  # source at x > 0
    for row, y in enumerate(grid.y_mm()):
        for column, x in enumerate(grid.x_mm()):
            ray = camera - to_bench @ (x, y, 0.0)
            ray /= np.linalg.norm(ray)
            exit_rad, azimuth = found.exit_rad[row, column], found.azimuth_rad[row, column]
            as_model = (np.sin(exit_rad) * np.cos(azimuth), np.sin(exit_rad) * np.sin(azimuth), np.cos(exit_rad))
            assert_allclose(as_model, ray, atol=1e-12)
            # Light polarized along the pixel's own s-direction, through a polarizer at psi in the picture's axes.
            s = np.cross((0.0, 0.0, 1.0), ray)
            right = np.array([0.0, -1.0, 0.0])
            up = np.cross(camera / np.linalg.norm(camera), right)
            across = right - (right @ ray) * ray
            across /= np.linalg.norm(across)
            psi = np.arctan2(s @ np.cross(ray, across), s @ across)
            assert abs(psi - np.arctan2(s @ up, s @ right)) < 0.03  # what the naive projection onto the picture says
            measured = {"S1": np.array([[np.cos(2 * psi)]]), "S2": np.array([[np.sin(2 * psi)]])}
            rotation = found.to_exit_frame
            here = Rotation(rotation.cos2[row, column], rotation.sin2[row, column])
            own = turned(measured, here)
            assert_allclose([own["S1"], own["S2"]], [[[1.0]], [[0.0]]], atol=1e-6)


def test_straight_above_a_pixel_light_counts_as_on_the_mirror_side():
    arms = Arms(60.0, 0.0, 70.0)
    found = exit_directions(looking(arms), ALONE, arms.source())
    assert_allclose([found.exit_rad[0, 0], found.azimuth_rad[0, 0]], [0.0, np.pi], atol=1e-12)
    assert_allclose(found.to_exit_frame.cos2, 1.0, atol=1e-12)


def test_left_of_the_middle_the_ray_leans_to_the_right():
    """At exit 0 a pixel at x < 0 is seen from x > 0, which is a quarter turn right-handed from the mirror side."""
    found = exit_directions(looking(Arms(60.0, 0.0)), MapGrid(-10.0, 0.5, 1.0, 1, 1), Arms(60.0, 0.0).source())
    assert_allclose(np.degrees(found.azimuth_rad[0, 0]), 270.0, atol=1e-6)


def test_turning_maps_is_turning_stokes_vectors_with_their_covariance():
    random = np.random.default_rng(0)
    stokes = random.uniform(-1.0, 1.0, (6, 5, 4))
    angle = random.uniform(-np.pi, np.pi, (6, 5))
    rotation = Rotation(np.cos(2 * angle), np.sin(2 * angle))
    half = random.uniform(-1.0, 1.0, (6, 5, 2, 2))
    covariance = half @ np.swapaxes(half, -1, -2)
    maps = {
        "S0": stokes[..., 0],
        "S1": stokes[..., 1],
        "S2": stokes[..., 2],
        "S1_variance": covariance[..., 0, 0],
        "S2_variance": covariance[..., 1, 1],
    }
    found = turned(maps, rotation, covariance[..., 0, 1])
    expected = rotate(stokes, rotation)
    for place in range(3):
        assert_allclose(found[f"S{place}"], expected[..., place], rtol=1e-5, atol=1e-6)
    turn = np.stack((np.stack((rotation.cos2, rotation.sin2), -1), np.stack((-rotation.sin2, rotation.cos2), -1)), -2)
    new = turn @ covariance @ np.swapaxes(turn, -1, -2)
    assert_allclose(found["S1_variance"], new[..., 0, 0], rtol=1e-4, atol=1e-6)
    assert_allclose(found["S2_variance"], new[..., 1, 1], rtol=1e-4, atol=1e-6)
