"""The noise of a camera whose reading is the mean of several pictures."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acquisition.imaging.light.camera_noise import CameraNoise, camera_noise
from acquisition.imaging.stokes.pixel_formula import SensorNoise


@dataclass(frozen=True)
class VideoNoise(CameraNoise):
    """Variance of a region's mean over an exposure of whole pictures, each of `sample_s`.

    Each picture has its own read noise, so that this averages down as the photons' does, and `read_w` is that of one.
    """

    def variance(self, power_w: NDArray[np.float64], exposure_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """Variance in W² of readings of mean `power_w` over `exposure_s`."""
        one = super().variance(power_w, np.full_like(exposure_s, self.sample_s))
        return np.asarray(one * self.sample_s / exposure_s)


def video_noise(
    sensor: SensorNoise, watts_per_count_per_s: float, pixels: int, wavelength_nm: float, picture_s: float
) -> VideoNoise:
    """The noise of a region of so many pixels, where each picture collects light for `picture_s`; see `camera_noise`.

    Counts, here and in `sensor`, are those of the mean's 16 bits.
    """
    of_exposure = camera_noise(sensor, watts_per_count_per_s, pixels, wavelength_nm)
    read_w = of_exposure.read_w * of_exposure.sample_s / picture_s
    return VideoNoise(read_w, picture_s, of_exposure.shot, wavelength_nm, of_exposure.electron_j)
