"""The part of a picture over which a camera is read as a detector."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from drivers.camera.frame import Frame


@dataclass(frozen=True)
class RegionMean:
    """Mean of the counts of `pixels` pixels, and their variance from pixel to pixel, in counts²."""

    mean_counts: float
    variance_counts2: float
    pixels: int


@dataclass(frozen=True)
class Region:
    """A rectangle of pixels; `left` and `top` count from the picture's upper left corner."""

    left: int
    top: int
    width: int
    height: int

    def fits(self, width: int, height: int) -> bool:
        """Whether it lies within pictures of this size."""
        return (
            min(self.left, self.top) >= 0
            and min(self.width, self.height) > 0
            and self.left + self.width <= width
            and self.top + self.height <= height
        )

    def mean(self, frame: Frame, saturation_counts: int) -> RegionMean:
        """Mean and variance of a frame's counts within it, of those pixels that have not reached saturation."""
        counts = frame.counts[self.top : self.top + self.height, self.left : self.left + self.width]
        counts = counts[counts < saturation_counts]
        return RegionMean(float(counts.mean()), float(counts.var(dtype=np.float64)), counts.size)

    def saturated(self, frame: Frame, saturation_counts: int) -> int:
        """How many of its pixels have reached saturation."""
        counts = frame.counts[self.top : self.top + self.height, self.left : self.left + self.width]
        return int(np.count_nonzero(counts >= saturation_counts))
