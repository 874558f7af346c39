"""Frames that cannot be what they are taken for are refused before anything is made of them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from acquisition.imaging.light.same_exposure import is_same_gain
from acquisition.imaging.light.sensor import Sensor
from drivers.camera.frame import Frame
from goniometer.errors import ReductionError


def require_alike(
    frames: Sequence[Frame], sensor: Sensor, what: str, shape: tuple[int, ...] | None = None
) -> tuple[int, int]:
    """Height and width of all frames.

    Parameters
    ----------
    frames : sequence of Frame
        At least one.
    sensor : Sensor
        Whose they must be.
    what : str
        What they are, as messages name them.
    shape : tuple of int, optional
        (height, width) that they must have; otherwise that of the first.

    Raises
    ------
    ReductionError
        Names the first frame of another size, depth, exposure or gain than there can be.
    """
    shapes = [frame.counts.shape for frame in alike(frames, sensor, what, shape)]
    height, width = shapes[0]
    return height, width


def alike(frames: Iterable[Frame], sensor: Sensor, what: str, shape: tuple[int, ...] | None = None) -> Iterator[Frame]:
    """The frames one after the other, each when it has been checked; parameters and errors are those above."""
    for place, frame in enumerate(frames):
        shape = frame.counts.shape if shape is None else shape
        if fault := _fault(frame, sensor, shape):
            raise ReductionError(f"{frame_name(what, place, frame)} {fault}. Nothing was made of it.")
        yield frame
    if shape is None:
        raise ReductionError(f"There is no {what}; one is needed at least. Nothing was made of them.")


def frame_name(what: str, place: int, frame: Frame) -> str:
    """A frame as a person can find it again."""
    number = "" if frame.number is None else f"number {frame.number} of the camera, "
    return f"{what} {place} ({number}{frame.exposure_s:g} s, {frame.gain_db:g} dB, taken at {frame.time_s:.3f} s)"


def _fault(frame: Frame, sensor: Sensor, shape: tuple[int, ...]) -> str:
    counts = frame.counts
    if counts.dtype != np.uint16 or counts.ndim != 2:
        return f"is an array {counts.shape} of {counts.dtype}; needed are (height, width) 16-bit counts"
    if counts.shape != shape:
        return f"has {counts.shape[1]} x {counts.shape[0]} pixels, not {shape[1]} x {shape[0]}"
    if frame.bits != sensor.bits:
        return f"has {frame.bits} bits; the sensor's figures hold for {sensor.bits}"
    if not 0.0 < frame.exposure_s < math.inf or not math.isfinite(frame.gain_db):
        return "has an exposure or gain that cannot be"
    if sensor.linearity is not None and not is_same_gain(frame.gain_db, sensor.gain_db):
        return f"was taken at another gain than the table of linearity, {sensor.gain_db:g} dB"
    return ""
