"""The best weights of lobes of given shapes.

Light is linear in the weights, so that they follow from non-negative linear least squares (variable projection; Golub
and Pereyra 1973). Ratios of light are not; but that light has a given ratio is a linear condition on it, whose error is
the ratio's times the light that is divided by (Sanathanan and Koerner 1963).
"""

from __future__ import annotations

from itertools import combinations

import numpy as np

from model.fit.problem import Places, Problem
from model.geometry import FloatArray

_WIDEST = 4
"""Weights up to which all choices of those above 0 are tried at once."""
_DARK = 1e-12
"""A lobe whose light is this much weaker than the strongest lobe's, at equal weight, is not seen by the data."""
_ROUNDS = 4
"""How often the light that ratios are divided by is found anew."""

_AT_ONCE = 1 << 16
"""Light of so many points times directions is in memory at a time; of 64 points in a scan of 10 000 it would be 400 MB.
"""


def projected(problem: Problem, x: FloatArray, one: int) -> tuple[FloatArray, FloatArray]:
    """Points (b, P) with the best weights in place of theirs, and their costs (b,), for one set of data."""
    at_once = max(_AT_ONCE // problem.directions, 1)
    if len(x) > at_once:
        parts = [projected(problem, x[first : first + at_once], one) for first in range(0, len(x), at_once)]
        found, costs = zip(*parts, strict=True)
        return np.concatenate(found), np.concatenate(costs)
    family = problem.family
    which = np.full(len(x), one)
    places = [family.names.index(name) for name in family.weights]
    if places and problem.observable.is_linear:
        return _of_light(problem, x.copy(), which, places)
    if places:
        x = _of_ratios(problem, x.copy(), which, places)
    return x, np.nan_to_num(problem.difference(x, which).cost, nan=np.inf)


def _of_light(problem: Problem, x: FloatArray, which: Places, places: list[int]) -> tuple[FloatArray, FloatArray]:
    x[:, places] = 0.0
    at = problem.difference(x, which)
    # Without weights what is left is the light of lobes whose weights are held, less the data.
    columns, target = at.jacobian[:, places], -at.residuals
    x[:, places] = _within(problem, places, columns, target)
    left = target - np.einsum("bp,bpr->br", x[:, places], columns)
    return x, np.nan_to_num(np.einsum("br,br->b", left, left), nan=np.inf)


def _of_ratios(problem: Problem, x: FloatArray, which: Places, places: list[int]) -> FloatArray:
    with np.errstate(invalid="ignore", over="ignore"):
        return _balanced(problem, x, which, places)


def _balanced(problem: Problem, x: FloatArray, which: Places, places: list[int]) -> FloatArray:
    light, slopes = problem.emitted(x, which)
    lobes = slopes[:, places]
    held = light - np.einsum("bl,blen->ben", x[:, places], lobes)
    for _ in range(_ROUNDS):
        condition = problem.condition(held + np.einsum("bl,blen->ben", x[:, places], lobes), which)
        columns = np.einsum("bmen,blen->blmn", condition, lobes).reshape(*lobes.shape[:2], -1)
        target = -np.einsum("bmen,ben->bmn", condition, held).reshape(len(x), -1)
        x[:, places] = _within(problem, places, columns, target)
    return x


def _within(problem: Problem, places: list[int], columns: FloatArray, target: FloatArray) -> FloatArray:
    # A surface that is dark, or beyond all numbers, has no best weights.
    finite = np.isfinite(np.einsum("bpr,bpr->b", columns, columns) + np.einsum("br,br->b", target, target))
    columns, target = np.where(finite[:, None, None], columns, 0.0), np.where(finite[:, None], target, 0.0)
    weights = non_negative(columns @ columns.swapaxes(1, 2), np.einsum("bpr,br->bp", columns, target))
    return np.clip(weights, problem.low[places], problem.high[places])


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
