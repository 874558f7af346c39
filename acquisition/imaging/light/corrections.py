"""From a camera's frames to the light behind one analyzer state."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from acquisition.imaging.light.dark import Dark
from acquisition.imaging.light.exposure import Exposure
from acquisition.imaging.light.flat import Flat
from acquisition.imaging.light.frame_checks import require_alike
from acquisition.imaging.light.merge import merged
from acquisition.imaging.light.same_exposure import by_setting
from acquisition.imaging.light.sensor import Sensor
from acquisition.imaging.light.signal_image import SignalImage
from drivers.camera.frame import Frame
from goniometer.errors import ReductionError

_MUCH_UNKNOWN = 0.001
"""Share of the pixels from which on it is worth a note: a sensor has some that are hot."""

_BAND_PIXELS = 1 << 16
"""So many pixels at a time stay in the processor's cache, and little memory is needed beside the result."""

_BY_CHANCE = 1e-5
"""Share of a picture's pixels that may be so far off: the noise of few photons has a longer tail than a normal one."""


class Corrections:
    """Takes out of frames what the sensor adds; what is not given is not done.

    Parameters
    ----------
    sensor : Sensor
        Its noise, saturation and, where it has one, linearity.
    dark : Dark, optional
        Subtracted. Without it the sensor's black level is; dark current remains and counts as light, in the variance
        too.
    flat : Flat, optional
        Divided by.
    bad : ndarray, optional
        (height, width) of bool: pixels not to be believed.

    Raises
    ------
    ReductionError
        When these are of different sizes.
    """

    def __init__(
        self, sensor: Sensor, dark: Dark | None = None, flat: Flat | None = None, bad: NDArray[np.bool_] | None = None
    ) -> None:
        self._sensor, self._dark, self._flat, self._bad = sensor, dark, flat, bad
        shapes = {
            "dark": None if dark is None else dark.shape,
            "flat": None if flat is None else flat.sensitivity.shape,
            "bad pixels": None if bad is None else bad.shape,
        }
        given = {name: shape for name, shape in shapes.items() if shape is not None}
        if len(set(given.values())) > 1:
            said = ", ".join(f"{name} {shape[1]} x {shape[0]}" for name, shape in given.items())
            raise ReductionError(f"Corrections of different sizes do not belong to one camera: {said} pixels.")
        self._shape = next(iter(given.values()), None)

    def signal(self, frames: Sequence[Frame]) -> SignalImage:
        """Light behind one analyzer state, in counts per second at gain 0 dB.

        Parameters
        ----------
        frames : sequence of Frame
            One or more behind the same state: repeats are averaged, and different exposures or gains merged.

        Raises
        ------
        ReductionError
            Names the frame that is of another size or depth, or the exposure that no dark fits.
        """
        height, width = require_alike(frames, self._sensor, "Frame", self._shape)
        exposures = [Exposure(group, self._sensor, self._dark) for group in by_setting(frames).values()]
        signal, variance = np.empty((height, width), np.float32), np.empty((height, width), np.float32)
        contradictory = 0
        for rows in _bands(height, width):
            light, noise, is_contradictory = merged(exposures, self._dark, rows)
            if self._flat is not None:
                self._divide(light, noise, self._flat, rows)
            if self._bad is not None:
                light[self._bad[rows]] = noise[self._bad[rows]] = np.nan
            contradictory += int(np.count_nonzero(is_contradictory & np.isfinite(light)))
            signal[rows], variance[rows] = light, noise
        return SignalImage(signal, variance, (*self._of_dark(), *_contradiction(contradictory, signal.size)))

    @property
    def has_dark(self) -> bool:
        """Whether black level and dark current are subtracted."""
        return self._dark is not None

    def saturated_share(self, frame: Frame) -> float:
        """Share of a frame's pixels that have reached saturation, of those that are not bad."""
        require_alike([frame], self._sensor, "Frame", self._shape)
        is_saturated = frame.counts >= self._sensor.saturation(frame.gain_db)
        if self._bad is not None and not self._bad.all():
            is_saturated = is_saturated[~self._bad]
        return float(np.count_nonzero(is_saturated) / is_saturated.size)

    def _of_dark(self) -> tuple[str, ...]:
        if self._dark is None or self._dark.unknown_share < _MUCH_UNKNOWN:
            return ()
        return (
            f"{self._dark.unknown_share:.1%} of the pixels are saturated in a dark picture, and unknown in every "
            "direction.",
        )

    @staticmethod
    def _divide(light: NDArray[np.float32], noise: NDArray[np.float32], flat: Flat, rows: slice) -> None:
        """All exposures share the sensitivity and so its error, which merging does not lessen."""
        sensitivity = flat.sensitivity[rows]
        light /= sensitivity
        noise /= sensitivity
        noise /= sensitivity
        noise += light * light * flat.relative_variance[rows]


def _bands(height: int, width: int) -> Iterator[slice]:
    rows = max(_BAND_PIXELS // width, 1)
    return (slice(*edges) for edges in pairwise([*range(0, height, rows), height]))


def _contradiction(pixels: int, of: int) -> tuple[str, ...]:
    if pixels <= _BY_CHANCE * of:
        return ()
    return (
        f"{pixels} of {of} pixels are of another brightness in one exposure than in another, by more than 6 standard "
        "deviations: something moved, the light flickers, or exposures are not as long as the camera says.",
    )
