"""A picture moved by a part of a pixel."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from acquisition.imaging.light.signal_image import SignalImage

Map = NDArray[np.float32]


def shifted(image: SignalImage, column_px: float, row_px: float) -> SignalImage:
    """Bring back a picture in which everything is displaced, by linear interpolation.

    What comes from outside of the picture, or from a pixel of which nothing is known, is NaN. Neighbours then share
    noise, which the variances do not say.

    Parameters
    ----------
    image : SignalImage
        As the camera has it.
    column_px, row_px : float
        By how much what it shows is displaced, to the right and down.
    """
    if column_px == row_px == 0.0:
        return image
    whole_column, whole_row = math.floor(column_px), math.floor(row_px)
    right, down = column_px - whole_column, row_px - whole_row
    signal, variance = np.zeros_like(image.signal), np.zeros_like(image.variance)
    for row, row_share in ((whole_row, 1.0 - down), (whole_row + 1, down)):
        for column, column_share in ((whole_column, 1.0 - right), (whole_column + 1, right)):
            share = np.float32(row_share * column_share)
            if share:
                signal += share * _from(image.signal, column, row)
                variance += share**2 * _from(image.variance, column, row)
    return SignalImage(signal, variance, image.notes)


def _from(plane: Map, column: int, row: int) -> Map:
    """What stands so many pixels to the right and below, everywhere."""
    height, width = plane.shape
    moved = np.full_like(plane, np.nan)
    rows, columns = slice(max(-row, 0), min(height - row, height)), slice(max(-column, 0), min(width - column, width))
    of_rows = slice(max(row, 0), min(height + row, height))
    of_columns = slice(max(column, 0), min(width + column, width))
    if rows.start < rows.stop and columns.start < columns.stop:
        moved[rows, columns] = plane[of_rows, of_columns]
    return moved
