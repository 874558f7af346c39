"""How many directions are swept together, slot after slot, before the scan goes on to the next ones.

Where an arm comes to the next direction sooner than the analyzer to its next slot, it is quicker to take many
directions in one slot, and the same ones back again in the next. But then the readings of a direction lie as far apart
as the sweeps take, in which the lamp may change.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Seconds = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Sweep:
    """What a sweep over all directions costs, in seconds.

    Parameters
    ----------
    onward_s : ndarray
        From each direction to the next, shape (N - 1,), the mean of both ways.
    reading_s : ndarray
        The readings of one slot in each direction, shape (N,).
    turn_s : float
        All changes of slot at one direction, from the first slot to the last.
    slots : int
        How many slots there are.
    """

    onward_s: Seconds
    reading_s: Seconds
    turn_s: float
    slots: int

    def total_s(self, firsts: NDArray[np.intp]) -> float:
        """About how long blocks take that begin at these directions.

        The way from a block to the next leads from its far end where the number of slots is odd; else from where it
        began, as far as the block is long.
        """
        ways_s = np.concatenate([[0.0], np.cumsum(self.onward_s)])
        ends = np.append(firsts[1:], len(self.reading_s)) - 1
        within_s = float((ways_s[ends] - ways_s[firsts]).sum())
        between_s = self.onward_s[firsts[1:] - 1] if self.slots % 2 else ways_s[firsts[1:]] - ways_s[firsts[:-1]]
        readings_s = self.slots * float(self.reading_s.sum())
        return self.slots * within_s + float(between_s.sum()) + len(firsts) * self.turn_s + readings_s

    def span_s(self, firsts: NDArray[np.intp]) -> float:
        """How far apart in time the readings of a direction lie at most, their beginnings, in the longest block.

        With an odd number of slots all directions have one sweep less between their first and their last; with an even
        one the first direction is also the last.
        """
        ends = np.append(firsts[1:], len(self.reading_s)) - 1
        read_s = np.concatenate([[0.0], np.cumsum(self.reading_s)])
        ways_s = np.concatenate([[0.0], np.cumsum(self.onward_s)])
        sweeps_s = read_s[ends + 1] - read_s[firsts] + ways_s[ends] - ways_s[firsts]
        between = self.slots - 1 if self.slots % 2 else self.slots
        return float((between * sweeps_s).max()) + self.turn_s


def blocks(sweep: Sweep, within_s: float) -> tuple[range, ...]:
    """The directions in blocks, so that a scan takes the least time.

    Parameters
    ----------
    sweep : Sweep
        What it costs.
    within_s : float
        How far apart the readings of a direction may lie; not kept by blocks of a single direction, which nothing makes
        shorter.
    """
    count = len(sweep.reading_s)
    allowed = (firsts for firsts in _even(count) if len(firsts) == count or sweep.span_s(firsts) <= within_s)
    best = min(allowed, key=sweep.total_s)
    ends: Sequence[int] = [*best[1:].tolist(), count]
    return tuple(range(first, end) for first, end in zip(best.tolist(), ends, strict=True))


def _even(count: int) -> Iterator[NDArray[np.intp]]:
    """Where blocks begin, for each number of blocks that makes them shorter than the last; they differ by one at most.

    Single directions come first, so that they win where nothing is gained.
    """
    yield np.arange(count)
    longest = 0
    for number in _numbers(count):
        if (length := math.ceil(count / number)) != longest:
            longest = length
            yield np.linspace(0, count, number + 1).round().astype(np.intp)[:-1]


def _numbers(count: int) -> Iterator[int]:
    """Numbers of blocks, each at first, and then ever fewer: long blocks are what differ."""
    number = 1
    while number < count:
        yield number
        number += max(1, number // 8)
