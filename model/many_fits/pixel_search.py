"""Where fits of pixels begin."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from model.fit.bounds import off_bounds
from model.fit.problem import Places, Problem
from model.fit.start import _Box, sobol_starts
from model.geometry import FloatArray
from model.many_fits.block import Block
from model.many_fits.shared_light import SharedLight


class Search(Protocol):
    """Finds starts."""

    def starts(self, problem: Problem, which: Places, block: Block, count: int) -> FloatArray:
        """The best few starts (b, count, P), best first, for sets of data of these numbers, which the block holds."""


class OwnSearch:
    """A search for every pixel by itself.

    Parameters
    ----------
    seed : int
        Of the low-discrepancy points.
    """

    def __init__(self, seed: int) -> None:
        self._seed = seed

    def starts(self, problem: Problem, which: Places, block: Block, count: int) -> FloatArray:
        """The best few starts; see `Search`."""
        return sobol_starts(problem, which, count, self._seed)


class SharedSearch:
    """A search for pixels that share directions, among points whose light is found once.

    Parameters
    ----------
    problem : Problem
        Any of these pixels.
    whitener : ndarray
        Shape (M, M, N): what is about right for all pixels; starts need no more.
    seed : int
        Of the low-discrepancy points.
    further : ndarray, optional
        Points (Q, P) to join them: where fits of some pixels ended.
    """

    def __init__(self, problem: Problem, whitener: FloatArray, seed: int, further: FloatArray | None = None) -> None:
        points = _Box(problem).spread(seed)
        if further is not None:
            points = np.concatenate([points, off_bounds(problem.family, further)])
        self._light, self._whitener = SharedLight(problem, points), whitener

    def starts(self, problem: Problem, which: Places, block: Block, count: int) -> FloatArray:
        """The best few starts; see `Search`."""
        if block.measured.all():
            return self._light.best(block.values, self._whitener, count)
        starts = np.empty((len(which), count, len(problem.low)))
        # What is missing changes which weights are best: those that miss the same are looked at together.
        patterns, kind = np.unique(block.measured, axis=0, return_inverse=True)
        for number in range(len(patterns)):
            alike = np.flatnonzero(kind.reshape(-1) == number)
            starts[alike] = self._light.best(block.values[alike], self._whitener * patterns[number], count)
        return starts
