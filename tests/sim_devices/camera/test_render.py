"""Stokes images of a plate, against the model seen along vectors written down from the bench."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from model.geometry import in_plane
from model.lobes import Diffuse, Specular
from model.surface import Surface
from sim_devices.camera.coverage import coverage
from sim_devices.camera.plate import Plate
from sim_devices.camera.render import Renderer
from sim_devices.camera.view import View
from sim_devices.sample import Sample

HERE = Path()
ROUGH = {"index": {"n": 1.5, "k": 0.0}, "sigma": 0.17, "rho_s": 1.0, "rho_d": 0.2, "rho_dd": 0.0}
METAL = {"index": {"n": 2.95, "k": 2.93}, "sigma": 0.25, "rho_s": 0.6, "rho_d": 0.3, "rho_dd": 0.0}
SURFACE = Surface([Specular(1.0, 0.17, 1.5 + 0j), Diffuse(0.2, 0.17)])
DISTORTION = (-0.1, 0.02, 0.001, -0.0005, 0.0)
VIEW = View(81, 61, 160.0, (40.0, 30.0), 120.0, DISTORTION)


def plate(**sections):
    return Plate.model_validate({"size_mm": [60, 40], **sections}).load(HERE, Sample(**ROUGH))


def rays(view, exit_deg):
    """Directions to the camera in the plate's axes at azimuth 0."""
    e = np.radians(exit_deg)
    x, y = view.centres
    right, down, forward = np.array([[1, 0, 0], [0, -np.cos(e), -np.sin(e)], [0, np.sin(e), -np.cos(e)]])
    ray = -(x[..., None] * right + y[..., None] * down + forward)
    return ray / np.linalg.norm(ray, axis=-1, keepdims=True), right


@pytest.mark.parametrize("incidence_deg", [20, 60])
@pytest.mark.parametrize("exit_deg", [-50, 0, 30, 60, 80])
@pytest.mark.parametrize("azimuth_deg", [0, 25])
def test_the_centre_sees_what_the_model_says_for_the_arms(incidence_deg, exit_deg, azimuth_deg):
    seen = Renderer(plate(), VIEW, 550.0).stokes(incidence_deg, exit_deg, azimuth_deg)
    exit_rad, azimuth_rad = in_plane(np.radians(exit_deg))
    expected = SURFACE.stokes(np.radians(incidence_deg), exit_rad, azimuth_rad)
    assert seen.shape == (4, 61, 81)
    assert seen.dtype == np.float32
    assert_allclose(seen[:, 30, 40], expected, rtol=1e-5, atol=1e-7)


@pytest.mark.parametrize("exit_deg", [-10, 0, 25, 60])
def test_light_is_polarized_across_the_plane_of_both_rays(exit_deg):
    # Facets mirror unpolarized light into a polarization along source x ray, and all else depolarizes.
    layout = Plate(size_mm=(400.0, 400.0)).load(HERE, Sample(**ROUGH))
    s0, s1, s2, s3 = Renderer(layout, VIEW, 550.0).stokes(40, exit_deg, 25).astype(float)
    ray, right = rays(VIEW, exit_deg)
    t = np.radians(40)
    source = np.array([0, np.sin(t), np.cos(t)])
    across = np.cross(source, ray)
    x = right - (ray @ right)[..., None] * ray
    aolp = np.arctan2((across * np.cross(ray, x)).sum(-1), (across * x).sum(-1))
    # the model's DoLP for the angle between the rays and the angles to the normal
    phi = np.arctan2(np.cross(source, ray)[..., 2], ray[..., 1] * np.sin(t))
    expected = SURFACE.stokes(t, np.arccos(ray[..., 2]), phi)
    dolp = np.hypot(expected[..., 1], expected[..., 2]) / expected[..., 0]
    assert dolp.max() > 0.01
    assert np.ptp(aolp) > 0.1
    assert_allclose(s0, expected[..., 0], rtol=1e-6)
    assert_allclose(s1 / s0, dolp * np.cos(2 * aolp), atol=1e-6)
    assert_allclose(s2 / s0, dolp * np.sin(2 * aolp), atol=1e-6)
    assert_allclose(s3, 0, atol=1e-7)


@pytest.mark.parametrize("exit_deg", [10, 50])
def test_the_angle_of_polarization_across_the_picture_by_hand(exit_deg):
    # With i = (0, sin ti, cos ti) and a ray q = (-x, -sin e, cos e) from a place at the right, i x q has the part
    # sin(ti + e) to the right and -x cos(ti + e) upwards in the picture: clockwise until ti + e is a right angle.
    view = View(81, 61, 160.0, (40.0, 30.0), 120.0)
    s0, s1, s2, _ = Renderer(plate(), view, 550.0).stokes(60, exit_deg, 0)
    for column in (32, 48):
        aolp = 0.5 * np.arctan2(s2[30, column], s1[30, column])
        expected = -(column - 40) / 160 / np.tan(np.radians(60 + exit_deg))
        assert_allclose(aolp, expected, rtol=0.01)
    assert (s2[30, 48] < 0) == (exit_deg == 10)
    assert s1[30, 40] > 0.02 * s0[30, 40]
    assert_allclose(s2[30, 40], 0, atol=1e-7)


def test_a_source_arm_on_the_other_side_is_the_bench_turned_round():
    renderer = Renderer(plate(patches=[{"rectangle_mm": [-15, -5, 4, 12], **METAL}]), VIEW, 550.0)
    there, back = renderer.stokes(-50, -20, 0), Renderer(renderer.layout, VIEW, 550.0).stokes(50, 20, 180)
    assert_allclose(there[:, 30, 40], back[:, 30, 40], rtol=1e-5, atol=1e-8)
    assert not np.allclose(renderer.stokes(50, -20, 0)[0], there[0])


def test_two_materials_are_polarized_as_each_is_and_mix_only_at_their_edge():
    layout = plate(patches=[{"rectangle_mm": [0.0, -20, 30, 20], **METAL}])
    s0, s1, _, _ = Renderer(layout, VIEW, 550.0).stokes(60, 45, 0).astype(float)
    pure = [
        Renderer(Plate(size_mm=(60.0, 40.0)).load(HERE, Sample(**kind)), VIEW, 550.0).stokes(60, 45, 0)
        for kind in (ROUGH, METAL)
    ]
    assert_array_equal(s0[28:33, 20:40], pure[0][0][28:33, 20:40])
    assert_array_equal(s0[28:33, 41:60], pure[1][0][28:33, 41:60])
    assert_array_equal(s1[28:33, 41:60], pure[1][1][28:33, 41:60])
    # the edge goes through the middle of column 40 of the middle row
    assert_allclose(s0[30, 40], (pure[0][0] + pure[1][0])[30, 40] / 2, rtol=0.02)
    dolp = [kind[1, 30, 40] / kind[0, 30, 40] for kind in pure]
    assert abs(dolp[0] - dolp[1]) > 0.1


def test_light_is_the_same_at_two_resolutions():
    sections = {
        "patches": [{"rectangle_mm": [-14, -9, 3, 11], **METAL}, {"disk_mm": [8, 2, 7.5], **METAL, "rho_d": 0.8}],
        "markers": {"dictionary": "4x4_50", "size_mm": 6, "at_mm": {7: [-24, 14], 1: [24, -14]}},
    }
    fine = View(162, 122, 320.0, (80.5, 60.5), 120.0, DISTORTION)
    for exit_deg in (20, 78, -60):
        coarse_seen = Renderer(plate(**sections), VIEW, 550.0).stokes(60, exit_deg, 25)
        fine_seen = Renderer(plate(**sections), fine, 550.0).stokes(60, exit_deg, 25)
        joined = fine_seen.reshape(4, 61, 2, 81, 2).mean(axis=(2, 4))
        assert_allclose(joined[:2].sum(axis=(1, 2)), coarse_seen[:2].sum(axis=(1, 2)), rtol=1e-3)
        assert_allclose(joined, coarse_seen, atol=0.02 * coarse_seen.max())


@pytest.mark.parametrize("azimuth_deg", [0, 25])
def test_inks_cover_the_area_that_they_have(azimuth_deg):
    # 2 pixels a mm, seen from above
    view = View(140, 120, 300.0, (69.3, 59.6), 150.0)
    layout = plate(
        patches=[{"rectangle_mm": [-15, -6, 4.37, 11.1], **METAL}, {"disk_mm": [13, -5, 7.1], **METAL, "rho_d": 0.5}]
    )
    seen = coverage(layout, view, view.boxes(0, azimuth_deg), 0, azimuth_deg)
    metal, disk = (np.bincount(seen.of(ink)[0], seen.of(ink)[1], 140 * 120) for ink in (2, 3))
    assert_allclose(metal.sum(), 4 * 19.37 * 17.1, rtol=2e-4)
    assert_allclose(disk.sum(), 4 * np.pi * 7.1**2, rtol=1e-3)
    total = sum(np.bincount(*seen.of(ink), 140 * 120) for ink in range(4))
    assert_allclose(total, 1.0)
    assert len(seen.mixed) < 900
    if azimuth_deg == 0:
        row = metal.reshape(120, 140)[60]
        # the edges along a row, to the spacing of the samples
        assert_allclose(row[50:].sum(), 69.3 + 2 * 4.37 - 49.5, atol=0.003)
        assert_allclose(row[:50].sum(), 49.5 - (69.3 - 2 * 15), atol=0.003)


def test_thin_lines_keep_their_light():
    # a tenth of a pixel wide, between the pixels' centres and corners
    view = View(60, 40, 300.0, (29.5, 19.5), 150.0)
    layout = plate(patches=[{"rectangle_mm": [1.1, -5, 1.15, 5], **METAL}])
    seen = coverage(layout, view, view.boxes(0, 0), 0, 0)
    _, shares = seen.of(2)
    assert_allclose(shares.sum(), 0.1 * 20, rtol=0.13)


def test_around_the_plate_is_darkness_and_below_it_too():
    renderer = Renderer(plate(), VIEW, 550.0)
    seen = renderer.stokes(60, 0, 0)
    assert (seen[0, 0] == 0).all()
    assert (seen[0, 30, 1:-1] > 0).all()
    for arms in ((60, 90, 0), (60, 120, 0), (60, -95, 0), (90, 10, 0), (-100, 10, 0)):
        assert not renderer.stokes(*arms).any()
    assert_array_equal(renderer.stokes(60, 390, 0), renderer.stokes(60, 30, 0))
    wide = Renderer(Plate(size_mm=(900.0, 900.0)).load(HERE, Sample(**ROUGH)), VIEW, 550.0)
    assert not wide.stokes(60, 93, 0).any()


@pytest.mark.parametrize("exit_deg", [89, -89, 85])
def test_grazing_views_reach_over_the_horizon(exit_deg):
    seen = Renderer(plate(), VIEW, 550.0).stokes(60, exit_deg, 25)
    assert np.isfinite(seen).all()
    assert seen[0].max() > 1e-3
    assert (seen[0] >= 0).all()
    assert not seen[:, :10].any()
    # the plate is 60 x 40 mm, foreshortened: at 89 deg one or two rows of pixels
    assert (seen[0].max(axis=1) > 0).sum() <= (5 if abs(exit_deg) == 89 else 15)


def test_polarized_lamps_are_seen_through_the_model():
    lamp = [1.0, 0.3, -0.2, 0.1]
    seen = Renderer(plate(), VIEW, 550.0, lamp).stokes(60, 50, 0)
    expected = SURFACE.stokes(np.radians(60), np.radians(50), np.pi, lamp)
    assert_allclose(seen[:, 30, 40], expected, rtol=1e-5)


def test_a_pose_is_rendered_once():
    renderer = Renderer(plate(), VIEW, 550.0)
    first = renderer.stokes(60, 30, 0)
    assert renderer.stokes(60, 30, 0) is first
    assert not first.flags.writeable
    assert renderer.stokes(60, 31, 0) is not first
