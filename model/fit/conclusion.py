"""From where least squares ended to what a person must know of it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc, chdtri

from model.fit.dataset import Dataset
from model.fit.determined import Determined, determined
from model.fit.family import SurfaceFamily
from model.fit.levenberg_marquardt import Optimum
from model.fit.problem import Problem
from model.fit.result import Alternative, Estimate, FitResult, Outlier
from model.fit.weakness import weakness
from model.geometry import FloatArray

_EXCESS, _SAME, _MOVED = 4.0, 0.3, 1e-2
_UNLIKELY = 0.01


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
    family = problem.family
    end = determined(problem, data, ends.x[best])
    known, names = end.known, _chosen(family.names, end.inside)
    fitted = end.at.values[0]
    chi_square = end.cost if data.covariance is not None else float(end.freedom)
    errors = dict(zip(names, known.stderr.tolist(), strict=True))
    values = dict(zip(family.names, end.x.tolist(), strict=True))
    at_bound = _chosen(family.names, end.at_bound)
    return FitResult(
        parameters={name: Estimate(value, errors.get(name), name in at_bound) for name, value in values.items()},
        chi_square=chi_square,
        degrees_of_freedom=end.freedom,
        p_value=float(chdtrc(end.freedom, chi_square)) if data.covariance is not None and end.freedom > 0 else None,
        rms=float(np.sqrt(np.mean((fitted - data.values.T) ** 2))),
        names=names,
        correlation=known.correlation,
        condition=known.condition,
        weakness=weakness(family, data, end.x, names, known) if searched else None,
        alternatives=_alternatives(family, ends, best, end),
        outliers=_outliers(end.left / end.scale),
        held=held,
        fitted=fitted.T,
        stokes=fitted[:3].T if data.observable.columns[:3] == ("s0", "s1", "s2") else problem.stokes(end.x),
        surface=family.seen(values),
        columns=data.observable.columns,
    )


def _chosen(names: tuple[str, ...], inside: NDArray[np.bool_]) -> tuple[str, ...]:
    return tuple(name for name, is_inside in zip(names, inside, strict=True) if is_inside)


def _alternatives(family: SurfaceFamily, ends: Optimum, best: int, end: Determined) -> tuple[Alternative, ...]:
    found: list[Alternative] = []
    taken = [end.x]
    for place in np.argsort(ends.cost):
        excess = float(ends.cost[place] - ends.cost[best]) / end.scale**2
        if not (ends.settled[place] and excess < _EXCESS):
            continue
        if all(_differ(ends.x[place], other, end) for other in taken):
            taken.append(ends.x[place])
            found.append(Alternative(dict(zip(family.names, ends.x[place].tolist(), strict=True)), excess))
    return tuple(found)


def _differ(one: FloatArray, other: FloatArray, end: Determined) -> bool:
    apart, inside = np.abs(one - other), end.inside
    return bool(
        (apart[inside] > _SAME * end.known.stderr).any()
        or (apart[~inside] > _MOVED * np.maximum(np.abs(one[~inside]), _MOVED)).any()
    )


def _outliers(left: FloatArray) -> tuple[Outlier, ...]:
    width, count = left.shape
    length2 = (left * left).sum(axis=0)
    strange = np.flatnonzero(length2 > chdtri(width, _UNLIKELY / count))
    worst_first = strange[np.argsort(-length2[strange])]
    return tuple(Outlier(int(row), float(np.sqrt(length2[row]))) for row in worst_first)
