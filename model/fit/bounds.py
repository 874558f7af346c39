"""Which parameters a fit leaves at a bound, and how not to begin there."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from model.fit.family import SurfaceFamily
from model.fit.problem import Problem
from model.geometry import FloatArray

_AT_BOUND, _BESIDE = 1e-6, 1e-2
_CERTAIN = 1e-2
# An error as many times larger than all weights together leaves a weight open that nothing bounds.
_ALL_WEIGHTS = 100.0
# How far, as a share of its range, a start is moved off a bound: near k = 0 the slope by k is about 0 whatever the data
# say.
_OFF_BOUND = 0.02


def is_held(problem: Problem, x: FloatArray, gradient: FloatArray, lengths2: FloatArray) -> NDArray[np.bool_]:
    """Which parameters (b, P) are at a bound, or so close that the search has but not quite got there.

    At k = 0 reflectance has no slope by k, so that the last of the way is never gone.

    Parameters
    ----------
    problem : Problem
        What was minimised.
    x, gradient, lengths2 : ndarray
        Shape (b, P): where, the gradient there, and the squared lengths of the Jacobian's rows.
    """
    unseen = problem.unseen(lengths2) & problem.is_weight
    width = problem.high - problem.low
    # Of a wide box a small share may be many standard errors: they must be few as well.
    certain = _CERTAIN / np.sqrt(np.where(lengths2 > 0.0, lengths2, np.inf))
    close = np.minimum(np.where(np.isfinite(width), _AT_BOUND * width, 0.0), np.where(lengths2 > 0.0, certain, np.inf))
    at_low = (x <= problem.low + close) & ((gradient >= 0.0) | unseen | (x > problem.low))
    held: NDArray[np.bool_] = at_low | ((x >= problem.high - close) & ((gradient <= 0.0) | (x < problem.high)))
    return held


def reach(problem: Problem, x: FloatArray) -> FloatArray:
    """How far parameters (b, P) can differ at all: the width of their bounds; of a weight without, many times all."""
    weights = np.where(problem.is_weight, x, 0.0).sum(axis=1, keepdims=True)
    unbounded = np.where(problem.is_weight & (weights > 0.0), _ALL_WEIGHTS * weights, np.inf)
    width = problem.high - problem.low
    return np.where(np.isfinite(width), width, unbounded)


def is_beside(problem: Problem, x: FloatArray) -> NDArray[np.bool_]:
    """Which parameters (b, P) are close to one of two bounds, as far apart as these are."""
    width = problem.high - problem.low
    beside: NDArray[np.bool_] = np.isfinite(width) & (np.minimum(x - problem.low, problem.high - x) < _BESIDE * width)
    return beside


def is_vague(problem: Problem, x: FloatArray, stderr: FloatArray) -> NDArray[np.bool_]:
    """Which parameters (b, P) are beside a bound, with an error beyond all bounds: one that says nothing.

    So it is with k beside 0, where reflectance goes with k².
    """
    vague: NDArray[np.bool_] = is_beside(problem, x) & (stderr > problem.high - problem.low)
    return vague


def off_bounds(family: SurfaceFamily, x: FloatArray) -> FloatArray:
    """Points (b, P), where those that have a shape at its bound, or beside it, have it a little within."""
    x = x.copy()
    for name in family.shapes:
        place, (low, high) = family.names.index(name), family.free[name]
        margin = _OFF_BOUND * (high - low)
        x[:, place] = np.clip(x[:, place], low + margin, high - margin)
    return x
