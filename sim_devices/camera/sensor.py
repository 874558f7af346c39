"""From the light on a camera's pixels to counts: every effect of the sensor is a part, there only where it is named."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from sim_devices.effects.measurement import seeded
from sim_devices.scene_part import ScenePart

Image: TypeAlias = NDArray[np.float64]

_POISSON_BELOW = 100.0
"""From so many electrons on a normal number stands for a Poisson number: mean and variance are its own."""


class SensorNonlinearity(ScenePart):
    """Of the charge c a pixel loses c · `relative_loss` · c/`at_counts`, until its well is full."""

    relative_loss: float = Field(gt=0, le=0.25, description="share of the counts that is missing at at_counts")
    at_counts: float = Field(gt=0, le=1e6, description="counts, at no gain, at which that share is missing")


class SensorParts(ScenePart):
    """What a sensor does beside counting; what is not named is not there. Counts are those at a gain of 0 dB."""

    electrons_per_count: float | None = Field(
        default=None, gt=0, le=1e4, description="electrons for each count; with it they have the noise of counting"
    )
    read_counts: float | None = Field(
        default=None, gt=0, le=1e3, description="standard deviation of the noise of reading a pixel out, in counts"
    )
    dark_counts: float | None = Field(
        default=None, gt=0, le=1e4, description="black level, in counts, added behind the gain"
    )
    dark_counts_per_s: float | None = Field(default=None, gt=0, le=1e6, description="dark current, in counts per s")
    prnu: float | None = Field(
        default=None, gt=0, le=0.5, description="standard deviation of the pixels' sensitivities, relative to the mean"
    )
    hot_pixels: int | None = Field(default=None, ge=1, le=100_000, description="how many pixels have more dark current")
    hot_counts_per_s: float = Field(default=1e4, gt=0, le=1e8, description="dark current of a hot pixel, in counts/s")
    dead_pixels: int | None = Field(default=None, ge=1, le=100_000, description="how many pixels see no light")
    nonlinearity: SensorNonlinearity | None = Field(default=None, description="loss that grows with the counts")


@dataclass(frozen=True)
class _Readout:
    exposure_s: float
    gain: float
    random: np.random.Generator


_Step: TypeAlias = Callable[[Image, _Readout], Image]


class Sensor:
    """Rows and columns of pixels, with a converter behind them.

    Parameters
    ----------
    parts : SensorParts
        What the sensor does beside counting.
    height, width : int
        Its pixels.
    joules_per_count : float
        Energy that falls on a pixel for each count at a gain of 0 dB.
    seed : int
        The scene's; it says which pixels are hot, and chooses all noise.

    Attributes
    ----------
    hot, dead : ndarray
        Which pixels are so: (n, 2) of row and column.
    """

    def __init__(self, parts: SensorParts, height: int, width: int, joules_per_count: float, seed: int) -> None:
        self._shape, self._joules_per_count, self._seed = (height, width), joules_per_count, seed
        self.hot = self._places(parts.hot_pixels or 0, "hot pixels")
        self.dead = self._places(parts.dead_pixels or 0, "dead pixels")
        self._steps = self._made_of(parts)

    def counts(
        self, power_w: Image | None, exposure_s: float, gain_db: float, bits: int, number: int
    ) -> NDArray[np.uint8] | NDArray[np.uint16]:
        """What is read out after an exposure.

        Parameters
        ----------
        power_w : ndarray or None
            (height, width), power on each pixel; None in the dark.
        exposure_s, gain_db : float
            How long, and the amplifier's gain.
        bits : int
            Of the converter, which ends at 2**bits - 1.
        number : int
            Of the frame: the same number has the same noise.

        Returns
        -------
        ndarray
            (height, width) of uint8 for at most 8 bits, else of uint16.
        """
        charge = np.zeros(self._shape) if power_w is None else power_w * (exposure_s / self._joules_per_count)
        readout = _Readout(exposure_s, 10.0 ** (gain_db / 20.0), seeded(self._seed, number, "frame"))
        for step in self._steps:
            charge = step(charge, readout)
        np.clip(np.rint(charge, out=charge), 0, (1 << bits) - 1, out=charge)
        return charge.astype(np.uint8) if bits <= 8 else charge.astype(np.uint16)

    def _places(self, pixels: int, name: str) -> NDArray[np.intp]:
        height, width = self._shape
        if pixels > height * width:
            raise ValueError(f"{pixels} {name}, and the sensor has {height * width} pixels")
        chosen = seeded(self._seed, 0, name).choice(height * width, size=pixels, replace=False)
        return np.stack(np.unravel_index(chosen, self._shape), axis=1)

    def _made_of(self, parts: SensorParts) -> list[_Step]:
        """In the order in which light and electrons meet them."""
        steps: list[_Step] = []
        if parts.prnu is not None:
            sensitivity = 1.0 + parts.prnu * seeded(self._seed, 0, "prnu").standard_normal(self._shape)
            steps.append(_times(np.maximum(sensitivity, 0.0)))
        if len(self.dead):
            seeing = np.ones(self._shape)
            seeing[tuple(self.dead.T)] = 0.0
            steps.append(_times(seeing))
        if parts.dark_counts_per_s is not None:
            steps.append(_leaking(np.asarray(parts.dark_counts_per_s)))
        if len(self.hot):
            leak = np.zeros(self._shape)
            leak[tuple(self.hot.T)] = parts.hot_counts_per_s
            steps.append(_leaking(leak))
        if parts.electrons_per_count is not None:
            steps.append(_counting(parts.electrons_per_count))
        if parts.nonlinearity is not None:
            steps.append(_bending(parts.nonlinearity))
        if parts.read_counts is not None:
            steps.append(_noisy(parts.read_counts))
        steps.append(_amplified)
        if parts.dark_counts is not None:
            steps.append(_raised(parts.dark_counts))
        return steps


def _times(factor: Image) -> _Step:
    return lambda charge, readout: charge * factor


def _leaking(counts_per_s: Image) -> _Step:
    return lambda charge, readout: charge + counts_per_s * readout.exposure_s


def _counting(electrons_per_count: float) -> _Step:
    """A Poisson number of electrons in every pixel."""

    def counted(charge: Image, readout: _Readout) -> Image:
        electrons = charge * electrons_per_count
        few = electrons < _POISSON_BELOW
        if few.all():
            return readout.random.poisson(electrons) / electrons_per_count
        found = electrons + np.sqrt(electrons) * readout.random.standard_normal(charge.shape, dtype=np.float32)
        if few.any():
            found[few] = readout.random.poisson(electrons[few])
        return found / electrons_per_count

    return counted


def _bending(loss: SensorNonlinearity) -> _Step:
    """A parabola as far as its top, where the well is full."""
    per_count = loss.relative_loss / loss.at_counts
    full_counts = 0.5 / per_count

    def bent(charge: Image, readout: _Readout) -> Image:
        held = np.minimum(charge, full_counts)
        return np.asarray(held * (1.0 - per_count * held))

    return bent


def _noisy(read_counts: float) -> _Step:
    return lambda charge, readout: charge + read_counts * readout.random.standard_normal(charge.shape, dtype=np.float32)


def _amplified(charge: Image, readout: _Readout) -> Image:
    return charge * readout.gain


def _raised(black_counts: float) -> _Step:
    return lambda charge, readout: charge + black_counts
