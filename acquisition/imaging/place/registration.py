"""By how much pictures behind different positions of an analyzer are displaced: a wedge in a polarizer moves them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.fft import rfft2

from acquisition.imaging.place.displacement import by_ecc, by_phase
from acquisition.imaging.place.half_pictures import Halves, half_edges, without_dead
from acquisition.imaging.place.structure import evenness
from goniometer.errors import ReductionError

Map = NDArray[np.float64]
Method = Literal["ecc", "phase"]

_LEAST_CORRELATION = 0.25
"""Edges of noise alone correlate by less than 0.1, those of materials that all changed places by 0.35."""

_LARGEST_ERROR_PX = 0.15
"""Half of one difference scatters: the true error may be three times as large."""

_SMALL_ERROR_PX = 0.1
"""With such an error the light is not smoothed more, which lessens noise but takes time."""

_LEAST_EVENNESS = 0.02
"""Ten dots of 10 % beside a border of 100 % have 0.03, and the displacement along it is 0.1 pixels wrong."""

_SMOOTH_PX = (1.0, 2.0, 4.0)


@dataclass(frozen=True, eq=False)
class Shifts:
    """Displacements against the first picture.

    Parameters
    ----------
    shifts_px : ndarray
        (N, 2), column and row: what is at c in the first picture is at c + shift in another.
    correlations : ndarray
        (N,), of the pictures' edges after the displacement is undone: 1 where they are the same.
    stderr_px : ndarray
        (N,), root of the sum of both directions' squared standard errors.
    evenness : float
        Of the first picture's structure; see `evenness`.
    """

    shifts_px: NDArray[np.float64]
    correlations: NDArray[np.float64]
    stderr_px: NDArray[np.float64]
    evenness: float


def shifts(pictures: Sequence[NDArray[np.floating]], *, method: Method = "ecc", max_shift_px: float = 10.0) -> Shifts:
    """Measure displacements to hundredths of a pixel.

    What is compared is the steepness of the light, whatever its direction: materials whose light is polarized
    differently change places as the brighter one from one analyzer position to the next, but their border stays.

    It is measured twice, from halves of both pictures that share no pixel: the sensor's own pattern, which stands
    still, then has no part in it, and from the difference one knows the error. Where that is large, the light is
    smoothed more.

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
        When pictures share too little structure, or a displacement is not plausible.
    """
    lights, found = without_dead(pictures), []
    for smooth_px in _SMOOTH_PX:
        edges = (half_edges(light, known, smooth_px) for light, known in lights)
        found.append(_measured(edges, smooth_px, method, max_shift_px))
        if _is_known(found[-1], _SMALL_ERROR_PX):
            break
    best = min(found, key=lambda one: (not _is_correlated(one), float(np.square(one.stderr_px).sum())))
    _require_known(best)
    _require_plausible(best, max_shift_px)
    return best


def _measured(edges: Iterator[Halves], smooth_px: float, method: Method, max_shift_px: float) -> Shifts:
    halves = next(edges)
    waves = [rfft2(half) for half in halves]
    found = [(np.zeros(2), 1.0, 0.0)]
    for others in edges:
        # Never the same half of both: they have the pattern in common.
        pair = []
        for first, wave, other in zip(halves, waves, others[::-1], strict=True):
            shift, correlation = by_phase(wave, rfft2(other), first.shape[1], smooth_px, 2.0 * max_shift_px)
            if method == "ecc" and np.hypot(*shift) <= max_shift_px:
                shift, correlation = by_ecc(first, other, shift)
            pair.append((shift, correlation))
        (one, of_one), (two, of_two) = pair
        found.append(((one + two) / 2.0, min(of_one, of_two), float(np.hypot(*(one - two))) / 2.0))
    shifts_px, correlations, stderr_px = (np.array(column) for column in zip(*found, strict=True))
    return Shifts(shifts_px, correlations, stderr_px, evenness(halves, smooth_px))


def _is_correlated(found: Shifts) -> bool:
    return bool((found.correlations >= _LEAST_CORRELATION).all())


def _is_known(found: Shifts, error_px: float) -> bool:
    return _is_correlated(found) and bool((found.stderr_px <= error_px).all())


def _require_known(found: Shifts) -> None:
    for place, (correlation, stderr_px) in enumerate(zip(found.correlations, found.stderr_px, strict=True), start=1):
        if correlation >= _LEAST_CORRELATION and stderr_px <= _LARGEST_ERROR_PX:
            continue
        why = f"their edges correlate by {max(correlation, 0.0):.2f}, needed is {_LEAST_CORRELATION:g}"
        if correlation >= _LEAST_CORRELATION:
            why = f"the displacement is known to {stderr_px:.2f} pixels, at most {_LARGEST_ERROR_PX:g} is of use"
        raise ReductionError(
            f"Picture {place} of {len(found.stderr_px)} behind the analyzer shares too little structure with the "
            f"first: {why}. They were not brought into line, and this direction has no map. See that the "
            "light was on and the sample in focus; put markers or a pattern on or beside it; expose longer; name a "
            "flat of the sensor; or take registration out of the recipe."
        )
    if found.evenness < _LEAST_EVENNESS:
        raise ReductionError(
            "What the pictures behind the analyzer show lies along one direction, like a straight border: how far they "
            "are displaced along it cannot be seen. They were not brought into line, and this direction has no map. "
            "Put markers or a pattern on or beside the sample, or take registration out of the recipe."
        )


def _require_plausible(found: Shifts, max_shift_px: float) -> None:
    for place, shift in enumerate(found.shifts_px, start=1):
        if np.hypot(*shift) > max_shift_px:
            raise ReductionError(
                f"Picture {place} of {len(found.shifts_px)} behind the analyzer is displaced by {shift[0]:.2f}, "
                f"{shift[1]:.2f} pixels against the first, more than the {max_shift_px:g} that a polarizer's wedge is "
                "taken to cause. They were not brought into line. See that nothing moved between the pictures."
            )
