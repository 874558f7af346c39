"""Where a fit begins: points of the parameters' box, found without a first guess.

Only what shapes the lobes needs a search, for the best weights follow from it.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from model.fit.instrument import ANGLES
from model.fit.problem import Places, Problem
from model.fit.quantities import INSTRUMENT, NOMINAL, quantity
from model.fit.weights import projected
from model.geometry import FloatArray

Search = Literal["sobol", "genetic"]

POINTS = 64
"""Points of the low-discrepancy set when weights follow from linear least squares."""
_POINTS_OF_RATIOS = 512
_RATIO_BOUNDS = (1e-3, 1e2)
"""Weights that a search of values without a scale draws from, where bounds do not say otherwise."""


def sobol_starts(problem: Problem, which: Places, best: int, seed: int) -> FloatArray:
    """The best of a low-discrepancy set of points for each set of data.

    Parameters
    ----------
    problem : Problem
        What to minimise.
    which : ndarray of int
        Shape (b,), the sets of data.
    best : int
        How many points to return for each.
    seed : int
        Of the set's scrambling.

    Returns
    -------
    ndarray
        Shape (b, best, P), best first.
    """
    points = _Box(problem).spread(seed)
    starts, costs = [], []
    for one in which:
        x, cost = projected(problem, points, int(one))
        order = np.argsort(cost)[:best]
        starts.append(x[order])
        costs.append(cost[order])
    return np.array(starts)


def genetic_start(problem: Problem, one: int, seed: int) -> FloatArray:
    """The one point (P,) that differential evolution of the shapes ends at: the genetic stage of Hao et al. 2023."""
    from scipy.optimize import differential_evolution  # takes longer to load than most commands to run

    box = _Box(problem)

    def cost(units: FloatArray) -> FloatArray:
        at: FloatArray = projected(problem, box.at(units.T.reshape(-1, box.dimension)), one)[1]
        return at if units.ndim > 1 else at[0]

    evolved = differential_evolution(
        cost, [(0.0, 1.0)] * box.dimension, seed=seed, tol=1e-3, polish=False, vectorized=True, updating="deferred"
    )
    start: FloatArray = projected(problem, box.at(np.atleast_2d(evolved.x)), one)[0][0]
    return start


class _Box:
    """The box of what a search varies, as a unit cube: shapes, and weights where they are not found otherwise."""

    def __init__(self, problem: Problem) -> None:
        family = problem.family
        self._problem = problem
        # An arm off its zero makes optima of its own, for the model has edges that it moves over the data.
        self._searched = [*family.shapes, *(name for name in family.instrument if name in ANGLES)]
        if not problem.observable.is_linear:
            self._searched += family.weights
        self.dimension = len(self._searched)
        sides = []
        for name in self._searched:
            low, high = family.free[name]
            if name in family.weights:
                low, high = max(low, _RATIO_BOUNDS[0]), min(high, _RATIO_BOUNDS[1])
            if name in family.prior:
                mean, stddev = family.prior[name]
                low, high = max(low, mean - 3.0 * stddev), min(high, mean + 3.0 * stddev)
                low, high = (low, high) if low < high else family.free[name]
            sides.append((low, high))
        self._low, self._high = np.array(sides, np.float64).reshape(-1, 2).T
        self._logarithmic = np.array(
            [quantity(name).logarithmic or name in family.weights for name in self._searched], bool
        )

    def spread(self, seed: int) -> FloatArray:
        """Points (b, P) that fill the box evenly; one if there is nothing to search."""
        if not self.dimension:
            return self.at(np.zeros((1, 0)))
        from scipy.stats import qmc

        count = POINTS if self._problem.observable.is_linear else _POINTS_OF_RATIOS
        if any(name in ANGLES for name in self._searched):
            count *= 4
        return self.at(qmc.Sobol(self.dimension, scramble=True, seed=seed).random(count))

    def at(self, unit: FloatArray) -> FloatArray:
        """Points (b, P) at places (b, D) of the unit cube; what is not searched is as in a good instrument."""
        problem, family = self._problem, self._problem.family
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.where(self._logarithmic, self._high / self._low, 1.0)
        even = self._low + (self._high - self._low) * unit
        values = np.where(self._logarithmic, self._low * ratio**unit, even)
        x = np.empty((len(unit), len(family.names)))
        for place, name in enumerate(family.names):
            if name in self._searched:
                x[:, place] = values[:, self._searched.index(name)]
            elif name in INSTRUMENT:
                x[:, place] = family.prior[name][0] if name in family.prior else NOMINAL[name]
            else:
                x[:, place] = 1.0
        return np.clip(x, problem.low, problem.high)
