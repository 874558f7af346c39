"""The pixels of maps in the sample's own coordinates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class MapGrid:
    """A rectangle on the sample, cut into square pixels.

    The sample's coordinates have their origin where the goniometer's axes meet its surface. At azimuth 0, x points
    along the s-direction, to the right in the picture of a camera on the detector arm, and y towards the source, up in
    the picture; both in mm. They turn with the sample's azimuth.

    Parameters
    ----------
    left_mm, top_mm : float
        The outer corner: the lowest x and the highest y.
    pixel_mm : float
        Size of a pixel.
    width, height : int
        How many pixels there are.
    """

    left_mm: float
    top_mm: float
    pixel_mm: float
    width: int
    height: int

    def x_mm(self) -> NDArray[np.float64]:
        """Centres of the columns."""
        return np.asarray(self.left_mm + self.pixel_mm * (np.arange(self.width) + 0.5))

    def y_mm(self) -> NDArray[np.float64]:
        """Centres of the rows, from top to bottom: falling."""
        return np.asarray(self.top_mm - self.pixel_mm * (np.arange(self.height) + 0.5))
