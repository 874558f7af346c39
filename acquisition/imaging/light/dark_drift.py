"""How far the black level of all pixels alike has moved, from dark picture to dark picture."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

_FAR = 3.0
"""In ranges of the middle half of the pixels; noise does not reach it, hot pixels and glints do."""

_STEP = 5.0
"""In read noises, of which a single step of the counts is 3.5 at most; that range is 0 where few pixels took one."""


class DarkDrift:
    """Black level over time, relative to its mean over the dark pictures.

    Parameters
    ----------
    times_s : sequence of float
        When the dark pictures were taken; those of one moment count as one, with their mean.
    counts : sequence of float
        Level of each in true counts, from wherever it is counted.
    """

    def __init__(self, times_s: Sequence[float], counts: Sequence[float]) -> None:
        self._times_s, of_time = np.unique(times_s, return_inverse=True)
        self._counts = np.bincount(of_time, counts) / np.bincount(of_time) - np.mean(counts)

    def counts(self, time_s: float) -> float:
        """What is to be added to the mean dark, on straight lines between dark pictures.

        A scan's first pictures may be taken before its first dark one, and its last behind the last. Up to there the
        level is taken to have moved as much as in the same time on the other side of that dark picture.
        """
        nearest_s = min(max(time_s, self._times_s[0]), self._times_s[-1])
        found, mirrored = np.interp([nearest_s, 2.0 * nearest_s - time_s], self._times_s, self._counts)
        return float(2.0 * found - mirrored)


def shift_counts(counts: NDArray[np.float32], first: NDArray[np.float32], read_counts: float) -> float:
    """By how much a dark picture is brighter than the first one: mean over all pixels but those that are far off.

    A median would be one of few values, because counts are whole; `read_counts` is the read noise. NaN where no pixel
    is known in both.
    """
    apart = counts - first
    apart = apart[np.isfinite(apart)]
    if not apart.size:
        return np.nan
    low, high = np.percentile(apart, (25.0, 75.0))
    reach = _FAR * (high - low) + max(_STEP * read_counts, 1.0)  # rounding alone moves by one count
    return float(apart.mean(where=np.abs(apart - (low + high) / 2.0) <= reach, dtype=np.float64))
