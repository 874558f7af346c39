"""The pinhole camera on the detector arm: which point of the plate a pixel sees, and from which direction."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim_devices.camera.distortion import Coefficients, FloatArray, undistorted
from sim_devices.camera.layers import Boxes

Grid = NDArray[np.floating]


class Directions(NamedTuple):
    """Directions from the plate to the camera, a value a pixel, (height, width).

    Attributes
    ----------
    exit_rad : ndarray
        From the normal; pi/2 where a pixel looks past the horizon.
    azimuth_rad : ndarray
        From the bench's x-axis, which points towards the source, about the normal: 180 deg is the mirror side.
    cos2, sin2 : ndarray
        Of twice the angle, about the ray, from the camera's x-axis to that of the ray's own exit frame.
    """

    exit_rad: FloatArray
    azimuth_rad: FloatArray
    cos2: FloatArray
    sin2: FloatArray

    def in_camera_frame(self, stokes: FloatArray) -> FloatArray:
        """Stokes parameters (4, height, width) that referred to each ray's own frame."""
        s0, s1, s2, s3 = stokes
        return np.stack([s0, s1 * self.cos2 - s2 * self.sin2, s1 * self.sin2 + s2 * self.cos2, s3])


@dataclass(frozen=True)
class View:
    """A camera that looks at the middle of the sample plane from the detector arm.

    Its axes are x to the right, y down, z forward; at exit 0 its x is the plate's, and its y points away from the
    source.

    Parameters
    ----------
    width, height : int
        How many pixels there are.
    focal_px : float
        Focal length over the size of a pixel, which is square.
    centre_px : tuple of float
        Where the optical axis meets the picture, (column, row); whole numbers are centres of pixels.
    distance_mm : float
        From the projection centre to the middle of the plate.
    distortion : tuple of float
        k1, k2, p1, p2, k3 as OpenCV's `calib3d` has them.

    Raises
    ------
    ValueError
        If a number is out of range, or the distortion folds the picture over within the frame.
    """

    width: int
    height: int
    focal_px: float
    centre_px: tuple[float, float]
    distance_mm: float
    distortion: Coefficients = (0.0, 0.0, 0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        if min(self.width, self.height) < 1 or min(self.focal_px, self.distance_mm) <= 0.0:
            raise ValueError(
                f"a camera has width, height, focal_px and distance_mm above 0; given are {self.width}, {self.height}, "
                f"{self.focal_px:g}, {self.distance_mm:g}"
            )
        _ = self.corners

    @cached_property
    def corners(self) -> tuple[FloatArray, FloatArray]:
        """Tangents x/z and y/z of the rays through the pixels' corners, each (height + 1, width + 1)."""
        return self._tangents(np.arange(self.width + 1) - 0.5, np.arange(self.height + 1) - 0.5)

    @cached_property
    def centres(self) -> tuple[FloatArray, FloatArray]:
        """Tangents x/z and y/z of the rays through the pixels' centres, each (height, width)."""
        return self._tangents(np.arange(float(self.width)), np.arange(float(self.height)))

    def _tangents(self, columns: Grid, rows: Grid) -> tuple[FloatArray, FloatArray]:
        x, y = (columns - self.centre_px[0]) / self.focal_px, (rows - self.centre_px[1]) / self.focal_px
        grid_x, grid_y = np.meshgrid(x, y)
        return undistorted(grid_x, grid_y, self.distortion)

    def within(self, pixels: NDArray[np.intp], right: FloatArray, down: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Tangents of rays through points within pixels, each (pixels, points).

        Parameters
        ----------
        pixels : ndarray of int
            Which pixels, counted along the rows of the picture, (pixels,).
        right, down : ndarray
            The points, from -0.5 to 0.5 of a pixel from its centre, (points,). Between the corners of a pixel tangents
            are taken as bilinear; a strong distortion bends them by some 1e-4 of a pixel.
        """
        rows, columns = np.divmod(pixels, self.width)
        weights = [(0.5 + j * down) * (0.5 + i * right) for j in (-1, 1) for i in (-1, 1)]
        x, y = (
            sum(
                weight * tangents[rows + j, columns + i][:, None]
                for weight, (j, i) in zip(weights, ((0, 0), (0, 1), (1, 0), (1, 1)), strict=True)
            )
            for tangents in self.corners
        )
        return x, y

    def pose(self, exit_deg: float, azimuth_deg: float) -> tuple[FloatArray, FloatArray]:
        """Rotation (3, 3) and translation in mm (3,) from the plate's coordinates to the camera's."""
        sin_e, cos_e = _sin_cos(exit_deg)
        sin_a, cos_a = _sin_cos(azimuth_deg)
        arm = np.array([[1.0, 0.0, 0.0], [0.0, -cos_e, -sin_e], [0.0, sin_e, -cos_e]])
        turned = np.array([[cos_a, -sin_a, 0.0], [sin_a, cos_a, 0.0], [0.0, 0.0, 1.0]])
        return arm @ turned, np.array([0.0, 0.0, self.distance_mm])

    def on_plate(
        self, x: FloatArray, y: FloatArray, exit_deg: float, azimuth_deg: float
    ) -> tuple[FloatArray, FloatArray]:
        """Where rays with the tangents x and y meet the plate, in its coordinates in mm; NaN past the horizon.

        The exit angle is between -90 and 90 deg, without these.
        """
        sin_e, cos_e = _sin_cos(exit_deg)
        sin_a, cos_a = _sin_cos(azimuth_deg)
        sinking = y * sin_e + cos_e
        # how far along a ray (x, y, 1) the plate is
        far = self.distance_mm * cos_e / np.where(sinking > 0.0, sinking, np.nan)
        # along is -d sin e + far (sin e - y cos e), written without a difference
        across, along = x * far, -y * far / cos_e
        return cos_a * across + sin_a * along, cos_a * along - sin_a * across

    def boxes(self, exit_deg: float, azimuth_deg: float) -> Boxes:
        """What each pixel sees lies in these rectangles of the plate."""
        x, y = self.on_plate(*self.corners, exit_deg, azimuth_deg)
        past = np.isnan(x)
        horizon = _of_corners(np.logical_or, past) & ~_of_corners(np.logical_and, past)

        def span(values: FloatArray) -> tuple[FloatArray, FloatArray]:
            low, high = _of_corners(np.minimum, values), _of_corners(np.maximum, values)
            return np.where(horizon, -np.inf, low).ravel(), np.where(horizon, np.inf, high).ravel()

        return Boxes(*span(x), *span(y))

    def directions(self, exit_deg: float) -> Directions:
        """Whence each pixel's centre sees the plate."""
        sin_e, cos_e = _sin_cos(exit_deg)
        x, y = self.centres
        length = np.sqrt(x * x + y * y + 1.0)
        # the plate's axes at azimuth 0
        to_x, to_y, to_z = -x / length, (y * cos_e - sin_e) / length, (y * sin_e + cos_e) / length
        azimuth = np.arctan2(-to_x, to_y)
        exit_ = np.arctan2(np.hypot(to_x, to_y), np.maximum(to_z, 0.0))
        # the ray's own x-axis is (-cos, -sin, 0) of the azimuth, the camera's is (1, 0, 0) less its part along the ray
        cos_, sin_ = np.cos(azimuth), np.sin(azimuth)
        scale = 1.0 / (1.0 - to_x * to_x)
        sin2 = 2.0 * cos_ * sin_ * to_z * scale
        return Directions(exit_, azimuth, (cos_ * cos_ - (sin_ * to_z) ** 2) * scale, sin2)


def _sin_cos(angle_deg: float) -> tuple[float, float]:
    return math.sin(math.radians(angle_deg)), math.cos(math.radians(angle_deg))


def _of_corners(choose: np.ufunc, corners: NDArray[Any]) -> NDArray[Any]:
    rows = choose(corners[:-1], corners[1:])
    return np.asarray(choose(rows[:, :-1], rows[:, 1:]))
