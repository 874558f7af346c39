"""Where a fit begins: points of the parameters' box, found without a first guess.

Light is linear in the lobes' weights, so that only what shapes the lobes needs a search: for given shapes the best
weights follow from non-negative linear least squares (variable projection; Golub and Pereyra 1973).
"""

from __future__ import annotations

from itertools import combinations
from typing import Literal

import numpy as np

from model.fit.instrument import ANGLES
from model.fit.problem import Places, Problem
from model.fit.quantities import INSTRUMENT, NOMINAL, quantity
from model.geometry import FloatArray

Search = Literal["sobol", "genetic"]

POINTS = 64
"""Points of the low-discrepancy set when weights follow from linear least squares."""
_POINTS_OF_RATIOS = 512
_WIDEST = 4
"""Weights up to which all choices of those above 0 are tried at once."""
_RATIO_BOUNDS = (1e-3, 1e2)
"""Weights that a search of values without a scale draws from, where bounds do not say otherwise."""
_DARK = 1e-12
"""A lobe whose light is this much weaker than the strongest lobe's, at equal weight, is not seen by the data."""


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


def projected(problem: Problem, x: FloatArray, one: int) -> tuple[FloatArray, FloatArray]:
    """Points (b, P) with the best weights in place of theirs, and their costs (b,), for one set of data."""
    family = problem.family
    which = np.full(len(x), one)
    places = [family.names.index(name) for name in family.weights]
    if not places or not problem.observable.is_linear:
        return x, np.nan_to_num(problem.difference(x, which).cost, nan=np.inf)
    x = x.copy()
    x[:, places] = 0.0
    at = problem.difference(x, which)
    # Without weights what is left is the light of lobes whose weights are held, less the data.
    columns, target = at.jacobian[:, places], -at.residuals
    gram = columns @ columns.swapaxes(1, 2)
    weights = non_negative(gram, np.einsum("bpr,br->bp", columns, target))
    x[:, places] = np.clip(weights, problem.low[places], problem.high[places])
    left = target - np.einsum("bp,bpr->br", x[:, places], columns)
    return x, np.nan_to_num(np.einsum("br,br->b", left, left), nan=np.inf)


def non_negative(gram: FloatArray, right: FloatArray) -> FloatArray:
    """Weights w >= 0 (b, L) that minimise w·gram·w - 2 right·w, for gram (b, L, L) and right (b, L)."""
    lengths = np.sqrt(np.einsum("bll->bl", gram))
    seen = lengths > _DARK * lengths.max(axis=1, initial=0.0, keepdims=True)
    unit = np.where(seen, 1.0 / np.where(seen, lengths, 1.0), 0.0)
    count = right.shape[1]
    scaled = gram * unit[:, :, None] * unit[:, None, :]
    wanted = right * unit
    best = np.zeros_like(right)
    if count > _WIDEST:
        from scipy.optimize import nnls

        for b in range(len(right)):
            root = np.linalg.cholesky(scaled[b] + 1e-13 * np.eye(count))
            best[b] = nnls(root.T, np.linalg.solve(root, wanted[b]))[0]
        return best * unit
    lowest = np.zeros(len(right))
    for size in range(1, count + 1):
        for chosen in combinations(range(count), size):
            some = list(chosen)
            matrix = scaled[:, some][:, :, some] + 1e-13 * np.eye(size)
            weights = np.linalg.solve(matrix + np.eye(size) * ~seen[:, some, None], wanted[:, some, None])[..., 0]
            value = -np.einsum("bl,bl->b", weights, wanted[:, some])
            better = (weights >= 0.0).all(axis=1) & (value < lowest)
            lowest = np.where(better, value, lowest)
            best[better] = 0.0
            best[np.ix_(better, some)] = weights[better]
    return best * unit


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
