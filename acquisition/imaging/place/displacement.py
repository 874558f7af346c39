"""By how much one picture is displaced against another."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft2

Map = NDArray[np.float64]

_STEPS = 6
"""More move the result by less than 0.002 pixels: phase correlation begins near."""


def by_phase(one: Any, two: Any, width: int, smooth_px: float, reach_px: float) -> tuple[Map, float]:
    """The peak of the phase correlation of two pictures, refined on finer grids.

    Parameters
    ----------
    one, two : ndarray
        Their spectra, as `rfft2` makes them.
    width : int
        Of the pictures.
    smooth_px : float
        By how much they were smoothed: frequencies that this took away hold noise alone.
    reach_px : float
        Farther away, the sample's own pattern repeats itself.

    Returns
    -------
    shift : ndarray
        Column and row: what is at c in the first is at c + shift in the second.
    correlation : float
        The correlation coefficient there.
    """
    cross = np.conj(one) * two
    strength = np.abs(cross)
    if not strength.any():
        return np.zeros(2), 0.0
    height = len(cross)
    row, column = (np.asarray(of, np.float64) for of in (np.fft.fftfreq(height), np.fft.rfftfreq(width)))
    passed = [np.exp(-2.0 * (np.pi * smooth_px * of) ** 2).astype(np.float32) for of in (row, column)]
    strength += np.float32(0.01) * strength.mean()
    white = cross / strength
    white *= passed[0][:, None]
    white *= passed[1]
    rows, columns = np.abs(row * height) <= reach_px, np.abs(np.fft.fftfreq(width) * width) <= reach_px
    near = irfft2(white, s=(height, width))[np.ix_(rows, columns)]
    at_row, at_column = np.unravel_index(int(np.argmax(near)), near.shape)
    centre = [float((row * height)[rows][at_row]), float((np.fft.fftfreq(width) * width)[columns][at_column])]
    for step in (0.1, 0.01):
        offsets = step * np.arange(-15.0, 16.0)
        fine = _sums(white, centre[0] + offsets, centre[1] + offsets, row, column)
        at_row, at_column = np.unravel_index(int(np.argmax(fine)), fine.shape)
        centre = [centre[0] + offsets[at_row], centre[1] + offsets[at_column]]
    there = _sums(cross, np.array(centre[:1]), np.array(centre[1:]), row, column)[0, 0]
    whole = [_sums(np.abs(of) ** 2, np.zeros(1), np.zeros(1), row, column)[0, 0] for of in (one, two)]
    return np.array(centre[::-1]), float(there / np.sqrt(whole[0] * whole[1]))


def _sums(spectrum: Any, rows: Map, columns: Map, row: Map, column: Map) -> Map:
    """The picture of half a spectrum at places between pixels; the other half is its mirror image."""
    across = _waves(columns, column)
    across[:, 1:] *= 2
    return np.asarray((_waves(rows, row) @ spectrum @ across.T).real, np.float64)


def _waves(at: Map, frequencies: Map) -> Any:
    return np.exp(2j * np.pi * np.outer(at, frequencies)).astype(np.complex64)


def by_ecc(first: NDArray[np.float32], other: NDArray[np.float32], start: Map) -> tuple[Map, float]:
    """The same where the correlation coefficient of two pictures is largest, found by Gauss-Newton steps."""
    import cv2

    warp: Any = np.array([[1.0, 0.0, start[0]], [0.0, 1.0, start[1]]], np.float32)
    stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, _STEPS, 1e-6)
    mask: Any = None  # OpenCV takes it, and its type hints do not
    try:
        correlation, warp = cv2.findTransformECC(first, other, warp, cv2.MOTION_TRANSLATION, stop, mask, 1)
    except cv2.error:  # it does not converge: there is nothing in common
        return start, 0.0
    return np.asarray(warp[:, 2], np.float64), float(correlation)
