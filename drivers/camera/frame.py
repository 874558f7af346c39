"""One picture of a camera, and what is known of how it was taken."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Frame:
    """Counts of every pixel.

    Parameters
    ----------
    counts : ndarray
        (height, width) of uint16, whatever the number of bits; row 0 is the upper one.
    bits : int
        Of the counts: the largest that there can be is 2**bits - 1.
    exposure_s : float
        How long light was collected.
    gain_db : float
        The amplifier's, as set.
    time_s : float
        When the exposure began, on the bench's clock.
    number : int or None
        As the camera counts its frames; None where it does not say.
    averaged : int
        How many pictures, of `exposure_s` each, the counts are the mean of.
    """

    counts: NDArray[np.uint16]
    bits: int
    exposure_s: float
    gain_db: float
    time_s: float
    number: int | None = None
    averaged: int = 1

    @property
    def largest_counts(self) -> int:
        """Where the converter ends."""
        return (1 << self.bits) - 1
