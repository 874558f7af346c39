"""What data determine where least squares ended: what is at a bound, what is open, and how sure the rest is."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from model.fit.bounds import is_beside, is_held, reach
from model.fit.dataset import Dataset
from model.fit.levenberg_marquardt import minimise
from model.fit.problem import Difference, Problem, whitened
from model.fit.robust import robust_uncertainty
from model.fit.uncertainty import Uncertainty, uncertainty
from model.geometry import FloatArray

_ONE = np.zeros(1, np.int64)
# By how much chi-square may rise when what is beside a bound is put on it.
_NO_WORSE, _STEPS = 1e-2, 30
# The variance of what may be anywhere between two bounds is the square of their distance over this.
_EVEN = 12.0


@dataclass(frozen=True, eq=False)
class Determined:
    """An optimum, and how well the data determine it.

    Attributes
    ----------
    x : ndarray
        Shape (P,).
    at : Difference
        There.
    left : ndarray
        Shape (M, N), whitened residuals as they are, also of a robust problem.
    cost : float
        The sum of their squares, and of those from priors.
    freedom : int
        Values and priors less parameters that are at no bound.
    scale : float
        By how much errors are larger than the whitener has them; NaN if nothing tells.
    at_bound, inside : ndarray of bool
        Shape (P,): parameters at a bound, and those with a standard error. The others are open: the data know less of
        them than their bounds do.
    known : Uncertainty
        Of those inside, where the open ones may be anywhere between their bounds.
    """

    x: FloatArray
    at: Difference
    left: FloatArray
    cost: float
    freedom: int
    scale: float
    at_bound: NDArray[np.bool_]
    inside: NDArray[np.bool_]
    known: Uncertainty


def determined(problem: Problem, data: Dataset, x: FloatArray) -> Determined:
    """Tell what the data determine at an optimum x (P,); what is at a bound but for rounding, or as good, is put there.

    Raises
    ------
    FitError
        If the data leave parameters undetermined.
    """
    end = _end(problem, data, x, problem.difference(x[None], _ONE), np.zeros(len(x), bool))
    gradient = end.at.jacobian @ end.at.residuals[0]
    lengths2 = np.einsum("bpr,bpr->bp", end.at.jacobian, end.at.jacobian)
    held = is_held(problem, x[None], gradient, lengths2 / end.scale**2)[0]
    end = _with_errors(problem, _on_bounds(problem, data, end, held))
    vague = is_beside(problem, x[None])[0] & ~(end.at_bound | end.inside)
    if vague.any():
        # So it is with k beside 0, where reflectance goes with k².
        there = _on_bounds(problem, data, end, held | vague)
        if there.at.cost[0] <= end.at.cost[0] + _NO_WORSE * end.scale**2:
            end = _with_errors(problem, there)
    if np.isnan(end.scale):
        none = np.zeros(len(x), bool)
        return replace(end, inside=none, known=end.known.of(none[end.inside]))
    return end


def _end(problem: Problem, data: Dataset, x: FloatArray, at: Difference, held: NDArray[np.bool_]) -> Determined:
    """An optimum whose parameters have no errors yet."""
    family = problem.family
    left = whitened(np.moveaxis(data.whitener, 0, -1), at.values[0] - data.values.T)
    cost = float((left * left).sum()) + problem.off_priors(x)
    freedom = data.values.size + len(family.prior) - int((~held).sum())
    scale = _scatter(data, max(cost, problem.rounding[0]), freedom)
    return Determined(x, at, left, cost, freedom, scale, held, ~held, uncertainty(np.empty((0, 1)), ()))


def _scatter(data: Dataset, cost: float, freedom: int) -> float:
    """By how much errors are larger than the whitener has them: 1 where they are known, else what the scatter says."""
    if data.covariance is not None:
        return 1.0
    return float(np.sqrt(cost / freedom)) if freedom > 0 and cost > 0.0 else np.nan


def _on_bounds(problem: Problem, data: Dataset, end: Determined, held: NDArray[np.bool_]) -> Determined:
    """The optimum where some parameters are held at the nearer bound."""
    nearer = np.where(end.x - problem.low < problem.high - end.x, problem.low, problem.high)
    x = np.where(held, nearer, end.x)
    if (x == end.x).all():
        return _end(problem, data, x, end.at, held)
    x = minimise(problem.holding(held, x), x[None], _ONE, most_steps=_STEPS).x[0]
    return _end(problem, data, x, problem.difference(x[None], _ONE), held)


def _with_errors(problem: Problem, end: Determined) -> Determined:
    """The optimum with the errors of what is at no bound; what the data know less of than its bounds is left open.

    One after the other, beginning with what is known least: what trades off with it may be known where it has bounds.
    """
    free, far = ~end.at_bound, reach(problem, end.x[None])[0]
    is_open = np.zeros(len(far), bool)
    while True:
        bounded = np.diag(end.scale * np.sqrt(_EVEN) / far)[:, is_open]
        known = _uncertainty(problem, end, free, bounded).scaled(end.scale)
        excess = known.stderr / far[free]
        excess[is_open[free]] = 0.0
        if not (excess > 1.0).any():
            inside = free & ~is_open
            return replace(end, inside=inside, known=known.of(inside[free]))
        is_open[np.flatnonzero(free)[np.nanargmax(excess)]] = True


def _uncertainty(problem: Problem, end: Determined, free: NDArray[np.bool_], bounded: FloatArray) -> Uncertainty:
    names = [name for name, is_free in zip(problem.family.names, free, strict=True) if is_free]
    jacobian = np.concatenate([end.at.jacobian[0], bounded], axis=1)[free]
    if np.isinf(problem.tolerated):
        return uncertainty(jacobian, names)
    return robust_uncertainty(jacobian, end.at.residuals[0], end.left.shape, problem.tolerated, names)
