"""Markers in rendered pictures are found where they are."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from sim_devices.camera.optics import Blur
from sim_devices.camera.plate import Plate
from sim_devices.camera.render import Renderer
from sim_devices.camera.view import View
from sim_devices.sample import Sample

cv2 = pytest.importorskip("cv2")

AT_MM = {0: (-24.0, 15.0), 11: (24.0, 15.0), 23: (-24.0, -15.0), 42: (24.0, -15.0)}
SAMPLE = Sample(material="Fe", sigma=0.17, rho_s=1.0, rho_d=0.2, rho_dd=0.0)
PLATE = Plate.model_validate(
    {
        "size_mm": [64, 46],
        "markers": {"dictionary": "4x4_50", "size_mm": 9, "at_mm": {k: list(v) for k, v in AT_MM.items()}},
    }
)
# large, because markers shrink to a few pixels at grazing exits
VIEW = View(640, 480, 1000.0, (322.4, 236.8), 120.0, (-0.1, 0.05, 0.001, -0.0008, 0.0))
FINE = View(1280, 960, 2000.0, (645.3, 474.1), 120.0, VIEW.distortion)
LENS = Blur(effect="blur", sigma_px=0.7)


def detect(picture):
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    parameters.cornerRefinementWinSize = 4
    parameters.relativeCornerRefinmentWinSize = 0.5
    detector = cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50), parameters)
    corners, numbers, _ = detector.detectMarkers(picture)
    return {int(number): place[0] for number, place in zip(np.ravel(numbers), corners, strict=True)}


def projected(points_mm, exit_deg, azimuth_deg, view):
    e, a = np.radians([exit_deg, azimuth_deg])
    arm = np.array([[1, 0, 0], [0, -np.cos(e), -np.sin(e)], [0, np.sin(e), -np.cos(e)]])
    turn = np.array([[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1]])
    matrix = np.array([[view.focal_px, 0, view.centre_px[0]], [0, view.focal_px, view.centre_px[1]], [0, 0, 1]])
    rotation, _ = cv2.Rodrigues(arm @ turn)
    pixels, _ = cv2.projectPoints(points_mm, rotation, np.array([0, 0, 120.0]), matrix, np.array(view.distortion))
    return pixels[:, 0]


@pytest.mark.parametrize("azimuth_deg", [0, 25])
@pytest.mark.parametrize("exit_deg", [0, 30, 60, 75])
def test_markers_are_found_where_they_are(exit_deg, azimuth_deg):
    # the detector needs more pixels where a marker's corners have become acute
    view = FINE if (exit_deg, azimuth_deg) == (75, 25) else VIEW
    seen = LENS.on(Renderer(PLATE.load(Path(), SAMPLE), view, 550.0).stokes(60, exit_deg, azimuth_deg)[0], view)
    # exposed for the paper: all that is brighter is white too, and no edge
    found = detect(np.clip(seen / 0.25 * 255, 0, 255).astype(np.uint8))
    corners_mm = np.array([[-4.5, 4.5, 0], [4.5, 4.5, 0], [4.5, -4.5, 0], [-4.5, -4.5, 0]])
    expected = {
        number: projected(corners_mm + np.array([x, y, 0.0]), exit_deg, azimuth_deg, view)
        for number, (x, y) in AT_MM.items()
    }
    last = np.array([view.width, view.height]) - 16
    whole = {number for number, at in expected.items() if ((at > 16) & (at < last)).all()}
    assert whole <= set(found)
    assert len(whole) >= 2
    for number in whole:
        assert_allclose(found[number].mean(axis=0), expected[number].mean(axis=0), atol=0.1)


def test_paper_and_ink_are_lambertian():
    view = View(41, 41, 2000.0, (20.0, 20.0), 120.0)
    markers = {"dictionary": "5x5_100", "size_mm": 7.0, "at_mm": {3: [0, 0]}, "white": 0.7, "black": 0.1}
    layout = Plate.model_validate({"size_mm": [20, 20], "markers": markers}).load(Path(), SAMPLE)
    seen = Renderer(layout, view, 550.0).stokes(60, 30, 0)
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_100)
    middle = dictionary.generateImageMarker(3, 7)[3, 3] > 0
    assert_allclose(seen[:, 20, 20], [(0.7 if middle else 0.1) / np.pi, 0, 0, 0], rtol=1e-6)
    assert not seen[1:].any()
