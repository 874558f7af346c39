"""What a scan produces: a reading of the detector, and the Stokes point that a point's readings reduce to."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

ReadingKind = Literal["signal", "dark", "reference"]


@dataclass(frozen=True)
class Reading:
    """One reading of the detector, with the positions that were read back for it.

    `point` counts the recipe's directions; `time_s` is the bench clock's; `slot` is the analyzer slot read back;
    `analyzer_deg` the angle of the polarizer in it, None for a slot without one (open or blocked).
    """

    point: int
    kind: ReadingKind
    repeat: int
    time_s: float
    incidence_deg: float
    exit_deg: float
    azimuth_deg: float
    slot: int
    analyzer_deg: float | None
    exposure_s: float
    power_w: float


@dataclass(frozen=True)
class StokesPoint:
    """The Stokes parameters of one direction: S0, S1, S2 in 1/sr per unit irradiance, with covariance.

    `stokes` has shape (3,), `covariance` (3, 3). `dolp` is the plain ratio, `dolp_debiased` has the bias that noise
    adds removed; both are NaN where noise has made S0 negative. `aolp_deg` is in (-90, 90], from the s-direction.
    """

    point: int
    incidence_deg: float
    exit_deg: float
    azimuth_deg: float
    stokes: NDArray[np.float64]
    covariance: NDArray[np.float64]
    dolp: float
    dolp_debiased: float
    dolp_stderr: float
    aolp_deg: float
    aolp_stderr_deg: float
