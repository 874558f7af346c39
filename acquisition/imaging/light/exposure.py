"""Repeats of one exposure: the light that they show, and how well."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import fmean

import numpy as np
from numpy.typing import NDArray

from acquisition.imaging.light.dark import Dark, Shares
from acquisition.imaging.light.sensor import Sensor, from_0_db
from drivers.camera.frame import Frame

Map = NDArray[np.float32]


class Exposure:
    """Frames of one exposure and gain behind one analyzer state.

    Light is in counts per second at gain 0 dB, of pixels as sensitive as they are.

    Parameters
    ----------
    frames : sequence of Frame
        At least one.
    sensor : Sensor
        Whose they are.
    dark : Dark, optional
        Raises ReductionError when it has none of this exposure. Without it the sensor's black level is subtracted.
    """

    def __init__(self, frames: Sequence[Frame], sensor: Sensor, dark: Dark | None) -> None:
        first, self._frames, self._linearity, self._dark = frames[0], tuple(frames), sensor.linearity, dark
        pictures = sum(frame.averaged for frame in frames)
        self.light_s = sum(frame.exposure_s * frame.averaged for frame in frames)
        exposure_s = fmean(frame.exposure_s for frame in frames)
        self._gain_db, self._saturation = first.gain_db, sensor.saturation(first.gain_db)
        self._counts_per_light = fmean(frame.exposure_s * from_0_db(frame.gain_db) for frame in frames)
        self._electrons_per_light = sensor.electrons_per_count(0.0) * self.light_s
        self._read_variance = sensor.read_variance(first.gain_db) / (pictures * self._counts_per_light**2)
        self._dark_counts = () if dark is None else dark.shares(exposure_s, first.gain_db)
        self._even_counts = sensor.true_black_counts if dark is None else self._drifted_counts()

    @property
    def dark_shares(self) -> Shares:
        """What an error of a level of the dark makes of the light, with the opposite sign."""
        return tuple((level, share / self._counts_per_light) for level, share in self._dark_counts)

    def light(self, rows: slice) -> Map:
        """Mean of the repeats, NaN where any is saturated: the rest alone would be those that came out low."""
        light = self._true_counts(self._frames[0], rows)
        for frame in self._frames[1:]:
            light += self._true_counts(frame, rows)
        if len(self._frames) > 1:
            light /= np.float32(len(self._frames))
        if self._even_counts:
            light -= np.float32(self._even_counts)
        for level, share in self._dark_counts:
            light -= level.counts[rows] * np.float32(share)
        light /= np.float32(self._counts_per_light)
        for frame in self._frames:
            np.copyto(light, np.float32(np.nan), where=frame.counts[rows] >= self._saturation)
        return light

    def noise(self, light: Map, rows: slice) -> Map:
        """Variance of `light` where that is the true one, but for errors of the dark.

        Electrons, also those of the dark current, have the variance of their number; the converter adds its own, which
        the table of linearity stretches.
        """
        variance = np.maximum(light, np.float32(0.0))
        rate = None if self._dark is None else self._dark.rate(self._gain_db, rows)
        if rate is not None:
            variance += rate * np.float32(1.0 / from_0_db(self._gain_db))
        variance *= np.float32(1.0 / self._electrons_per_light)
        if self._linearity is None:
            variance += np.float32(self._read_variance)
        else:
            squared = sum(self._linearity.slope_squared(frame.counts[rows]) for frame in self._frames)
            variance += squared * np.float32(self._read_variance / len(self._frames))
        return variance

    def _drifted_counts(self) -> float:
        """By how much all pixels were brighter in the dark when these frames were taken than in the mean dark."""
        return sum(
            share * fmean(level.drift.counts(frame.time_s) for frame in self._frames)
            for level, share in self._dark_counts
        )

    def _true_counts(self, frame: Frame, rows: slice) -> Map:
        counts = frame.counts[rows]
        return counts.astype(np.float32) if self._linearity is None else self._linearity.true_counts(counts)
