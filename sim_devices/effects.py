"""Effects of the simulated detector, each a part that can be put on the signal's path or left out.

A part takes the power that reaches it and the measurement it belongs to, and returns the power that leaves it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property, reduce

import numpy as np

SAMPLE_S = 0.003


class Measurement:
    """One measurement: how long it took, and its own random numbers, the same for the same seed and number.

    Parameters
    ----------
    seed : int
        The scene's seed.
    number : int
        Counts the measurements of the bench from 0.
    exposure_s : float
        Time over which the power is averaged.
    """

    def __init__(self, seed: int, number: int, exposure_s: float) -> None:
        self.exposure_s = exposure_s
        self._key = [seed, number]

    @cached_property
    def random(self) -> np.random.Generator:
        """Random numbers, made only when an effect draws some."""
        return np.random.default_rng(self._key)


Part = Callable[[float, Measurement], float]


def dark_current(power_w: float) -> Part:
    """Add the power that the detector reports in the dark."""

    def add_dark_current(signal_w: float, measurement: Measurement) -> float:
        return signal_w + power_w

    return add_dark_current


def shot_noise(photon_energy_j: float) -> Part:
    """Count photons: a Poisson number, so the variance is power times photon energy over exposure."""

    def count_photons(signal_w: float, measurement: Measurement) -> float:
        photon_w = photon_energy_j / measurement.exposure_s
        return float(measurement.random.poisson(signal_w / photon_w)) * photon_w

    return count_photons


def read_noise(power_w: float) -> Part:
    """Add Gaussian noise: standard deviation `power_w` for one 3 ms sample, less by the root of their number."""

    def add_read_noise(signal_w: float, measurement: Measurement) -> float:
        spread_w = power_w * (SAMPLE_S / measurement.exposure_s) ** 0.5
        return signal_w + float(measurement.random.normal(0.0, spread_w))

    return add_read_noise


def quantisation(digits: int) -> Part:
    """Round to a number of significant digits."""

    def round_to_digits(signal_w: float, measurement: Measurement) -> float:
        return float(f"{signal_w:.{digits - 1}e}")

    return round_to_digits


def chain(parts: Sequence[Part]) -> Part:
    """Put parts one after the other; the result runs these parts and nothing else."""

    def run(signal_w: float, measurement: Measurement) -> float:
        return reduce(lambda power_w, part: part(power_w, measurement), parts, signal_w)

    return run
