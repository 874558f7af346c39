"""Standard errors of many fits at once."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from goniometer.errors import FitError
from model.fit.bounds import is_held, is_vague, reach
from model.fit.problem import NormalEquations, Places, Problem
from model.fit.uncertainty import uncertainty
from model.geometry import FloatArray

# Variance of a parameter over what it would be if the others were known. Where it is higher, the inverse of the normal
# equations has lost half of its digits, and the Jacobian itself is asked.
_INFLATED = 1e8
_RIDGE = 1e-14
# The variance of what may be anywhere between two bounds is the square of their distance over this.
_EVEN = 12.0


class Errors(NamedTuple):
    """How well b fits know their parameters.

    Attributes
    ----------
    stderr : ndarray
        Shape (b, P); NaN for what is held or open, and for all of a fit whose data do not determine the rest.
    held : ndarray of bool
        Shape (b, P): parameters at a bound.
    determined : ndarray of bool
        Shape (b,): fits whose data determine the rest.
    """

    stderr: FloatArray
    held: NDArray[np.bool_]
    determined: NDArray[np.bool_]


def standard_errors(problem: Problem, x: FloatArray, which: Places, at: NormalEquations, scatter: FloatArray) -> Errors:
    """Standard errors of fits that ended at x (b, P), and the parameters that have none.

    What the data know less of than its bounds is open: the others' errors take it to be anywhere between these.

    Parameters
    ----------
    problem : Problem
        What was minimised.
    x : ndarray
        Shape (b, P), where it ended.
    which : ndarray of int
        Shape (b,), for which sets of data.
    at : NormalEquations
        There.
    scatter : ndarray
        Shape (b,): about how much larger errors are than the whitening has them, to tell what is close to a bound;
        standard errors are those of the whitening.
    """
    larger = scatter[:, None]
    held = is_held(problem, x, at.gradient, np.einsum("bpp->bp", at.normal) / larger**2)
    nothing = np.zeros_like(x)
    stderr = _of_the_others(problem, x, which, at.normal, nothing, held)
    vague = is_vague(problem, x, stderr * larger)
    again = np.flatnonzero(vague.any(axis=1))
    if len(again):
        held[again] |= vague[again]
        stderr[again] = _of_the_others(problem, x[again], which[again], at.normal[again], nothing[again], held[again])
    determined = np.asarray((held | np.isfinite(stderr)).all(axis=1))
    _leave_open(problem, x, which, at.normal, held, stderr, reach(problem, x) / larger)
    return Errors(stderr, held, determined)


def _leave_open(
    problem: Problem,
    x: FloatArray,
    which: Places,
    normal: FloatArray,
    held: NDArray[np.bool_],
    stderr: FloatArray,
    far: FloatArray,
) -> None:
    """Take the errors from what is open, one after the other, beginning with what is known least."""
    bounded = np.zeros_like(x)
    again = np.arange(len(x))
    while True:
        excess = np.where((bounded[again] == 0.0) & np.isfinite(stderr[again]), stderr[again] / far[again], 0.0)
        still = excess.max(axis=1, initial=0.0) > 1.0
        again, excess = again[still], excess[still]
        if not len(again):
            break
        most = excess.argmax(axis=1)
        bounded[again, most] = _EVEN / far[again, most] ** 2
        stderr[again] = _of_the_others(problem, x[again], which[again], normal[again], bounded[again], held[again])
    stderr[bounded > 0.0] = np.nan


def _of_the_others(
    problem: Problem,
    x: FloatArray,
    which: Places,
    normal: FloatArray,
    bounded: FloatArray,
    held: NDArray[np.bool_],
) -> FloatArray:
    """Errors (b, P) of what is not held, where bounds tell so much (b, P) besides the data, as one over a variance."""
    normal = normal + bounded[:, :, None] * np.eye(x.shape[1])
    lengths2 = np.einsum("bpp->bp", normal)
    lengths = np.sqrt(np.where(lengths2 > 0.0, lengths2, 1.0))
    both = ~(held[:, :, None] | held[:, None, :])
    likeness = np.where(both, normal / (lengths[:, :, None] * lengths[:, None, :]), np.eye(x.shape[1]))
    # The ridge, which moves no digit of what is kept, lets a singular matrix be inverted to something huge.
    inflated = np.einsum("bpp->bp", np.linalg.inv(likeness + _RIDGE * np.eye(x.shape[1])))
    stderr = np.where(held, np.nan, np.sqrt(np.abs(inflated)) / lengths)
    for one in np.flatnonzero(~(np.abs(inflated) < _INFLATED).all(axis=1)):
        inside = ~held[one]
        jacobian = problem.difference(x[one : one + 1], which[one : one + 1]).jacobian[0]
        jacobian = np.concatenate([jacobian, np.diag(np.sqrt(bounded[one]))], axis=1)[inside]
        try:
            stderr[one, inside] = uncertainty(jacobian, [""] * len(jacobian)).stderr
        except FitError:
            stderr[one] = np.nan
    return stderr
