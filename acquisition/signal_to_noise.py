"""When a slot has been read often enough."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Protocol

import numpy as np

from acquisition.reduce import NoiseModel
from acquisition.steps import Step


class Enough(Protocol):
    """Says when a step has its readings."""

    def __call__(self, step: Step, powers_w: Sequence[float]) -> bool:
        """Whether these are enough readings of the step."""
        ...


def as_planned(step: Step, powers_w: Sequence[float]) -> bool:
    """Whether the step has all the readings that it was planned with."""
    return len(powers_w) >= step.readings


class SignalToNoise:
    """Reads a slot until its mean power is so many of its own standard errors.

    The standard error is that of the noise model at the mean, as in the reduction. It does not know how the readings
    scatter, and so does not end where they happen to lie close together.

    The dark slot has no signal. It is read as often as the slot of its direction that was read most, so it must come
    behind them.

    Parameters
    ----------
    wanted : float
        The ratio.
    at_least : int
        Readings before which nothing is decided.
    noise : NoiseModel
        The detector's noise.
    """

    def __init__(self, wanted: float, at_least: int, noise: NoiseModel) -> None:
        self._wanted, self._at_least, self._noise = wanted, at_least, noise
        self._most_of_points: dict[int, int] = {}

    def __call__(self, step: Step, powers_w: Sequence[float]) -> bool:
        """Whether the ratio is reached, or as many readings are taken as the step allows."""
        if step.kind == "dark":
            return len(powers_w) >= min(self._most_of_points.get(step.point, step.readings), step.readings)
        is_enough = len(powers_w) >= step.readings or (
            len(powers_w) >= self._at_least and ratio(powers_w, step.exposure_s, self._noise) >= self._wanted
        )
        if is_enough and step.kind == "signal":
            self._most_of_points[step.point] = max(self._most_of_points.get(step.point, 0), len(powers_w))
        return is_enough


def ratio(powers_w: Sequence[float], exposure_s: float, noise: NoiseModel) -> float:
    """Mean of equally long readings in units of its standard error by the noise model at the mean."""
    mean_w = math.fsum(powers_w) / len(powers_w)
    variance = noise.variance(np.array([mean_w]), np.array([exposure_s]))
    return mean_w / math.sqrt(float(variance[0]) / len(powers_w))
