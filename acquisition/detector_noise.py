"""The noise of a detector, from which every reading gets its weight."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

_PLANCK_J_S = 6.62607015e-34
_LIGHT_SPEED_M_S = 299792458.0


@dataclass(frozen=True)
class NoiseModel:
    """Variance of a reading: read noise that averages down, and the photons' own.

    Parameters
    ----------
    read_w : float
        Standard deviation of one sample, in W.
    sample_s : float
        Duration of one sample, in s.
    shot : bool
        Whether photon noise counts.
    wavelength_nm : float
        Sets the energy of a photon.
    """

    read_w: float
    sample_s: float
    shot: bool
    wavelength_nm: float

    def variance(self, power_w: NDArray[np.float64], exposure_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """Variance in W² of readings of mean `power_w` over `exposure_s`."""
        read = self.read_w**2 * self.sample_s / exposure_s
        if not self.shot:
            return read
        photon_j = _PLANCK_J_S * _LIGHT_SPEED_M_S / (self.wavelength_nm * 1e-9)
        return np.asarray(read + photon_j * np.maximum(power_w, 0.0) / exposure_s)
