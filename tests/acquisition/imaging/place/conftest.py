"""Pictures of a plate with markers, drawn by following every ray back from the sensor to the plate."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cache

import cv2
import numpy as np
import pytest
from scipy.interpolate import RectBivariateSpline

from acquisition.imaging.place.holder import Holder
from acquisition.imaging.place.optics import Optics

MARKERS = {0: (-16.0, 11.0), 1: (16.0, 11.0), 2: (16.0, -11.0), 3: (-16.0, -11.0)}
MARKER_MM = 6.0
HOLDER = Holder("DICT_4X4_50", MARKER_MM, MARKERS)
CELLS = 40  # of the texture, to a mm
HALF_MM = 24.0
DISTANCE_MM = 300.0


@cache
def marker_cells(number):
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    return cv2.aruco.generateImageMarker(dictionary, number, 6) / 255.0


def plate(left=0.5, right=0.35, hidden=(), read_as=None, black=0.05, white=1.0, spots=True):
    """(rows, columns) of reflectance: two materials that meet at x = 0, dots as features, markers on white squares."""
    x = (np.arange(int(2 * HALF_MM * CELLS)) + 0.5) / CELLS - HALF_MM
    across, up = np.meshgrid(x, -x)
    drawn = np.full(across.shape, 0.1)
    inner = (abs(across) < 11.5) & (abs(up) < 14.0)
    drawn[inner & (across < 0)], drawn[inner & (across >= 0)] = left, right
    if spots:
        for spot_x in (-8.0, 8.0):
            for spot_y in (-9.0, 0.0, 9.0):
                drawn[np.hypot(across - spot_x, up - spot_y) < 1.5] = 0.12
    for number, (mark_x, mark_y) in MARKERS.items():
        if number in hidden:
            continue
        cells = marker_cells((read_as or {}).get(number, number))
        within = (abs(across - mark_x) < 4.0) & (abs(up - mark_y) < 4.0)
        drawn[within] = white
        column = np.floor((across[within] - mark_x) / MARKER_MM * 6 + 3).astype(int)
        row = np.floor((mark_y - up[within]) / MARKER_MM * 6 + 3).astype(int)
        black_square = (column >= 0) & (column < 6) & (row >= 0) & (row < 6)
        values = np.full(column.shape, white)
        values[black_square] = np.where(cells[row[black_square], column[black_square]] > 0.5, white, black)
        drawn[within] = values
    # Steps would be sampled as a staircase, which moves edges by a tenth of a camera's pixel.
    return cv2.GaussianBlur(drawn, (0, 0), 3.0)


@dataclass
class View:
    """A camera's place, independent of the code under test: by the camera's position and the direction of its right."""

    exit_deg: float
    azimuth_deg: float = 0.0
    optics: Optics = field(default_factory=lambda: Optics(1900.0, (160.3, 118.6)))
    size: tuple[int, int] = (320, 240)
    shift_px: tuple[float, float] = (0.0, 0.0)
    distance_mm: float = DISTANCE_MM

    def axes(self):
        """Right, up and towards the camera, each in plate coordinates."""
        e, a = np.radians(self.exit_deg), np.radians(self.azimuth_deg)

        def from_bench(v):  # the plate was turned by a about z, so its own coordinates turn back
            x, y, z = v
            return np.array([np.cos(a) * x + np.sin(a) * y, -np.sin(a) * x + np.cos(a) * y, z])

        return from_bench((1, 0, 0)), from_bench((0, np.cos(e), np.sin(e))), from_bench((0, -np.sin(e), np.cos(e)))

    def plate_mm(self, columns, rows):
        """Where rays through pixels meet the plate."""
        points = np.stack(np.broadcast_arrays(columns, rows), axis=-1).reshape(-1, 1, 2).astype(float)
        points = points - np.array(self.shift_px)
        camera = np.array(
            [
                [self.optics.focal_px, 0, self.optics.centre_px[0]],
                [0, self.optics.focal_px, self.optics.centre_px[1]],
                [0, 0, 1],
            ]
        )
        flat = cv2.undistortPoints(points, camera, np.array(self.optics.distortion)).reshape(-1, 2)
        right, up, back = self.axes()
        ray = flat[:, :1] * right - flat[:, 1:] * up - back
        eye = self.distance_mm * back
        reached = -eye[2] / ray[:, 2]
        return (eye + reached[:, None] * ray)[:, :2]

    def picture(self, drawn, fine=8, blur_px=0.5, noise=0.01, seed=0):
        """What the camera sees of a drawn plate."""
        width, height = self.size
        step = np.arange(1 / (2 * fine), 1, 1 / fine) - 0.5
        columns = (np.arange(width)[:, None] + step).ravel()
        rows = (np.arange(height)[:, None] + step).ravel()
        # The ray's foot changes smoothly: few are traced, and the rest lie between.
        coarse_c, coarse_r = (np.linspace(v[0], v[-1], len(v) // 60 + 4) for v in (columns, rows))
        feet = self.plate_mm(coarse_c[None, :], coarse_r[:, None]).reshape(len(coarse_r), len(coarse_c), 2)
        # OpenCV's own interpolation knows 32 places between two pixels only.
        x_mm, y_mm = (RectBivariateSpline(coarse_r, coarse_c, feet[..., k])(rows, columns) for k in (0, 1))
        column = ((x_mm + HALF_MM) * CELLS - 0.5).astype(np.float32)
        row = ((HALF_MM - y_mm) * CELLS - 0.5).astype(np.float32)
        light = cv2.remap(drawn.astype(np.float32), column, row, cv2.INTER_LINEAR, borderValue=0.08)
        light = light.reshape(height, fine, width, fine).mean(axis=(1, 3))
        if blur_px:
            light = cv2.GaussianBlur(light, (0, 0), blur_px)
        random = np.random.default_rng(seed)
        return light + noise * np.sqrt(np.maximum(light, 0) + 0.01) * random.standard_normal(light.shape)


@pytest.fixture(scope="session")
def drawing():
    """The names above, for tests beside this file."""
    import sys

    return sys.modules[__name__]
