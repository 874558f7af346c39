"""Standard errors of many fits at once."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from goniometer.errors import FitError
from model.fit.bounds import is_held, is_vague
from model.fit.problem import NormalEquations, Places, Problem
from model.fit.uncertainty import uncertainty
from model.geometry import FloatArray

# Variance of a parameter over what it would be if the others were known. Where it is higher, the inverse of the normal
# equations has lost half of its digits, and the Jacobian itself is asked.
_INFLATED = 1e8
_RIDGE = 1e-14


class Errors(NamedTuple):
    """How well b fits know their parameters.

    Attributes
    ----------
    stderr : ndarray
        Shape (b, P); NaN for what is held, and for all of a fit whose data do not determine the rest.
    held : ndarray of bool
        Shape (b, P): parameters at a bound.
    """

    stderr: FloatArray
    held: NDArray[np.bool_]


def standard_errors(problem: Problem, x: FloatArray, which: Places, at: NormalEquations, scatter: FloatArray) -> Errors:
    """Standard errors of fits that ended at x (b, P), and the parameters that have none.

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
    stderr = _of_the_others(problem, x, which, at.normal, held)
    vague = is_vague(problem, x, stderr * larger)
    again = np.flatnonzero(vague.any(axis=1))
    if len(again):
        held[again] |= vague[again]
        stderr[again] = _of_the_others(problem, x[again], which[again], at.normal[again], held[again])
    return Errors(stderr, held)


def _of_the_others(
    problem: Problem, x: FloatArray, which: Places, normal: FloatArray, held: NDArray[np.bool_]
) -> FloatArray:
    lengths2 = np.einsum("bpp->bp", normal)
    lengths = np.sqrt(np.where(lengths2 > 0.0, lengths2, 1.0))
    both = ~(held[:, :, None] | held[:, None, :])
    likeness = np.where(both, normal / (lengths[:, :, None] * lengths[:, None, :]), np.eye(x.shape[1]))
    # The ridge, which moves no digit of what is kept, lets a singular matrix be inverted to something huge.
    inflated = np.einsum("bpp->bp", np.linalg.inv(likeness + _RIDGE * np.eye(x.shape[1])))
    stderr = np.where(held, np.nan, np.sqrt(np.abs(inflated)) / lengths)
    for one in np.flatnonzero(~(np.abs(inflated) < _INFLATED).all(axis=1)):
        inside = ~held[one]
        jacobian = problem.difference(x[one : one + 1], which[one : one + 1]).jacobian[0][inside]
        try:
            stderr[one, inside] = uncertainty(jacobian, [""] * len(jacobian)).stderr
        except FitError:
            stderr[one] = np.nan
    return stderr
