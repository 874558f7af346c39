"""Edges of a picture, seen twice: by the black and by the white squares of a checkerboard of pixels."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.signal.windows import tukey

from acquisition.imaging.place.gaps import without_gaps

Map = NDArray[np.float32]
Halves = tuple[Map, Map]

_SURROUNDINGS = 12
_GAP = 8
WINDOW_SHARE = 0.2
_STANDING_OUT = 8.0
_ABOUT_PX = 5


def without_dead(pictures: Sequence[NDArray[np.floating]]) -> list[tuple[Map, NDArray[np.bool_]]]:
    """Fill pixels that are not known, or stand out at the same place in all pictures.

    A dead pixel would be the steepest of all; a border in the scene goes on, and moves.

    Returns
    -------
    list of tuple
        Of each picture the light without NaN, and where it says something; see `without_gaps`.
    """
    lights = [np.asarray(picture, np.float32) for picture in pictures]
    squares = np.asarray(np.min([_standing_out(light) for light in lights], axis=0) > _STANDING_OUT)
    rows, columns = np.nonzero(squares)
    filled = []
    for light in lights:
        if len(rows):
            light = light.copy()
            for row, column in ((0, 0), (0, 1), (1, 0), (1, 1)):
                light[2 * rows + row, 2 * columns + column] = np.nan
        filled.append(without_gaps(light))
    return filled


def _standing_out(light: Map) -> Map:
    """By how much the diagonals of each two by two pixels differ, over how much they do about there."""
    import cv2

    height, width = (length // 2 * 2 for length in light.shape)
    (a, b), (c, d) = ((light[row:height:2, column:width:2] for column in (0, 1)) for row in (0, 1))
    difference = np.nan_to_num(np.abs(a + d - b - c))
    count = _ABOUT_PX**2
    others = (cv2.blur(difference, (_ABOUT_PX, _ABOUT_PX)) * np.float32(count) - difference) / np.float32(count - 1)
    return np.asarray(difference / np.maximum(others, np.float32(1e-30)), np.float32)


def half_edges(light: Map, known: NDArray[np.bool_], smooth_px: float) -> Halves:
    """Steepness above that of the surroundings, falling to 0 at the margin and in gaps, from each half of the pixels.

    How much more sensitive a pixel is than its neighbours stands still while the scene moves, but one half knows
    nothing of the other's pixels. A lens that vignettes is steep, too, and stands still, but is so in the surroundings.

    Parameters
    ----------
    light, known : ndarray
        Of `without_dead`.
    smooth_px : float
        The light is smoothed by so much, at least 1: the root of a sum of squares has finer detail than what it is
        made of, and the smoothed halves must not show the checkerboard.
    """
    import cv2

    height, width = light.shape
    # L of one half of the pixels is (L + L·c) / 2, with c that is 1 and -1 on the checkerboard.
    other = light.copy()
    other[::2, 1::2] *= -1
    other[1::2, ::2] *= -1
    slopes = []
    for plane in (light, other):
        smooth = cv2.GaussianBlur(plane, (0, 0), smooth_px)
        slopes.append([cv2.Sobel(smooth, cv2.CV_32F, *order, scale=0.125) for order in ((1, 0), (0, 1))])
    (across, down), (across_other, down_other) = slopes
    # Where smoothing and differences reach into a gap there is an edge that belongs to the gap.
    gap = (int(_GAP * smooth_px) + 1,) * 2
    whole = cv2.erode(known.astype(np.uint8), np.ones(gap, np.uint8)).astype(np.float32)
    about = (int(_SURROUNDINGS * smooth_px) + 1,) * 2
    share = np.maximum(cv2.blur(whole, about), np.float32(1e-6))
    window = whole * tukey(height, WINDOW_SHARE).astype(np.float32)[:, None]
    window *= tukey(width, WINDOW_SHARE).astype(np.float32)

    def edges(steepness: Map) -> Map:
        steepness *= whole
        steepness -= cv2.blur(steepness, about) / share
        steepness *= window
        return np.asarray(steepness / np.float32(max(float(np.abs(steepness).max()), 1e-30)), np.float32)

    return (
        edges(np.asarray(cv2.magnitude(across + across_other, down + down_other), np.float32)),
        edges(np.asarray(cv2.magnitude(across - across_other, down - down_other), np.float32)),
    )
