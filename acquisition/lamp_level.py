"""How bright the lamp was in the course of a scan, from its reference readings, and where that cannot be told."""

from __future__ import annotations

import itertools
import math
from bisect import bisect_left
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acquisition.readings import Reading

FloatArray = NDArray[np.float64]

LARGEST_CHANGE = 0.1
"""Relative change of the lamp from one reference to the next up to which it is taken to be linear in time."""

SIGNIFICANT = 5.0
"""Standard errors beyond which noise is not the reason."""


@dataclass(frozen=True)
class LampBreak:
    """A stretch of time in which nobody knows how bright the lamp was, and why."""

    begin_s: float
    end_s: float
    why: str

    def holds(self, time_s: float) -> bool:
        """Whether a moment lies in it."""
        return self.begin_s < time_s < self.end_s


@dataclass(frozen=True)
class LampLevel:
    """The lamp's level against the first reference reading, between references linear in time.

    `times_s`, `powers_w` and `variances_w2` have one entry for each group of reference readings; empty: no reference.
    """

    times_s: tuple[float, ...] = ()
    powers_w: tuple[float, ...] = ()
    variances_w2: tuple[float, ...] = ()

    def at(self, times_s: Sequence[float]) -> tuple[FloatArray, FloatArray]:
        """Levels (N,) and their covariance (N, N) at times; constant before the first and after the last reference."""
        asked_s = np.asarray(times_s, np.float64)
        if not self.times_s:
            return np.ones(len(asked_s)), np.zeros((len(asked_s), len(asked_s)))
        right = np.clip([bisect_left(self.times_s, time_s) for time_s in times_s], 1, max(len(self.times_s) - 1, 1))
        around = np.unique(np.concatenate([[0], right - 1, np.minimum(right, len(self.times_s) - 1)]))
        known_s, powers_w, variances_w2 = (
            np.array([of_all[number] for number in around])
            for of_all in (self.times_s, self.powers_w, self.variances_w2)
        )
        shares = np.array([np.interp(asked_s, known_s, unit) for unit in np.eye(len(around))]).T
        levels = shares @ powers_w / powers_w[0]
        slopes = shares / powers_w[0]
        slopes[:, 0] -= levels / powers_w[0]  # the first reference is in the denominator too
        return levels, slopes * variances_w2 @ slopes.T

    def is_dark(self, number: int) -> bool:
        """Whether noise alone may have made the reference of this number."""
        return self.powers_w[number] <= SIGNIFICANT * math.sqrt(self.variances_w2[number])

    def breaks(self, largest_change: float) -> tuple[LampBreak, ...]:
        """Where a reference shows no light, or neighbours differ by more than `largest_change` of the brighter.

        Behind a last reference without light, nobody knows how bright the lamp was ever after.
        """
        last = len(self.times_s) - 1
        return tuple(
            LampBreak(
                self.times_s[before], math.inf if after == last and self.is_dark(after) else self.times_s[after], why
            )
            for before, after in itertools.pairwise(range(last + 1))
            if (why := self._why_broken(before, after, largest_change))
        )

    def _why_broken(self, before: int, after: int, largest_change: float) -> str:
        powers_w = self.powers_w[before], self.powers_w[after]
        noise_w = SIGNIFICANT * math.sqrt(self.variances_w2[before] + self.variances_w2[after])
        times = f"at {self.times_s[before]:.1f} s and {self.times_s[after]:.1f} s on the bench's clock"
        if self.is_dark(before) or self.is_dark(after):
            shown = " and ".join(f"{power_w:.3g} W" for power_w in powers_w)
            return (
                f"of the reference readings {times}, {shown} above dark, one shows no light: the lamp may have been off"
            )
        if abs(powers_w[1] - powers_w[0]) > largest_change * max(powers_w) + noise_w:
            levels = " and ".join(f"{power_w / self.powers_w[0]:.3g}" for power_w in powers_w)
            return (
                f"the reference readings {times} show lamp levels of {levels}, which is a change of more than "
                f"{largest_change:g} (largest_change)"
            )
        return ""


def reference_groups(readings: Sequence[Reading]) -> Iterator[list[Reading]]:
    """The reference readings that were taken together; the last direction may have some before and some behind it."""
    group: list[Reading] = []
    for reading in readings:
        if reading.kind == "reference":
            if reading.repeat == 0 and group:
                yield group
                group = []
            group.append(reading)
    if group:
        yield group
