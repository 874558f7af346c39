"""What a scan produces: a reading of the detector, and the Stokes point that a point's readings reduce to."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from acquisition.analyzer_matrix import AnalyzerState
from acquisition.generator import GeneratorState

ReadingKind = Literal["signal", "dark", "reference"]


@dataclass(frozen=True)
class Reading:
    """One reading of the detector, with the positions that were read back for it.

    `point` counts the recipe's directions; `time_s` is the bench clock's; `slot` is the analyzer slot read back;
    `analyzer_deg` the angle of the polarizer in it, None for a slot without one (open or blocked); `retarder_deg` and
    `retardance_deg` are the fast axis and the retardance of a retarder before the polarizer, None without one.
    `exit_azimuth_deg` is the detector arm's turn out of the plane of incidence, None on a bench that cannot turn it.
    Those of the generator say of the light on the sample what those of the analyzer say of the reflected one, None
    where it is unpolarized. `wavelength_nm` is that of the light, None in journals from before it was stored.
    `analyzer_sweep_deg` and `retarder_sweep_deg` say how far polarizer and retarder turned, evenly, in the exposure;
    the angles are those in its middle; None for what stood still. Of an analyzer that turned, `slot` is 1 forwards and
    2 backwards.
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
    retarder_deg: float | None = None
    retardance_deg: float | None = None
    exit_azimuth_deg: float | None = None
    generator_slot: int | None = None
    generator_deg: float | None = None
    generator_retarder_deg: float | None = None
    generator_retardance_deg: float | None = None
    wavelength_nm: float | None = None
    analyzer_sweep_deg: float | None = None
    retarder_sweep_deg: float | None = None

    @property
    def generator(self) -> GeneratorState:
        """What the light had passed before the sample."""
        return GeneratorState(self.generator_deg, self.generator_retarder_deg, self.generator_retardance_deg)

    @property
    def analyzer(self) -> AnalyzerState:
        """What the light has passed."""
        sweeps_deg = self.analyzer_sweep_deg or 0.0, self.retarder_sweep_deg or 0.0
        return AnalyzerState(self.analyzer_deg, self.retarder_deg, self.retardance_deg, *sweeps_deg)


@dataclass(frozen=True)
class StokesPoint:
    """The Stokes parameters of one direction: S0, S1, S2 in 1/sr per unit irradiance, and S3 where it was measured.

    `stokes` has shape (3,) or (4,), `covariance` (3, 3) or (4, 4). `dolp` is the plain ratio, `dolp_debiased` has the
    bias that noise adds removed; both are NaN where noise has made S0 negative. `aolp_deg` is in (-90, 90], from the
    s-direction. `docp`, which is S3/S0 with its sign, and the degree of polarization `dop`, linear and circular
    together, are None where S3 was not measured. `is_contradictory` says that some of its
    readings are dark where the others say that there is light. `exit_azimuth_deg` is as in its readings; the
    s-direction is perpendicular to the surface normal and to the way to the detector. `wavelength_nm` is that of the
    light, None where nobody says so.
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
    docp: float | None = None
    docp_stderr: float | None = None
    dop: float | None = None
    dop_stderr: float | None = None
    is_contradictory: bool = False
    exit_azimuth_deg: float | None = None
    wavelength_nm: float | None = None

    @property
    def has_s3(self) -> bool:
        """Whether S3 was measured."""
        return len(self.stokes) == 4


@dataclass(frozen=True, kw_only=True)
class MuellerPoint(StokesPoint):
    """The Mueller matrix of one direction in 1/sr, of which the Stokes parameters are the first column.

    `mueller` has shape (3, 3), (3, 4), (4, 3) or (4, 4): as many rows as the analyzer tells, and columns as the
    generator makes; `mueller_covariance` is that of its elements, row by row, in 1/sr².
    """

    mueller: NDArray[np.float64]
    mueller_covariance: NDArray[np.float64]
