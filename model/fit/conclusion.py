"""From where least squares ended to what a person must know of it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc, chdtri

from model.fit.bounds import is_held, is_vague
from model.fit.dataset import Dataset
from model.fit.family import SurfaceFamily
from model.fit.levenberg_marquardt import Optimum
from model.fit.problem import Problem, whitened
from model.fit.result import Alternative, Estimate, FitResult, Outlier
from model.fit.uncertainty import Uncertainty, uncertainty
from model.fit.weakness import weakness
from model.geometry import FloatArray

_EXCESS, _SAME, _MOVED = 4.0, 0.3, 1e-2
_UNLIKELY = 0.01
_ONE = np.zeros(1, np.int64)


def conclude(
    problem: Problem, data: Dataset, ends: Optimum, best: int, held: dict[str, float], searched: bool
) -> FitResult:
    """The result of a fit.

    Parameters
    ----------
    problem : Problem
        What was minimised.
    data : Dataset
        Its data.
    ends : Optimum
        Where least squares ended from each start.
    best : int
        Which of these is the best.
    held : dict of str to float
        What had to be held.
    searched : bool
        Whether nothing was known beforehand, so that there is time for what only a final result needs.

    Raises
    ------
    FitError
        If the data leave parameters undetermined.
    """
    family, x = problem.family, ends.x[best]
    at = problem.difference(x[None], _ONE)
    gradient = at.jacobian[0] @ at.residuals[0]
    lengths2 = np.einsum("bpr,bpr->bp", at.jacobian, at.jacobian)
    fitted = at.values[0]
    left = whitened(np.moveaxis(data.whitener, 0, -1), fitted - data.values.T)
    cost = float((left * left).sum()) + _from_priors(family, x)
    values_known = data.values.size + len(family.prior)
    scale = _scatter(data, max(cost, problem.rounding[0]), values_known - len(x))
    inside = ~is_held(problem, x[None], gradient[None], lengths2 / scale**2)[0]
    known = uncertainty(at.jacobian[0][inside], _chosen(family.names, inside))
    stderr = np.zeros(len(x))
    stderr[inside] = scale * known.stderr
    vague = is_vague(problem, x[None], stderr[None])[0]
    if vague.any():
        inside &= ~vague
        known = uncertainty(at.jacobian[0][inside], _chosen(family.names, inside))
    names = _chosen(family.names, inside)
    freedom = values_known - len(names)
    scale = _scatter(data, max(cost, problem.rounding[0]), freedom)
    chi_square = cost if data.covariance is not None else float(freedom)
    known = known.scaled(scale)
    errors = dict(zip(names, known.stderr.tolist(), strict=True))
    values = dict(zip(family.names, x.tolist(), strict=True))
    return FitResult(
        parameters={name: Estimate(value, errors.get(name), name not in errors) for name, value in values.items()},
        chi_square=chi_square,
        degrees_of_freedom=freedom,
        p_value=float(chdtrc(freedom, chi_square)) if data.covariance is not None and freedom > 0 else None,
        rms=float(np.sqrt(np.mean((fitted - data.values.T) ** 2))),
        names=names,
        correlation=known.correlation,
        condition=known.condition,
        weakness=weakness(family, data, x, names, known) if searched else None,
        alternatives=_alternatives(family, ends, best, scale, known, inside),
        outliers=_outliers(left / scale),
        held=held,
        fitted=fitted.T,
        stokes=fitted[:3].T if data.observable.columns[:3] == ("s0", "s1", "s2") else problem.stokes(x),
        surface=family.seen(values),
        columns=data.observable.columns,
    )


def _scatter(data: Dataset, cost: float, freedom: int) -> float:
    """By how much errors are larger than the whitener has them: 1 where they are known, else what the scatter says."""
    if data.covariance is not None:
        return 1.0
    return float(np.sqrt(cost / freedom)) if freedom > 0 and cost > 0.0 else np.nan


def _chosen(names: tuple[str, ...], inside: NDArray[np.bool_]) -> tuple[str, ...]:
    return tuple(name for name, is_inside in zip(names, inside, strict=True) if is_inside)


def _from_priors(family: SurfaceFamily, x: FloatArray) -> float:
    return sum(
        ((float(x[family.names.index(name)]) - mean) / stddev) ** 2 for name, (mean, stddev) in family.prior.items()
    )


def _alternatives(
    family: SurfaceFamily, ends: Optimum, best: int, scale: float, known: Uncertainty, inside: NDArray[np.bool_]
) -> tuple[Alternative, ...]:
    found: list[Alternative] = []
    taken = [ends.x[best]]
    for place in np.argsort(ends.cost):
        excess = float(ends.cost[place] - ends.cost[best]) / scale**2
        if not (ends.settled[place] and excess < _EXCESS):
            continue
        if all(_differ(ends.x[place], other, known.stderr, inside) for other in taken):
            taken.append(ends.x[place])
            found.append(Alternative(dict(zip(family.names, ends.x[place].tolist(), strict=True)), excess))
    return tuple(found)


def _differ(one: FloatArray, other: FloatArray, stderr: FloatArray, inside: NDArray[np.bool_]) -> bool:
    apart = np.abs(one - other)
    return bool(
        (apart[inside] > _SAME * stderr).any()
        or (apart[~inside] > _MOVED * np.maximum(np.abs(one[~inside]), _MOVED)).any()
    )


def _outliers(left: FloatArray) -> tuple[Outlier, ...]:
    width, count = left.shape
    length2 = (left * left).sum(axis=0)
    strange = np.flatnonzero(length2 > chdtri(width, _UNLIKELY / count))
    worst_first = strange[np.argsort(-length2[strange])]
    return tuple(Outlier(int(row), float(np.sqrt(length2[row]))) for row in worst_first)
