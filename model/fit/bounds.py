"""Which parameters a fit leaves at a bound, and how not to begin there."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from model.fit.family import SurfaceFamily
from model.fit.problem import Problem
from model.geometry import FloatArray

_AT_BOUND, _BESIDE = 1e-6, 1e-2
_CERTAIN = 1e-2
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


def is_vague(problem: Problem, x: FloatArray, stderr: FloatArray) -> NDArray[np.bool_]:
    """Which parameters (b, P) are beside a bound, with an error beyond all bounds: one that says nothing.

    So it is with k beside 0, where reflectance goes with k².
    """
    width = problem.high - problem.low
    beside = np.minimum(x - problem.low, problem.high - x) < _BESIDE * width
    vague: NDArray[np.bool_] = (stderr > width) & beside & np.isfinite(width)
    return vague


def off_bounds(family: SurfaceFamily, x: FloatArray) -> FloatArray:
    """Points (b, P), where those that have a shape at its bound, or beside it, have it a little within."""
    x = x.copy()
    for name in family.shapes:
        place, (low, high) = family.names.index(name), family.free[name]
        margin = _OFF_BOUND * (high - low)
        x[:, place] = np.clip(x[:, place], low + margin, high - margin)
    return x
