"""Dark pictures of one exposure and gain: their mean, and how their level drifted about it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from statistics import fmean

import numpy as np
from numpy.typing import NDArray

from acquisition.imaging.light.dark_drift import DarkDrift, shift_counts
from acquisition.imaging.light.frame_checks import frame_name
from acquisition.imaging.light.sensor import Sensor
from drivers.camera.frame import Frame

Map = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class DarkLevel:
    """Mean of the dark frames of one exposure and gain.

    Parameters
    ----------
    exposure_s, gain_db : float
        Of the frames.
    frames : int
        How many pictures there are.
    counts : ndarray
        (height, width): true counts; NaN where any dark frame, of whatever exposure, is saturated.
    read_variance : float
        Of the mean, in true counts², by the converter.
    drift : DarkDrift
        By how much all pixels had more or fewer counts at a time.
    """

    exposure_s: float
    gain_db: float
    frames: int
    counts: Map
    read_variance: float
    drift: DarkDrift


@dataclass(frozen=True)
class DarkPicture:
    """What is kept of one: its name, when it was taken, and the true counts that a typical pixel has."""

    name: str
    time_s: float
    counts: float


class DarkSum:
    """Adds up dark frames as they come, so that those of a long scan need not be held together.

    Parameters
    ----------
    sensor : Sensor
        Whose they are.
    gain_db : float
        At which they were taken.

    Attributes
    ----------
    pictures : list of DarkPicture
        Those that were added.
    """

    def __init__(self, sensor: Sensor, gain_db: float) -> None:
        self.pictures: list[DarkPicture] = []
        self._sensor, self._gain_db = sensor, gain_db
        self._exposures_s: list[float] = []
        self._averaged, self._read_variance = 0, sensor.read_variance(gain_db)

    def add(self, frame: Frame) -> None:
        """Take one more."""
        counts, table = frame.counts, self._sensor.linearity
        true = counts.astype(np.float32) if table is None else table.true_counts(counts)
        true[counts >= self._sensor.saturation(frame.gain_db)] = np.nan
        if not self.pictures:
            middle = np.array(np.median(counts), np.uint16)
            self._first, self._total = true, np.zeros_like(true)
            self._typical = float(middle if table is None else table.true_counts(middle))
            if table is not None:
                self._read_variance *= float(np.median(table.slope_squared(counts)))
        shift = shift_counts(true, self._first, math.sqrt(self._read_variance))
        name = frame_name("Dark frame", len(self.pictures), frame)
        self.pictures.append(DarkPicture(name, frame.time_s, self._typical + shift))
        self._total += true  # exact to 2**24, some hundreds of frames of 16 bits
        self._exposures_s.append(frame.exposure_s)
        self._averaged += frame.averaged

    def level(self) -> DarkLevel:
        """Their mean."""
        variance = self._read_variance / self._averaged
        drift = DarkDrift([one.time_s for one in self.pictures], [one.counts for one in self.pictures])
        mean = self._total / np.float32(len(self.pictures))
        return DarkLevel(fmean(self._exposures_s), self._gain_db, self._averaged, mean, variance, drift)
