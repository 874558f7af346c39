"""By how much pictures behind different positions of an analyzer are displaced: a wedge in a polarizer moves them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.fft import fft2, ifft2
from scipy.signal.windows import tukey

from acquisition.imaging.place.gaps import without_gaps
from goniometer.errors import ReductionError

Map = NDArray[np.float64]
Method = Literal["ecc", "phase"]

_LEAST_CORRELATION = 0.25
"""Edges of noise alone correlate by less than 0.1, those of materials that all changed places by 0.35."""

_SMOOTH_PX = 1.0
_GAP_PX = 9
_WINDOW_SHARE = 0.2


@dataclass(frozen=True, eq=False)
class Shifts:
    """Displacements against the first picture.

    Parameters
    ----------
    shifts_px : ndarray
        (N, 2), column and row: what is at c in the first picture is at c + shift in another.
    correlations : ndarray
        (N,), of the pictures' edges after the displacement is undone: 1 where they are the same.
    """

    shifts_px: NDArray[np.float64]
    correlations: NDArray[np.float64]


def shifts(pictures: Sequence[NDArray[np.floating]], *, method: Method = "ecc", max_shift_px: float = 10.0) -> Shifts:
    """Measure displacements to hundredths of a pixel.

    What is compared is the steepness of the light, whatever its direction: materials whose light is polarized
    differently change places as the brighter one from one analyzer position to the next, but their border stays.

    Parameters
    ----------
    pictures : sequence of ndarray
        (height, width) each, light in any unit; NaN where it is not known.
    method : {"ecc", "phase"}
        Correlation coefficient, maximized by Gauss-Newton steps (Evangelidis and Psarakis 2008), from where phase
        correlation begins; or phase correlation alone, its peak refined on a finer grid (Guizar-Sicairos et al. 2008).
    max_shift_px : float
        Larger ones are not plausible.

    Raises
    ------
    ReductionError
        When pictures share no structure, or a displacement is not plausible.
    """
    edges = [_edges(picture) for picture in pictures]
    waves = fft2(edges[0])
    found = [(np.zeros(2), 1.0)]
    for place, other in enumerate(edges[1:], start=2):
        shift, correlation = _by_phase(waves, fft2(other), 2.0 * max_shift_px)
        if method == "ecc" and np.hypot(*shift) <= max_shift_px:
            shift, correlation = _by_ecc(edges[0], other, shift)
        _require_plausible(place, len(edges), shift, correlation, max_shift_px)
        found.append((shift, correlation))
    return Shifts(np.array([shift for shift, _ in found]), np.array([correlation for _, correlation in found]))


def _edges(picture: NDArray[np.floating]) -> Map:
    """Steepness above that of most pixels, falling to 0 at the margin and in gaps.

    The light is smoothed before, because the root of a sum of squares has finer detail than what it is made of.
    """
    import cv2

    light, known = without_gaps(np.asarray(picture, np.float32))
    smooth = cv2.GaussianBlur(light.astype(np.float64), (0, 0), _SMOOTH_PX)
    across, down = (cv2.Sobel(smooth, cv2.CV_64F, *order, scale=0.125) for order in ((1, 0), (0, 1)))
    steepness = np.hypot(across, down)
    # Where smoothing and differences reach into a gap there is an edge that belongs to the gap.
    whole = cv2.erode(known.astype(np.uint8), np.ones((_GAP_PX, _GAP_PX), np.uint8)) > 0
    if not whole.any():
        return np.zeros(steepness.shape, np.float32)
    height, width = steepness.shape
    window = np.outer(tukey(height, _WINDOW_SHARE), tukey(width, _WINDOW_SHARE))
    edges = np.where(whole, steepness - np.median(steepness[whole]), 0.0) * window
    return np.asarray(edges / max(float(np.abs(edges).max()), 1e-30), np.float32)


def _by_phase(one: Any, two: Any, reach_px: float) -> tuple[Map, float]:
    """The peak of the phase correlation of two pictures' spectra, and the correlation coefficient there."""
    cross = np.conj(one) * two
    strength = np.abs(cross)
    if not strength.any():
        return np.zeros(2), 0.0
    row, column = (np.asarray(np.fft.fftfreq(length), np.float64) for length in cross.shape)
    # Frequencies that smoothing took away hold noise alone.
    passed = np.outer(*(np.exp(-2.0 * (np.pi * _SMOOTH_PX * of) ** 2) for of in (row, column))).astype(np.float32)
    white = passed * cross / (strength + 0.01 * strength.mean())
    # Farther away, the sample's own pattern repeats itself.
    near = np.abs(row[:, None] * len(row)) <= reach_px, np.abs(column * len(column)) <= reach_px
    peak = np.unravel_index(int(np.argmax(np.where(near[0] & near[1], ifft2(white).real, -np.inf))), cross.shape)
    centre = [(at + size // 2) % size - size // 2 for at, size in zip(peak, cross.shape, strict=True)]
    for step in (0.1, 0.01):
        offsets = step * np.arange(-15, 16)
        rows, columns = centre[0] + offsets, centre[1] + offsets
        fine = _waves(rows, row) @ white @ _waves(columns, column).T
        at_row, at_column = np.unravel_index(int(np.argmax(fine.real)), fine.shape)
        centre = [rows[at_row], columns[at_column]]
    there = _waves(np.array(centre[:1]), row) @ cross @ _waves(np.array(centre[1:]), column).T
    correlation = float(there.real[0, 0]) / float(np.linalg.norm(one) * np.linalg.norm(two))
    return np.array(centre[::-1]), correlation


def _waves(at: Map, frequencies: Map) -> Any:
    return np.asarray(np.exp(2j * np.pi * np.outer(at, frequencies)))


def _by_ecc(first: Map, other: Map, start: Map) -> tuple[Map, float]:
    import cv2

    warp: Any = np.array([[1.0, 0.0, start[0]], [0.0, 1.0, start[1]]], np.float32)
    stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 100, 1e-7)
    mask: Any = None  # OpenCV takes it, and its type hints do not
    try:
        correlation, warp = cv2.findTransformECC(first, other, warp, cv2.MOTION_TRANSLATION, stop, mask, 1)
    except cv2.error:  # it does not converge: there is nothing in common
        return start, 0.0
    return np.asarray(warp[:, 2], np.float64), float(correlation)


def _require_plausible(place: int, count: int, shift: Map, correlation: float, max_shift_px: float) -> None:
    if not correlation >= _LEAST_CORRELATION:
        raise ReductionError(
            f"Picture {place} of {count} behind the analyzer shares no structure with the first: their edges correlate "
            f"by {max(correlation, 0.0):.2f}, needed is {_LEAST_CORRELATION:g}. They were not brought into line. See "
            "that the light was on and the sample or its markers in focus, expose longer, or leave registration out."
        )
    if np.hypot(*shift) > max_shift_px:
        raise ReductionError(
            f"Picture {place} of {count} behind the analyzer is displaced by {shift[0]:.2f}, {shift[1]:.2f} pixels "
            f"against the first, more than the {max_shift_px:g} that a polarizer's wedge is taken to cause. They were "
            "not brought into line. See that nothing moved between the pictures."
        )
