"""Starts for many fits whose data were measured in the same directions: the light of the points is the same for all."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from model.fit.problem import Problem, whitened
from model.geometry import FloatArray

_RIDGE = 1e-13
_DARK = 1e-12
# What so many points, or sets of values, need at a time fits the caches.
_AT_ONCE, _SETS_AT_ONCE = 32, 128
_ONE_THREAD = 200_000


class SharedLight:
    """The light of points of a family's parameters, ready to be compared with many sets of data.

    Parameters
    ----------
    problem : Problem
        Any with these directions; only what it says of light counts.
    points : ndarray
        Shape (Q, P); what they hold for weights does not count where the light is linear in these.
    """

    def __init__(self, problem: Problem, points: FloatArray) -> None:
        family = problem.family
        linear = problem.observable.is_linear
        self._places = [family.names.index(name) for name in family.weights] if linear else []
        self._points = points.copy()
        self._points[:, self._places] = 0.0
        self._low, self._high = problem.low[self._places], problem.high[self._places]
        first = np.zeros(_AT_ONCE, np.int64)
        held, columns = [], []
        for at in range(0, len(points), _AT_ONCE):
            some = self._points[at : at + _AT_ONCE]
            light, slopes = problem.light(some, first[: len(some)])
            held.append(light)
            columns.append(slopes[:, self._places])
        self._held, self._columns = np.concatenate(held), np.concatenate(columns)

    def best(self, values: FloatArray, whitener: FloatArray, count: int) -> FloatArray:
        """The best points, with the best weights, for sets of values.

        Parameters
        ----------
        values : ndarray
            Shape (b, M, N).
        whitener : ndarray
            Shape (M, M, N): what is about right for all of them; starts need no more.
        count : int
            How many points for each.

        Returns
        -------
        ndarray
            Shape (b, count, P), best first.
        """
        points = len(self._points)
        held = whitened(whitener, self._held).reshape(points, -1)
        columns = whitened(whitener, self._columns).reshape(points, len(self._places), held.shape[1])
        lengths = np.sqrt(np.einsum("qlr,qlr->ql", columns, columns))
        seen = lengths > _DARK * lengths.max(axis=1, initial=0.0, keepdims=True)
        unit = np.where(seen, 1.0 / np.where(seen, lengths, 1.0), 0.0)
        columns *= unit[:, :, None]
        gram = columns @ columns.swapaxes(1, 2)
        starts = np.empty((len(values), count, self._points.shape[1]))
        for at in range(0, len(values), _SETS_AT_ONCE):
            block = slice(at, at + _SETS_AT_ONCE)
            target = whitened(whitener, values[block]).reshape(-1, held.shape[1])
            right = [
                _products(target, columns[:, i]) - (columns[:, i] * held).sum(axis=1) for i in range(len(self._places))
            ]
            fixed = np.zeros((len(target), points))
            if held.any():
                fixed += (held * held).sum(axis=1) - 2.0 * _products(target, held)
            weights, cost = _weighed(gram, right, fixed, only_best=count == 1)
            cost = np.where(np.isfinite(cost), cost, np.inf)
            chosen = np.argsort(cost, axis=1)[:, :count] if count > 1 else np.argmin(cost, axis=1)[:, None]
            starts[block] = self._points[chosen]
            for i, place in enumerate(self._places):
                found = np.take_along_axis(weights[i], chosen, axis=1) * unit[chosen, i]
                starts[block, :, place] = np.clip(found, self._low[i], self._high[i])
        return starts


def _products(sets: FloatArray, points: FloatArray) -> FloatArray:
    """Products (b, Q) of all rows of (b, R) and (Q, R).

    In blocks so small that the library does each in one thread: every core has pixels of its own to see to.
    """
    size = max(1, _ONE_THREAD // points.size)
    products = np.empty((len(sets), len(points)))
    for at in range(0, len(sets), size):
        np.matmul(sets[at : at + size], points.T, out=products[at : at + size])
    return products


def _weighed(
    gram: FloatArray, right: list[FloatArray], fixed: FloatArray, *, only_best: bool
) -> tuple[list[FloatArray], FloatArray]:
    """Weights w >= 0 that minimise w·gram·w - 2 right·w + fixed, and the minima; one array (b, Q) for each weight.

    The matrices (Q, L, L) are shared by all sets, so that every choice of weights above 0 is solved for once and then
    only multiplied. If only the best point counts, no more than that is sure to be right.
    """
    weights, cost = [np.zeros_like(fixed) for _ in right], fixed.copy()
    unsure = np.arange(len(fixed))
    if only_best:
        # Bounds make nothing better: where the best point needs none, the other choices need not be tried.
        weights, cost = _solved(gram, right, fixed, tuple(range(len(right))))
        best = np.argmin(cost, axis=1)
        unsure = np.flatnonzero(~np.all([weight[range(len(best)), best] >= 0.0 for weight in weights], axis=0))
        right, fixed = [one[unsure] for one in right], fixed[unsure]
    others, lowest = [np.zeros_like(fixed) for _ in right], fixed.copy()
    for size in range(1, len(right) + 1):
        for some in combinations(range(len(right)), size):
            found, value = _solved(gram, right, fixed, some)
            better = value < lowest
            for weight in found:
                better &= weight >= 0.0
            lowest = np.where(better, value, lowest)
            others = [np.where(better, new, old) for new, old in zip(found, others, strict=True)]
    cost[unsure] = lowest
    for weight, other in zip(weights, others, strict=True):
        weight[unsure] = other
    return weights, cost


def _solved(
    gram: FloatArray, right: list[FloatArray], fixed: FloatArray, some: tuple[int, ...]
) -> tuple[list[FloatArray], FloatArray]:
    """Weights of which all but some are 0, without a bound, and the minima."""
    inverse = np.linalg.inv(gram[np.ix_(range(len(gram)), some, some)] + _RIDGE * np.eye(len(some)))
    weights, cost = [np.zeros((1, 1)) for _ in right], fixed
    for i, one in enumerate(some):
        weights[one] = sum((inverse[:, i, j] * right[other] for j, other in enumerate(some)), np.zeros(()))
        cost = cost - weights[one] * right[one]
    return weights, cost
