"""How a camera's lens maps directions to pixels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Optics:
    """A pinhole with distortion, as OpenCV's `calib3d` has it (its documentation, "Camera calibration").

    Parameters
    ----------
    focal_px : float
        Focal length over the size of a pixel, which is square.
    centre_px : tuple of float
        Where the optical axis meets the picture, (column, row); whole numbers are centres of pixels.
    distortion : tuple of float
        k1, k2, p1, p2, k3.
    """

    focal_px: float
    centre_px: tuple[float, float]
    distortion: tuple[float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0)

    @property
    def matrix(self) -> NDArray[np.float64]:
        """From directions (x/z, y/z, 1) to pixels, (3, 3)."""
        (column, row), focal = self.centre_px, self.focal_px
        return np.array([[focal, 0.0, column], [0.0, focal, row], [0.0, 0.0, 1.0]])
