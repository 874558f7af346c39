"""From which counts on a pixel is saturated, at any gain."""

from __future__ import annotations

import math


def saturated_from(saturation_counts: int, gain_db: float) -> int:
    """Counts as read from which on a pixel says nothing.

    Either the pixel is full or the converter ends. A lower gain does not make the pixel hold more charge, which then
    reads fewer counts; a higher one does not make the converter count further.

    Parameters
    ----------
    saturation_counts : int
        These counts at the gain 0 dB.
    gain_db : float
        Of the picture, above that gain.
    """
    return math.floor(saturation_counts * min(1.0, math.pow(10.0, gain_db / 20.0)))
