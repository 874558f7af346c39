"""How far a parameter may go before the data object, with all others free to follow: its profile likelihood."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri

from model.fit.dataset import Dataset, Objective
from model.fit.family import SurfaceFamily
from model.fit.fit import fit
from model.fit.problem import Problem
from model.fit.result import FitResult
from model.geometry import FloatArray

_STEP, _WIDENED, _MOST_STEPS = 0.5, 2.0, 60
# Halvings of the widest step that are tried as a first one; without a bound that is so many standard errors.
_SIZES, _FAR = 40, 100.0
_SLIGHT, _BEYOND = 0.1, float(chdtri(1, 0.01))


@dataclass(frozen=True, eq=False)
class Profile:
    """The least chi-square that is possible for each value of one parameter.

    Attributes
    ----------
    name : str
        The parameter.
    values : ndarray
        Its values, shape (V,), rising.
    excess : ndarray
        By how much chi-square is above that of the fit, shape (V,); where the data have no errors of their own, as
        counted by their scatter.
    best : float
        The value of the fit.
    """

    name: str
    values: FloatArray
    excess: FloatArray
    best: float

    def interval(self, probability: float = 0.95) -> tuple[float, float]:
        """The values that the data do not object to; an end that is a bound of the fit is the last of `values`.

        Parameters
        ----------
        probability : float
            How often such an interval holds the truth, up to 0.99.
        """
        limit = float(chdtri(1, 1.0 - probability))
        return self._end(limit, -1), self._end(limit, 1)

    def _end(self, limit: float, side: int) -> float:
        outwards = (self.values - self.best) * side >= 0.0
        values, excess = self.values[outwards][::side], self.excess[outwards][::side]
        beyond = np.flatnonzero(excess > limit)
        if not beyond.size:
            return float(values[-1])
        last = int(beyond[0])
        if last == 0:
            return float(values[0])
        # Chi-square is close to a parabola, its root to a straight line.
        inner, outer = np.sqrt(np.maximum(excess[last - 1 : last + 1], 0.0))
        share = (np.sqrt(limit) - inner) / (outer - inner)
        return float(values[last - 1] + share * (values[last] - values[last - 1]))


def profile(
    data: Dataset, family: SurfaceFamily, result: FitResult, name: str, *, objective: Objective = "stokes"
) -> Profile:
    """Follow the least chi-square away from a fit, half a standard error at a time, until all data object.

    Parameters
    ----------
    data, family, objective
        As they were fitted.
    result : FitResult
        The fit.
    name : str
        One of its parameters.

    Raises
    ------
    ValueError
        If the fit has no such parameter.
    FitError
        If the others cannot follow.
    """
    if name not in result.parameters:
        raise ValueError(f"the fit has no parameter '{name}'; it has {list(result.parameters)}.")
    for known, value in result.held.items():
        family = family.holding(known, value)
    best = result.parameters[name].value
    found = [(best, 0.0)]
    for side in (-1, 1):
        found += list(_walk(data, family, result, name, side, objective))
    values, excess = np.array(sorted(found)).T
    return Profile(name, values, excess, best)


def _walk(
    data: Dataset, family: SurfaceFamily, result: FitResult, name: str, side: int, objective: Objective
) -> Iterator[tuple[float, float]]:
    estimate = result.parameters[name]
    bound = family.free[name][0 if side < 0 else 1]
    step = _STEP * estimate.stderr if estimate.stderr else _first_step(data, family, result, name, side, objective)
    start, value = dict(result.values), estimate.value
    for _ in range(_MOST_STEPS):
        if value == bound:
            return
        value = max(bound, value - step) if side < 0 else min(bound, value + step)
        held = family.holding(name, value)
        start = {known: number for known, number in start.items() if known in held.free}
        there = fit(data, held, objective=objective, start=start)
        excess = _excess(family, result, there, name, value)
        start = there.values
        yield value, excess
        if excess > _BEYOND:
            return
        # Where chi-square hardly rises, as towards a bound, steps grow.
        step = step if excess > _SLIGHT else _WIDENED * step


def _first_step(
    data: Dataset, family: SurfaceFamily, result: FitResult, name: str, side: int, objective: Objective
) -> float:
    """Where chi-square has risen by as much as in half a standard error, if the others do not follow.

    Beside a bound it may have a slope, or, as by k at 0, no curvature either: steps of all sizes are tried at once.
    """
    place, bound = family.names.index(name), family.free[name][0 if side < 0 else 1]
    best = np.array([result.values[known] for known in family.names])
    problem = Problem.of(data.compared_by(objective), family).resolving(best[None])
    at = problem.difference(best[None], np.zeros(1, np.int64))
    length = float(np.linalg.norm(at.jacobian[0, place]))
    widest = abs(bound - best[place]) if np.isfinite(bound) else _FAR / length if length > 0.0 else 1.0
    steps = widest * 0.5 ** np.arange(_SIZES)
    x = np.repeat(best[None], _SIZES, axis=0)
    x[:, place] += side * steps
    rise = problem.difference(x, np.zeros(_SIZES, np.int64)).cost - at.cost
    limit = _STEP**2 * (1.0 if data.covariance is not None else at.cost[0] / max(result.degrees_of_freedom, 1))
    small = steps[np.logical_and.accumulate((rise <= limit)[::-1])[::-1]]
    return float(small[0]) if len(small) else float(steps[-1])


def _excess(family: SurfaceFamily, result: FitResult, there: FitResult, name: str, value: float) -> float:
    if there.p_value is None:
        # Without errors of their own the data's scatter about the fit is the measure.
        return ((there.rms / result.rms) ** 2 - 1.0) * result.degrees_of_freedom
    mean, stddev = family.prior.get(name, (value, 1.0))
    return there.chi_square + ((value - mean) / stddev) ** 2 - result.chi_square
