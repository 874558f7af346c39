"""Fit a family of surfaces to Stokes parameters: a global search, least squares, standard errors."""

from __future__ import annotations

import numpy as np
from scipy.optimize import OptimizeResult, least_squares

from goniometer.errors import FitError
from model.family import SurfaceFamily
from model.fit_result import Estimate, FitResult
from model.geometry import FloatArray
from model.search import Search, genetic_starts, sobol_starts
from model.stokes_data import StokesData
from model.uncertainty import jacobian, standard_errors
from model.varpro import Projection

__all__ = ["Estimate", "FitResult", "StokesData", "SurfaceFamily", "fit"]

_SEARCHES = {"sobol": sobol_starts, "genetic": genetic_starts}
_AT_BOUND = 1e-6
# Steps of least squares: enough to tell the best of several starts, and to end it.
_SHORT, _LONG = 15, 200
# Relative change of chi-square at which least squares ends. A fit that follows a running scan ends sooner: what is left
# is some hundredths of a standard error, and the next point moves the optimum by more.
_SETTLED, _FOLLOWED = 1e-10, 1e-5


def fit(
    data: StokesData,
    family: SurfaceFamily,
    *,
    start: dict[str, float] | None = None,
    search: Search = "sobol",
    seed: int = 0,
) -> FitResult:
    """Find the surface of a family that fits the data best, in the sense of least squares of whitened residuals.

    The lobes' weights are eliminated by non-negative linear least squares, so that only sigma, n and k are searched.

    Parameters
    ----------
    data : StokesData
        Stokes parameters under unpolarized light, with covariances.
    family : SurfaceFamily
        Lobes, free parameters with bounds, fixed parameters.
    start : dict of str to float, optional
        Values of the free ones of sigma, n, k to start from instead of a search, such as the last optimum of a live
        fit. Fast, but local, and ended some hundredths of a standard error before the optimum: for a final result, or
        if chi_square is far above degrees_of_freedom afterwards, fit again without it.
    search : {"sobol", "genetic"}
        How starts are found: 64 quasi-random points, of which the best four are polished, or differential evolution.
    seed : int
        Seed of the search; the same seed gives the same result.

    Returns
    -------
    FitResult
        Standard errors follow from the data's covariances and are not rescaled by chi_square.

    Raises
    ------
    FitError
        If there are fewer values than parameters, if the data leave parameters undetermined, or if least squares does
        not settle.
    ValueError
        If the start lacks a parameter or lies outside the bounds, or the search is unknown.
    """
    if search not in _SEARCHES:
        raise ValueError(f"search is '{search}'; allowed is one of {list(_SEARCHES)}.")
    projection = Projection(data, family)
    parameters = (*family.shapes, *family.weights)
    if data.stokes.size < len(parameters):
        raise FitError(
            f"{data.stokes.size} values ({len(data.stokes)} directions) cannot determine {len(parameters)} parameters "
            f"({', '.join(parameters)}). Nothing was fitted. Measure more directions."
        )
    if not family.shapes:
        return _conclude(data, projection, np.empty(0))
    if start is not None:
        unit = _checked_start(projection, start)
    else:
        starts = _SEARCHES[search](projection, seed)
        unit = min(
            (_polish(projection, rough, _SHORT, _SETTLED) for rough in starts), key=lambda polished: polished.cost
        ).x
    best = _polish(projection, unit, _LONG, _SETTLED if start is None else _FOLLOWED)
    if best.status == 0:
        raise FitError(
            f"Least squares had not settled after {best.nfev} steps, because the data hardly tell the values of "
            f"{', '.join(family.shapes)} apart. No result is given. Measure more directions, or fix one of them."
        )
    return _conclude(data, projection, best.x)


def _checked_start(projection: Projection, start: dict[str, float]) -> FloatArray:
    for name in projection.family.shapes:
        low, high = projection.family.free[name]
        if name not in start or not low <= start[name] <= high:
            raise ValueError(f"start has {name} = {start.get(name)}; it needs a value from {low:g} to {high:g}.")
    return projection.unit(start)


def _polish(projection: Projection, unit: FloatArray, evaluations: int, settled: float) -> OptimizeResult:
    # Noise-free data must give the truth back: their chi-square falls until rounding, and xtol ends the search.
    return least_squares(
        projection.residuals, unit, bounds=(0.0, 1.0), xtol=1e-13, ftol=settled, gtol=1e-15, max_nfev=evaluations
    )


def _conclude(data: StokesData, projection: Projection, unit: FloatArray) -> FitResult:
    family = projection.family
    weights = projection.weights(projection.columns(unit))
    values = {**projection.shapes(unit), **dict(zip(family.weights, weights.tolist(), strict=True))}
    inside = np.concatenate([(unit > _AT_BOUND) & (unit < 1.0 - _AT_BOUND), weights > 0.0])
    names = tuple(name for name, is_inside in zip(values, inside, strict=True) if is_inside)
    stderr, correlation = standard_errors(jacobian(projection, unit, weights)[:, inside], names)
    errors = dict(zip(names, stderr.tolist(), strict=True))
    return FitResult(
        parameters={name: Estimate(value, errors.get(name), name not in errors) for name, value in values.items()},
        chi_square=projection.chi_square(unit),
        degrees_of_freedom=data.stokes.size - len(names),
        names=names,
        correlation=correlation,
        stokes=projection.light(unit) @ weights,
        surface=family.surface(values),
    )
