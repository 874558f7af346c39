"""Whether a picture shows how far it is displaced in every direction."""

from __future__ import annotations

import numpy as np

from acquisition.imaging.place.half_pictures import WINDOW_SHARE, Halves

_MARGIN = 4.0
_MOST_MARGIN = 1.0 / 3.0


def evenness(halves: Halves, smooth_px: float) -> float:
    """Structure across the direction that has least of it, over that across the other: 1 if they are alike.

    A straight border through the whole picture has none along itself: how far it was displaced there is told by the
    picture's own margin alone, which stands still. Noise and the sensor's pattern are of one half only, and do not
    count in the products of slopes of one with those of the other.

    Parameters
    ----------
    halves : Halves
        The edges of a picture, of `half_edges`.
    smooth_px : float
        By how much it was smoothed.
    """
    inner = tuple(
        slice(margin, length - margin)
        for length in halves[0].shape
        for margin in [int(min(WINDOW_SHARE / 2.0 * length + _MARGIN * smooth_px, _MOST_MARGIN * length))]
    )
    black, white = (np.gradient(half[inner]) for half in halves)
    products = np.array([[float((one * other).mean(dtype=np.float64)) for other in white] for one in black])
    least, most = np.linalg.eigvalsh((products + products.T) / 2.0)
    return float(max(least, 0.0) / most) if most > 0.0 else 0.0
