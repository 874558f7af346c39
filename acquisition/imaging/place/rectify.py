"""Pictures in the sample's own coordinates."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from acquisition.imaging.light.signal_image import SignalImage
from acquisition.imaging.place.map_grid import MapGrid
from acquisition.imaging.place.optics import Optics
from acquisition.imaging.place.pose import Pose

_BAND_SAMPLES = 1 << 18


def rectified(
    image: SignalImage, pose: Pose, optics: Optics, grid: MapGrid, shift_px: tuple[float, float] = (0.0, 0.0)
) -> SignalImage:
    """Resample a picture onto a map, once for perspective, distortion and shift together.

    A map pixel is the mean of bilinear samples so dense that no camera pixel within it is passed over. Neighbours in
    the map share camera pixels, so that their errors are correlated, which the variances do not say.

    Parameters
    ----------
    image : SignalImage
        As the camera has it.
    pose : Pose
        How the plate stands before the camera.
    optics : Optics
        The camera's.
    grid : MapGrid
        Of the map.
    shift_px : tuple of float
        By how much what is in this picture is displaced from where the pose has it, column and row.

    Returns
    -------
    SignalImage
        Of the grid's size; NaN outside of the picture and where any pixel that would contribute is NaN.
    """
    signal, variance = (np.asarray(part, np.float64).ravel() for part in (image.signal, image.variance))
    unknown = (np.isnan(signal) | np.isnan(variance)).astype(np.float64)
    signal, variance = np.nan_to_num(signal), np.nan_to_num(variance)
    found = np.empty((2, grid.height, grid.width), np.float32)
    across, along = samples_a_pixel(pose, optics, grid)
    rows = max(1, _BAND_SAMPLES // (grid.width * across * along))
    for start in range(0, grid.height, rows):
        band = slice(start, min(start + rows, grid.height))
        weights, inside = _weights(pose, optics, grid, band, (across, along), shift_px, image.signal.shape)
        good = inside & (weights @ unknown == 0.0)
        squared = weights.copy()
        squared.data **= 2
        for place, values in enumerate((weights @ signal, squared @ variance)):
            found[place, band] = np.where(good, values, np.nan).reshape(-1, grid.width)
    return SignalImage(found[0], found[1])


def samples_a_pixel(pose: Pose, optics: Optics, grid: MapGrid) -> tuple[int, int]:
    """How many samples a map pixel needs along x and along y, so that they lie at most a camera pixel apart."""
    x, y = grid.x_mm()[[0, -1]], grid.y_mm()[[0, -1]]
    step = grid.pixel_mm / 2
    counts = []
    for dx, dy in ((step, 0.0), (0.0, step)):
        x_corner, y_corner = np.meshgrid(x, y)
        moved = pose.pixels(x_corner + dx, y_corner + dy, optics) - pose.pixels(x_corner - dx, y_corner - dy, optics)
        farthest = np.nanmax(np.linalg.norm(moved, axis=-1), initial=0.0)
        counts.append(max(1, math.ceil(float(farthest) - 1e-6)))
    return counts[0], counts[1]


def _weights(
    pose: Pose,
    optics: Optics,
    grid: MapGrid,
    band: slice,
    samples: tuple[int, int],
    shift_px: tuple[float, float],
    size: tuple[int, ...],
) -> tuple[csr_array, NDArray[np.bool_]]:
    """How camera pixels (columns) make up map pixels (rows), and which of them lie wholly within the picture."""
    height, width = size
    off_x, off_y = (grid.pixel_mm * ((np.arange(count) + 0.5) / count - 0.5) for count in samples)
    x = grid.x_mm()[None, :, None, None] + off_x
    y = grid.y_mm()[band][:, None, None, None] + off_y[:, None]
    where = pose.pixels(x, y, optics) + np.array(shift_px)
    where = where.reshape(-1, len(off_x) * len(off_y), 2)
    with np.errstate(invalid="ignore"):
        inside = ((where >= 0.0) & (where <= (width - 1, height - 1))).all(axis=(1, 2))
    where[~inside] = 0.0
    corner = np.minimum(where.astype(np.int32), (width - 2, height - 2))
    right, down = np.moveaxis(where - corner, -1, 0)
    first = corner[..., 1] * width + corner[..., 0]
    pixels = np.stack((first, first + 1, first + width, first + width + 1), axis=-1)
    shares = np.stack(((1.0 - right) * (1.0 - down), right * (1.0 - down), (1.0 - right) * down, right * down), axis=-1)
    each = pixels[0].size
    ends = np.arange(0, pixels.size + 1, each)
    weights = csr_array((shares.ravel() * (4.0 / each), pixels.ravel(), ends), shape=(len(where), height * width))
    if each > 4:
        weights.sum_duplicates()
    return weights, inside
