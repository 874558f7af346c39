"""What a sensor counts in the dark: black level and dark current of every pixel, from dark frames."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from acquisition.imaging.light.dark_leaks import refuse_light
from acquisition.imaging.light.dark_level import DarkLevel, DarkSum
from acquisition.imaging.light.frame_checks import alike
from acquisition.imaging.light.same_exposure import Setting, is_same_exposure, is_same_gain, setting_of
from acquisition.imaging.light.sensor import Sensor
from drivers.camera.frame import Frame
from goniometer.errors import ReductionError

Map = NDArray[np.float32]
ALL = slice(None)

_STANDS_OUT = 4.0
"""In standard deviations."""


Shares = tuple[tuple[DarkLevel, float], ...]
"""A dark as a sum of levels, each times its share."""


class Dark:
    """Dark of any exposure for which there are frames, or which lies below the longest of several.

    Between exposures each pixel's dark is offset + rate · exposure, by least squares of the levels' means weighted by
    their numbers of frames; so every dark is a sum of levels, and its errors follow.

    Parameters
    ----------
    sensor : Sensor
        Whose frames these are.
    frames : iterable of Frame
        Taken without light; repeats of an exposure and gain are averaged, and say how the black level drifted. They
        are taken one after the other, and not held.

    Raises
    ------
    ReductionError
        When sizes or depths differ, light fell on some of the frames, or all pixels are saturated.

    Attributes
    ----------
    unknown_share : float
        Share of the pixels that are saturated in some frame.
    """

    def __init__(self, sensor: Sensor, frames: Iterable[Frame]) -> None:
        self._sensor = sensor
        sums: dict[Setting, DarkSum] = {}
        for frame in alike(frames, sensor, "Dark frame"):
            setting = setting_of(frame, sums)
            sums.setdefault(setting, DarkSum(sensor, setting[0])).add(frame)
        refuse_light({setting: of_setting.pictures for setting, of_setting in sums.items()}, sensor)
        self.levels = tuple(of_setting.level() for _, of_setting in sorted(sums.items()))
        self.shape = self.levels[0].counts.shape
        is_unknown = np.logical_or.reduce([np.isnan(level.counts) for level in self.levels])
        if is_unknown.all():
            raise ReductionError(
                "Every pixel is saturated in a dark frame: no dark was made. Block the light, or shorten the exposure."
            )
        self.unknown_share = float(is_unknown.mean())
        for level in self.levels:
            level.counts[is_unknown] = np.nan
        self._rates = {gain_db: self._rate(gain_db) for gain_db in {level.gain_db for level in self.levels}}

    def shares(self, exposure_s: float, gain_db: float) -> Shares:
        """How the dark of an exposure is made of levels.

        Raises
        ------
        ReductionError
            Names the exposures that there are.
        """
        levels = self._at_gain(gain_db)
        for level in levels:
            if is_same_exposure(level.exposure_s, exposure_s):
                return ((level, 1.0),)
        if len(levels) > 1 and exposure_s < levels[-1].exposure_s:
            return _line(levels, np.array([1.0, exposure_s]))
        had = ", ".join(f"{level.exposure_s:g} s at {level.gain_db:g} dB" for level in self.levels)
        raise ReductionError(
            f"No dark fits an exposure of {exposure_s:g} s at {gain_db:g} dB; dark frames were taken of {had}. "
            "Nothing was subtracted. Take dark frames of this exposure and gain, or of a shorter and a longer exposure."
        )

    def counts(self, exposure_s: float, gain_db: float, rows: slice = ALL) -> Map:
        """True counts of an exposure without light, (height, width); NaN where they are not known."""
        return _total(self.shares(exposure_s, gain_db), rows)

    def variance(self, exposure_s: float, gain_db: float, rows: slice = ALL) -> Map:
        """Variance of `counts`, in counts²; frames from which it is subtracted share this error."""
        shares = self.shares(exposure_s, gain_db)
        return np.asarray(sum(share**2 * self.level_variance(level, rows) for level, share in shares), np.float32)

    def level_variance(self, level: DarkLevel, rows: slice = ALL) -> Map:
        """Variance of a level's counts: of the converter, and of the dark current's electrons where these are known."""
        found = np.full_like(level.counts[rows], level.read_variance)
        rate = self.rate(level.gain_db, rows)
        if rate is not None:
            electrons = self._sensor.electrons_per_count(level.gain_db) * level.frames
            found += rate * np.float32(level.exposure_s / electrons)
        return found

    def rate(self, gain_db: float, rows: slice = ALL) -> Map | None:
        """Dark current in true counts per second, for its noise; None from darks of a single exposure.

        It is the sensor's median where a pixel's own does not stand out from its error: a pixel's noise must not be
        taken for larger where its dark came out high, or the light that is left would have the smaller weight.
        """
        rate = self._rates[self._at_gain(gain_db)[0].gain_db]
        return None if rate is None else rate[rows]

    def _rate(self, gain_db: float) -> Map | None:
        levels = self._at_gain(gain_db)
        if len(levels) < 2:
            return None
        shares = _line(levels, np.array([0.0, 1.0]))
        rate = _total(shares, ALL)
        typical = np.float32(np.nanmedian(rate))
        of_typical = max(float(typical), 0.0) / self._sensor.electrons_per_count(gain_db)
        variances = (level.read_variance + of_typical * level.exposure_s / level.frames for level in levels)
        error = math.sqrt(sum(share**2 * own for (_, share), own in zip(shares, variances, strict=True)))
        np.copyto(rate, typical, where=np.abs(rate - typical) <= _STANDS_OUT * error)
        return np.maximum(rate, np.float32(0.0), out=rate)

    def _at_gain(self, gain_db: float) -> list[DarkLevel]:
        return [level for level in self.levels if is_same_gain(level.gain_db, gain_db)]


def _line(levels: Sequence[DarkLevel], wanted: NDArray[np.float64]) -> Shares:
    """What of each level makes `wanted` of (offset, rate)."""
    exposures_s = np.array([level.exposure_s for level in levels])
    weights = np.array([level.frames for level in levels], np.float64)
    design = np.stack([np.ones_like(exposures_s), exposures_s], axis=1)
    shares = wanted @ np.linalg.solve(design.T @ (weights[:, None] * design), design.T * weights)
    return tuple(zip(levels, map(float, shares), strict=True))


def _total(shares: Shares, rows: slice) -> Map:
    (first, share), *others = shares
    total = first.counts[rows] * np.float32(share)
    for level, share in others:
        total += level.counts[rows] * np.float32(share)
    return total
