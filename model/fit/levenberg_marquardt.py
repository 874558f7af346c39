"""Levenberg-Marquardt least squares within bounds, for many problems at once.

Each step solves the damped normal equations of the parameters that are not held at a bound by the gradient; what leaves
the box is put on its border, and the others are solved for anew (Levenberg 1944, Marquardt 1963; the damping follows
Nielsen 1999, the projection Kanzow, Yamashita and Fukushima 2004). Normal equations square the condition number, which
slows the last steps of a problem that hardly tells its parameters apart, but does not move where they end: the gradient
that ends them is not made of squares.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from model.fit.problem import Places, Problem
from model.geometry import FloatArray

_FIRST_DAMPING, _LEAST_DAMPING, _MOST_DAMPING = 1e-3, 1e-12, 1e16


@dataclass(frozen=True, eq=False)
class Optimum:
    """Where least squares ended, for b problems.

    Attributes
    ----------
    x : ndarray
        Shape (b, P).
    cost : ndarray
        Shape (b,).
    settled : ndarray of bool
        Shape (b,): whether further steps would change nothing that counts.
    steps : ndarray of int
        Shape (b,).
    """

    x: FloatArray
    cost: FloatArray
    settled: NDArray[np.bool_]
    steps: NDArray[np.int64]


def minimise(
    problem: Problem, start: FloatArray, which: Places, *, most_steps: int = 100, settled: float = 1e-12
) -> Optimum:
    """Find the least squares next to each start.

    Parameters
    ----------
    problem : Problem
        What to minimise.
    start : ndarray
        Shape (b, P), within the bounds.
    which : ndarray of int
        Shape (b,): to which of the problem's sets of data each start belongs.
    most_steps : int
        Steps after which the search is given up.
    settled : float
        Share of the cost that a step must promise to be worth taking.
    """
    state = _State(problem, np.clip(start, problem.low, problem.high), which, settled)
    for _ in range(most_steps):
        if not len(state.active):
            break
        state.step()
    return Optimum(state.x, state.cost, state.settled, state.steps)


class _State:
    """Where the search of each problem stands; arrays named `at_…` hold only those that still move."""

    def __init__(self, problem: Problem, x: FloatArray, which: Places, settled: float) -> None:
        self.problem, self.which, self.share = problem, which, settled
        self.x = x.copy()
        self.settled = np.zeros(len(x), bool)
        self.steps = np.zeros(len(x), np.int64)
        self.active = np.arange(len(x))
        self.floor = problem.rounding[which if problem.count > 1 else np.zeros(len(x), np.int64)]
        at = problem.normal_equations(x, which)
        self.cost = at.cost.copy()
        self._gradient, self._normal = at.gradient, at.normal
        self._damping = np.full(len(x), _FIRST_DAMPING)
        self._growth = np.full(len(x), 2.0)
        self._scale: FloatArray = np.zeros_like(x)

    def step(self) -> None:
        problem, now = self.problem, self.active
        x = self.x[now]
        diagonal = np.einsum("bpp->bp", self._normal)
        self._scale = np.maximum(self._scale, diagonal)
        seen = ~problem.unseen(self._scale)
        move = _move(
            x, self._gradient, self._normal, self._damping, np.where(seen, self._scale, 0.0), problem.low, problem.high
        )
        promised = -(2.0 * _dot(self._gradient, move) + _dot(move, np.einsum("bpq,bq->bp", self._normal, move)))
        cost = self.cost[now]
        worthless = promised <= self.share * cost + self.floor[now]
        trial = np.clip(x + move, problem.low, problem.high)
        at = problem.normal_equations(trial, self.which[now])
        gained = cost - at.cost
        better = (gained > 0.0) & np.isfinite(at.cost)
        kept = better & (promised > 0.0)
        ratio = np.where(kept, np.minimum(gained, 2.0 * promised) / np.where(kept, promised, 1.0), 0.0)
        self.x[now[better]], self.cost[now[better]] = trial[better], at.cost[better]
        self._gradient = np.where(better[:, None], at.gradient, self._gradient)
        self._normal = np.where(better[:, None, None], at.normal, self._normal)
        calmer = np.maximum(1.0 / 3.0, 1.0 - (2.0 * np.clip(ratio, 0.0, 1.0) - 1.0) ** 3)
        self._damping = np.where(
            better, np.maximum(self._damping * calmer, _LEAST_DAMPING), self._damping * self._growth
        )
        self._growth = np.where(better, 2.0, 2.0 * self._growth)
        self.steps[now] += 1
        stuck = self._damping > _MOST_DAMPING
        self.settled[now] = worthless
        self._keep(~(worthless | stuck))

    def _keep(self, going: NDArray[np.bool_]) -> None:
        if going.all():
            return
        self.active = self.active[going]
        for name in ("_gradient", "_normal", "_damping", "_growth", "_scale"):
            setattr(self, name, getattr(self, name)[going])


def _move(
    x: FloatArray,
    gradient: FloatArray,
    normal: FloatArray,
    damping: FloatArray,
    scale: FloatArray,
    low: FloatArray,
    high: FloatArray,
) -> FloatArray:
    """The damped step within the box (b, P)."""
    # A parameter that nothing depends on stays where it is.
    free = ~(((x <= low) & (gradient >= 0.0)) | ((x >= high) & (gradient <= 0.0))) & (scale > 0.0)
    move = _solved(normal, damping, -gradient, free, scale)
    beyond = np.flatnonzero(((x + move < low) | (x + move > high)).any(axis=1))
    if len(beyond):
        here, wanted, matrix = x[beyond], move[beyond], normal[beyond]
        inside = np.clip(here + wanted, low, high) - here
        outside = (here + wanted < low) | (here + wanted > high)
        pull = gradient[beyond] + np.einsum("bpq,bq->bp", matrix, np.where(outside, inside, 0.0))
        others = _solved(matrix, damping[beyond], -pull, free[beyond] & ~outside, scale[beyond])
        move[beyond] = np.where(outside, inside, others)
    return np.clip(x + move, low, high) - x


def _solved(
    normal: FloatArray, damping: FloatArray, right: FloatArray, free: NDArray[np.bool_], scale: FloatArray
) -> FloatArray:
    # Unit columns keep the equations of quantities of very different size solvable; what is not free does not move.
    unit = 1.0 / np.sqrt(np.where(free, scale, 1.0))
    matrix = np.where(free[:, :, None] & free[:, None, :], normal, 0.0) * (unit[:, :, None] * unit[:, None, :])
    diagonal = np.einsum("bpp->bp", matrix)
    diagonal += np.where(free, damping[:, None], 1.0)
    step: FloatArray = np.linalg.solve(matrix, np.where(free, right * unit, 0.0)[..., None])[..., 0] * unit
    return step


def _dot(a: FloatArray, b: FloatArray) -> FloatArray:
    product: FloatArray = np.einsum("bp,bp->b", a, b)
    return product
