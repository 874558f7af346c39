"""Where the goniometer's arms say that camera, source and sample stand."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]


@dataclass(frozen=True)
class Arms:
    """Angles of the arms, in degrees and with the signs of a recipe.

    The plate is the sample's plane, in the coordinates of `MapGrid`. The camera's axes are those of OpenCV: x to the
    right in the picture, y down, z ahead.
    """

    incidence_deg: float
    exit_deg: float
    azimuth_deg: float = 0.0
    exit_azimuth_deg: float = 0.0

    def rotation(self) -> Vector:
        """From plate to camera, (3, 3), of a camera that looks along its arm at the goniometer's centre."""
        cosine, sine = math.cos(math.radians(self.exit_deg)), math.sin(math.radians(self.exit_deg))
        level = np.array([[1.0, 0.0, 0.0], [0.0, -cosine, -sine], [0.0, sine, -cosine]])
        return np.asarray(level @ _about_normal(self.azimuth_deg - self.exit_azimuth_deg))

    def source(self) -> Vector:
        """Unit vector from the plate to the source, (3,), in the plate's coordinates."""
        incidence = math.radians(self.incidence_deg)
        return np.asarray(_about_normal(-self.azimuth_deg) @ (0.0, math.sin(incidence), math.cos(incidence)))


def _about_normal(turn_deg: float) -> Vector:
    cosine, sine = math.cos(math.radians(turn_deg)), math.sin(math.radians(turn_deg))
    return np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
