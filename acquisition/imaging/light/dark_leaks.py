"""Dark frames that are not dark: light shows in all of a frame, where noise and hot pixels do not."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from statistics import median

import numpy as np

from acquisition.imaging.light.dark_level import DarkPicture
from acquisition.imaging.light.same_exposure import Setting
from acquisition.imaging.light.sensor import Sensor
from goniometer.errors import ReductionError

_FAR = 5.0
"""In standard deviations of one pixel: beside a steady drift, black levels wander by less from one dark frame to the
next."""

_PAUSE_S = 600.0
"""A camera that was left alone for so long may have warmed up, or been switched off and on."""

_FEWEST_STEPS = 3
"""Of two, one that is due to light would pass for half a drift."""


def refuse_light(settings: Mapping[Setting, Sequence[DarkPicture]], sensor: Sensor) -> None:
    """Refuse dark frames that light fell on, where others tell.

    A black level creeps and light comes at once: repeats must agree with those before and after them but for a steady
    drift, however far they are from others, and those on the other side of a long pause. Over exposures at one gain
    levels must rise, and on a line where there are three or more. A light that falls on all frames alike looks like
    dark current, one that grows slowly like drift; they are not found.

    Parameters
    ----------
    settings : mapping
        Of each gain and exposure the repeats.
    sensor : Sensor
        How far noise goes.

    Raises
    ------
    ReductionError
        Names the frame or the exposures.
    """
    at_gain: dict[float, dict[float, float]] = {}
    for (gain_db, exposure_s), pictures in settings.items():
        _refuse_sudden_light(pictures, _FAR * math.sqrt(sensor.read_variance(gain_db)))
        at_gain.setdefault(gain_db, {})[exposure_s] = median(picture.counts for picture in pictures)
    for gain_db, levels in at_gain.items():
        _refuse_bent_line(levels, gain_db, _FAR * math.sqrt(sensor.read_variance(gain_db)))


def _refuse_sudden_light(pictures: Sequence[DarkPicture], far_counts: float) -> None:
    in_time = sorted(pictures, key=lambda picture: picture.time_s)
    drift_per_s = _drift_per_s(in_time)
    for before, after in pairwise(in_time):
        if after.time_s - before.time_s > _PAUSE_S:
            continue
        step, drift = after.counts - before.counts, drift_per_s * (after.time_s - before.time_s)
        risen = step - min(max(step, min(drift, 0.0)), max(drift, 0.0))  # a drift may slow down, above all in a pause
        if abs(risen) > far_counts:
            darker, brighter = (before, after) if risen > 0 else (after, before)
            raise ReductionError(
                f"{brighter.name} of its exposure has {brighter.counts:.6g} counts in a typical pixel, the dark frame "
                f"next to it in time {darker.counts:.6g}: light fell on it, or else the "
                "black level jumped. No dark was made. Close the shutter or block the light, and take it again."
            )


def _drift_per_s(in_time: Sequence[DarkPicture]) -> float:
    """The rate that is usual between one picture and the next; 0 where there are too few to tell."""
    rates = [
        (after.counts - before.counts) / (after.time_s - before.time_s)
        for before, after in pairwise(in_time)
        if after.time_s > before.time_s
    ]
    return median(rates) if len(rates) >= _FEWEST_STEPS else 0.0


def _refuse_bent_line(levels: Mapping[float, float], gain_db: float, far_counts: float) -> None:
    """Levels over exposures: as many parameters as a dark has are fitted, and no dark current is negative."""
    if len(levels) < 2:
        return
    exposures_s, medians = map(np.array, zip(*sorted(levels.items()), strict=True))
    slope, offset = np.polyfit(exposures_s, medians, 1)
    apart = float(np.abs(medians - offset - slope * exposures_s).max())
    if apart <= far_counts and slope * np.ptp(exposures_s) >= -far_counts:
        return
    said = ", ".join(f"{counts:g} counts at {exposure_s:g} s" for exposure_s, counts in sorted(levels.items()))
    raise ReductionError(
        f"The levels of the dark frames at {gain_db:g} dB do not rise with the exposure along a line, as dark current "
        f"does: {said}. Light fell on some, or the sensor's temperature changed. No dark was made. Block the light "
        "and take them again, one exposure soon after the other."
    )
