"""Which place of the plate a pixel sees, whence, and in which frame: against vectors written down from the bench."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from sim_devices.camera.distortion import distorted, undistorted
from sim_devices.camera.view import View

cv2 = pytest.importorskip("cv2")

DISTORTION = (-0.22, 0.09, 0.0012, -0.0009, 0.03)
VIEW = View(80, 60, 110.0, (41.3, 28.6), 150.0, DISTORTION)
POSES = [(0, 0), (0, 25), (30, -70), (60, 25), (75, 140), (-45, 10), (-80, 200), (89, 25)]


def bench_pose(exit_deg, azimuth_deg):
    """Rotation from the plate's axes to a camera's: rows right, down and forward, and the plate turned before."""
    e, a = np.radians([exit_deg, azimuth_deg])
    towards_camera = np.array([0.0, -np.sin(e), np.cos(e)])
    right = np.array([1.0, 0.0, 0.0])
    forward = -towards_camera
    turn = np.array([[np.cos(a), -np.sin(a), 0.0], [np.sin(a), np.cos(a), 0.0], [0.0, 0.0, 1.0]])
    return np.stack([right, np.cross(forward, right), forward]) @ turn


def project(points_mm, exit_deg, azimuth_deg, view):
    rotation, _ = cv2.Rodrigues(bench_pose(exit_deg, azimuth_deg))
    matrix = np.array([[view.focal_px, 0, view.centre_px[0]], [0, view.focal_px, view.centre_px[1]], [0, 0, 1.0]])
    pixels, _ = cv2.projectPoints(
        points_mm, rotation, np.array([0, 0, view.distance_mm]), matrix, np.array(view.distortion)
    )
    return pixels[:, 0]


@pytest.mark.parametrize("pose", POSES)
def test_pixels_see_the_places_that_opencv_projects_into_them(pose):
    x, y = VIEW.on_plate(*VIEW.centres, *pose)
    sees = np.isfinite(x)
    rows, columns = np.nonzero(sees)
    points = np.stack([x[sees], y[sees], np.zeros(sees.sum())], axis=-1)
    assert sees.sum() > 2000
    assert_allclose(project(points, *pose, VIEW), np.stack([columns, rows], axis=-1), atol=1e-6)


@pytest.mark.parametrize("pose", POSES)
def test_the_pose_is_that_of_the_bench(pose):
    rotation, translation = VIEW.pose(*pose)
    assert_allclose(rotation, bench_pose(*pose), atol=1e-12)
    assert_allclose(translation, [0, 0, 150])
    assert_allclose(np.linalg.det(rotation), 1.0)


def test_the_plate_is_upright_below_the_camera_and_foreshortens_with_the_arm():
    # a point to the right, and one towards the source, at a scale of 2 pixels a mm
    view = View(101, 101, 300.0, (50.0, 50.0), 150.0)
    points = np.array([[5.0, 0, 0], [0, 5.0, 0]])
    assert_allclose(project(points, 0, 0, view), [[60, 50], [50, 40]], atol=1e-9)
    x, y = view.on_plate(*view.centres, 0, 0)
    assert_allclose([x[50, 60], y[50, 60], x[40, 50], y[40, 50]], [5, 0, 0, 5], atol=1e-12)
    x, y = view.on_plate(*view.centres, 0, 90)
    # turned by 90 deg, the plate's x points towards the source
    assert_allclose([x[40, 50], y[40, 50]], [5, 0], atol=1e-12)
    for exit_deg in (-60, 60):
        _, y = view.on_plate(*view.centres, exit_deg, 0)
        # mm a pixel at the centre, by its two neighbours
        assert_allclose((y[49, 50] - y[51, 50]) / 2, 0.5 / np.cos(np.radians(60)), rtol=1e-3)


@pytest.mark.parametrize("pose", POSES)
@pytest.mark.parametrize("source_deg", [35, 60])
def test_directions_and_frames_follow_from_vectors(pose, source_deg):
    exit_deg, azimuth_deg = pose
    rotation = bench_pose(exit_deg, azimuth_deg)
    x, y = VIEW.on_plate(*VIEW.centres, exit_deg, azimuth_deg)
    ray = -VIEW.distance_mm * rotation[2] - np.stack([x, y, np.zeros_like(x)], axis=-1)
    ray /= np.linalg.norm(ray, axis=-1, keepdims=True)
    seen = np.isfinite(x)
    found = VIEW.directions(exit_deg)
    assert_allclose(np.cos(found.exit_rad)[seen], ray[..., 2][seen], atol=1e-12)
    # the source, in the axes of the turned plate
    a, t = np.radians([azimuth_deg, source_deg])
    source = np.array([np.sin(a) * np.sin(t), np.cos(a) * np.sin(t), np.cos(t)])
    expected = np.cos(t) * np.cos(found.exit_rad) + np.sin(t) * np.sin(found.exit_rad) * np.cos(found.azimuth_rad)
    assert_allclose(expected[seen], (ray @ source)[seen], atol=1e-12)
    # azimuth counts right-handed about the normal
    handed = np.cross(source, ray)[..., 2] / np.sin(t)
    assert_allclose((np.sin(found.exit_rad) * np.sin(found.azimuth_rad))[seen], handed[seen], atol=1e-12)
    own = np.cross([0, 0, 1.0], ray)
    own /= np.linalg.norm(own, axis=-1, keepdims=True)
    right = rotation[0] - (ray @ rotation[0])[..., None] * ray
    right /= np.linalg.norm(right, axis=-1, keepdims=True)
    angle = np.arctan2((own * np.cross(ray, right)).sum(-1), (own * right).sum(-1))
    assert_allclose(found.cos2[seen], np.cos(2 * angle)[seen], atol=1e-9)
    assert_allclose(found.sin2[seen], np.sin(2 * angle)[seen], atol=1e-9)


def test_frames_at_pixels_worked_out_by_hand():
    view = View(101, 101, 1000.0, (50.0, 50.0), 150.0)
    straight = view.directions(0)
    # From above s-directions run around the axis: at the upper right from upper left to lower right, which is -45 deg.
    assert_allclose([straight.cos2[10, 90], straight.sin2[10, 90]], [0, -1], atol=2e-3)
    assert_allclose([straight.cos2[10, 10], straight.sin2[10, 10]], [0, 1], atol=2e-3)
    # above the axis they run across the picture, beside it upwards
    assert_allclose([straight.cos2[10, 50], straight.cos2[50, 90]], [1, -1], atol=1e-12)
    # At 60 deg a point at the right sees the camera more to its left, so that its s-direction turns clockwise in the
    # picture, by tangent of the field angle over tan 60 deg.
    tilted = view.directions(60)
    for column in (10, 90):
        angle = 0.5 * np.arctan2(tilted.sin2[50, column], tilted.cos2[50, column])
        assert_allclose(angle, -(column - 50) / 1000 / np.tan(np.radians(60)), rtol=2e-3)
    assert tilted.sin2[50, 90] < 0 < tilted.sin2[50, 10]
    # in the plane of incidence nothing turns
    assert_allclose(tilted.cos2[:, 50], 1.0)


def test_light_of_the_rays_own_frame_is_turned_into_the_cameras():
    view = View(101, 101, 1000.0, (50.0, 50.0), 150.0)
    light = np.zeros((4, 101, 101))
    light[0], light[1], light[3] = 1.0, 0.5, 0.2
    seen = view.directions(0).in_camera_frame(light)
    # s-polarized in its own frame: along -45 deg at the upper right
    assert_allclose(seen[:, 10, 90], [1, 0, -0.5, 0.2], atol=2e-3)
    assert_allclose(seen[1] ** 2 + seen[2] ** 2, 0.25)


@pytest.mark.parametrize("coefficients", [DISTORTION, (0.3, 0, 0, 0, 0), (0, 0, 0.01, 0.02, 0), (0,) * 5])
def test_distortion_and_its_inverse_are_opencvs(coefficients):
    x, y = np.random.default_rng(5).uniform(-0.45, 0.45, (2, 200))
    rays = np.stack([x, y, np.ones(200)], axis=-1)
    expected, _ = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), np.eye(3), np.array(coefficients, float))
    there = distorted(x, y, coefficients)
    assert_allclose(np.stack(there, axis=-1), expected[:, 0], atol=1e-12)
    assert_allclose(undistorted(*there, coefficients), (x, y), atol=1e-12)


def test_a_distortion_that_folds_the_picture_is_refused():
    with pytest.raises(ValueError, match="folds the picture over"):
        View(80, 60, 60.0, (39.5, 29.5), 150.0, (-0.9, 0, 0, 0, 0))


def test_a_camera_without_pixels_is_refused():
    with pytest.raises(ValueError, match="above 0; given are 0, 60"):
        View(0, 60, 60.0, (39.5, 29.5), 150.0)


def test_points_within_a_pixel_lie_to_its_right_and_below():
    pixel = np.array([30 * 80 + 50])
    x, y = VIEW.within(pixel, np.array([0.5, -0.5, 0.0]), np.array([-0.5, 0.5, 0.0]))
    for found, corners, centres in zip((x, y), VIEW.corners, VIEW.centres, strict=True):
        # its upper right and its lower left corner, and its centre
        assert_allclose(found[0], [corners[30, 51], corners[31, 50], centres[30, 50]], atol=5e-6)
