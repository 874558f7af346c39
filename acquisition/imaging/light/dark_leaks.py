"""Dark frames that are not dark: light shows in the median of a frame, where noise and hot pixels do not."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from statistics import median

import numpy as np

from acquisition.imaging.light.frame_checks import frame_name
from acquisition.imaging.light.sensor import Sensor
from drivers.camera.frame import Frame
from goniometer.errors import ReductionError

_FAR = 5.0
"""In standard deviations of one pixel: black levels wander by less, and the median of a frame is far better known."""


def refuse_light(groups: Mapping[tuple[float, float], Sequence[Frame]], sensor: Sensor) -> None:
    """Refuse dark frames that light fell on, where others tell.

    Repeats must agree; over exposures at one gain the medians must rise, and on a line where there are three or more.
    A light that falls on all frames alike looks like dark current, and is not found.

    Parameters
    ----------
    groups : mapping
        From (gain_db, exposure_s) to the repeats.
    sensor : Sensor
        How far noise goes.

    Raises
    ------
    ReductionError
        Names the frame or the exposures.
    """
    at_gain: dict[float, dict[float, float]] = {}
    for (gain_db, exposure_s), frames in groups.items():
        far_counts = _FAR * math.sqrt(sensor.read_variance(gain_db))
        medians = [_median(frame, sensor) for frame in frames]
        _refuse_bright_repeat(frames, medians, far_counts)
        at_gain.setdefault(gain_db, {})[exposure_s] = median(medians)
    for gain_db, levels in at_gain.items():
        _refuse_bent_line(levels, gain_db, _FAR * math.sqrt(sensor.read_variance(gain_db)))


def _median(frame: Frame, sensor: Sensor) -> float:
    counts = np.median(frame.counts)
    return float(counts if sensor.linearity is None else sensor.linearity.true_counts(np.array(counts, np.uint16)))


def _refuse_bright_repeat(frames: Sequence[Frame], medians: Sequence[float], far_counts: float) -> None:
    brightest = int(np.argmax(medians))
    others = [*medians[:brightest], *medians[brightest + 1 :]]
    if others and medians[brightest] - median(others) > far_counts:
        raise ReductionError(
            f"{frame_name('Dark frame', brightest, frames[brightest])} of its exposure has a median of "
            f"{medians[brightest]:g} counts, others of the same exposure {median(others):g}: light fell on it. "
            "No dark was made. Close the shutter or block the light, and take it again."
        )


def _refuse_bent_line(levels: Mapping[float, float], gain_db: float, far_counts: float) -> None:
    """Medians over exposures: as many parameters as a dark has are fitted, and no dark current is negative."""
    if len(levels) < 2:
        return
    exposures_s, medians = map(np.array, zip(*sorted(levels.items()), strict=True))
    slope, offset = np.polyfit(exposures_s, medians, 1)
    apart = float(np.abs(medians - offset - slope * exposures_s).max())
    if apart <= far_counts and slope * np.ptp(exposures_s) >= -far_counts:
        return
    said = ", ".join(f"{counts:g} counts at {exposure_s:g} s" for exposure_s, counts in sorted(levels.items()))
    raise ReductionError(
        f"The medians of the dark frames at {gain_db:g} dB do not rise with the exposure along a line, as dark current "
        f"does: {said}. Light fell on some, or the sensor's temperature changed. No dark was made. Block the light "
        "and take them again, one exposure soon after the other."
    )
