"""What averaging has reached, from the readings alone: what falls short, and whether they scatter as they should."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence

import numpy as np
from scipy.special import chdtrc

from acquisition.averaging import Averaging
from acquisition.doubts import named
from acquisition.readings import Reading, StokesPoint
from acquisition.reduce import NoiseModel
from acquisition.signal_to_noise import ratio
from acquisition.wanted import IMPLAUSIBLE

_FEWEST = 20
"""Degrees of freedom from which on the scatter of readings tells something."""

_NOTEWORTHY = 1.1
"""Scatter in units of the noise model's above which the stated errors are too small to be left unsaid."""


class Averaged:
    """Compares what was read with what was wanted.

    Parameters
    ----------
    averaging : Averaging
        What was wanted.
    noise : NoiseModel
        The detector's noise.
    """

    def __init__(self, averaging: Averaging, noise: NoiseModel) -> None:
        self._averaging, self._noise = averaging, noise

    def shortfall(self, readings: Sequence[Reading], point: StokesPoint) -> str:
        """What the readings of a direction have not reached; empty if they have."""
        wanted = self._averaging.dolp_error
        if wanted is not None:
            if point.dolp_stderr <= wanted:
                return ""
            known = f"± {point.dolp_stderr:.2g}" if math.isfinite(point.dolp_stderr) else "unknown, S0 is not positive,"
            return f"DoLP {known} after {_most(readings)} readings in every slot, ± {wanted:g} wanted"
        return "; ".join(
            f"{place} signal-to-noise {found:.3g} after {count}"
            for place, count, found in self._ratios(readings)
            if found < (self._averaging.signal_to_noise or 0.0)
        )

    def _ratios(self, readings: Sequence[Reading]) -> Iterator[tuple[str, int, float]]:
        for group in _stays(readings):
            if group[0].kind != "dark":
                powers_w = [reading.power_w for reading in group]
                made = group[0].generator_slot
                place = f"slot {group[0].slot}" if made is None else f"slots {made}/{group[0].slot}"
                yield place, len(group), ratio(powers_w, group[0].exposure_s, self._noise)

    def doubts(self, readings: Sequence[Reading], points: Sequence[StokesPoint]) -> tuple[str, ...]:
        """What a person should know of a scan that averages before believing in its points, in words."""
        return tuple(filter(None, (self._short(readings, points), self._scatter(readings))))

    def _short(self, readings: Sequence[Reading], points: Sequence[StokesPoint]) -> str:
        of_points: dict[int, list[Reading]] = {}
        for reading in readings:
            of_points.setdefault(reading.point, []).append(reading)
        short = [point.point for point in points if self.shortfall(of_points[point.point], point)]
        if not short:
            return ""
        return (
            f"What was wanted, {self._averaging}, was not reached at {named(short)} ({len(short)} of {len(points)}). "
            "Errors are as stated there; for smaller ones raise at_most or exposure_s"
        )

    def _scatter(self, readings: Sequence[Reading]) -> str:
        """That readings of one place scatter by more than the noise model says; empty if they do not."""
        chi_square, freedom = 0.0, 0
        for group in _stays(readings):
            power_w = np.array([reading.power_w for reading in group])
            exposure_s = np.array([reading.exposure_s for reading in group])
            variance = self._noise.variance(np.full_like(power_w, power_w.mean()), exposure_s)
            chi_square += float(((power_w - power_w.mean()) ** 2 / variance).sum())
            freedom += len(group) - 1
        if freedom < _FEWEST or chdtrc(freedom, chi_square) > IMPLAUSIBLE:
            return ""
        excess = math.sqrt(chi_square / freedom)
        if excess < _NOTEWORTHY:
            return ""
        return (
            f"Readings of one place scatter {excess:.2g} times as much as the noise in the rig file says ({freedom} "
            "degrees of freedom): averages are ended too soon, and errors stated too small, by about that factor. Look "
            "at the lamp, or correct 'noise' in the rig file"
        )


def _stays(readings: Sequence[Reading]) -> Iterator[list[Reading]]:
    """The readings taken one after the other at one place."""

    def place(reading: Reading) -> tuple[int, str, int, int | None]:
        return reading.point, reading.kind, reading.slot, reading.generator_slot

    for _, group in itertools.groupby(readings, key=place):
        yield list(group)


def _most(readings: Sequence[Reading]) -> int:
    return max(reading.repeat for reading in readings) + 1
