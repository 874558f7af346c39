"""The noise of a camera that is read as a detector: the mean over many pixels of one exposure."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acquisition.detector_noise import NoiseModel
from acquisition.imaging.stokes.pixel_formula import SensorNoise


@dataclass(frozen=True)
class CameraNoise(NoiseModel):
    """Variance of a region's mean (EMVA Standard 1288, release 4.0, eq. 7, over the region's pixels).

    Other than with a meter, all of the read noise comes once an exposure, however long that is: as power it falls with
    the exposure itself, and not with its root. `read_w` is what it makes of an exposure of `sample_s`.

    Parameters
    ----------
    electron_j : float
        By how much an exposure's energy, as the region shows it, grows with one electron in one of its pixels.
    """

    electron_j: float

    def variance(self, power_w: NDArray[np.float64], exposure_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """Variance in W² of readings of mean `power_w` over `exposure_s`."""
        read = (self.read_w * self.sample_s / exposure_s) ** 2
        return np.asarray(read + self.electron_j * np.maximum(power_w, 0.0) / exposure_s)


def camera_noise(sensor: SensorNoise, watts_per_count_per_s: float, pixels: int, wavelength_nm: float) -> CameraNoise:
    """The noise of a region of so many pixels.

    Parameters
    ----------
    sensor : SensorNoise
        Of one pixel.
    watts_per_count_per_s : float
        Power on a pixel that makes one count per second.
    pixels : int
        Of the region.
    wavelength_nm : float
        Of the light; of no effect, because it is electrons that are counted.
    """
    return CameraNoise(
        read_w=watts_per_count_per_s * sensor.read_counts / pixels**0.5,
        sample_s=1.0,
        shot=True,
        wavelength_nm=wavelength_nm,
        electron_j=watts_per_count_per_s / (sensor.electrons_per_count * pixels),
    )
