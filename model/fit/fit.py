"""Fit surfaces to data: a global search, bounded least squares, standard errors, and what else a person must know."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from scipy.special import chdtri

from goniometer.errors import FitError
from model.fit.bounds import off_bounds
from model.fit.conclusion import conclude
from model.fit.dataset import OBJECTIVES, Dataset, Objective
from model.fit.family import SurfaceFamily, whole_family
from model.fit.levenberg_marquardt import minimise
from model.fit.noisy_ratios import noisy_ratios
from model.fit.problem import Problem
from model.fit.result import FitResult
from model.fit.rough_search import starts
from model.fit.start import Search
from model.fit.weights import projected
from model.geometry import FloatArray
from model.surface import Surface

_SEARCHES = ("sobol", "genetic")
# Steps, and the share of chi-square that each must promise. A fit that follows a scan ends sooner: what is left is some
# hundredths of a standard error, and the next point moves the optimum by more; along a valley it goes on next time.
_MOST_STEPS, _SETTLED = 1000, 1e-12
_FOLLOWING_STEPS, _FOLLOWED = 25, 1e-6
_TOLERATED = 0.05


def fit(
    data: Dataset,
    surface: Surface | SurfaceFamily,
    *,
    objective: Objective = "stokes",
    search: Search = "sobol",
    robust: bool = False,
    start: Mapping[str, float] | None = None,
    seed: int = 0,
) -> FitResult:
    """Find the surface that fits data best, in the sense of least squares of whitened residuals.

    Parameters
    ----------
    data : Dataset
        What was measured, with its errors.
    surface : Surface or SurfaceFamily
        Surfaces to choose from; a bare surface stands for all that have its lobes (`whole_family`).
    objective : {"stokes", "normalised", "dolp", "rms"}
        What is compared: the values as they are, divided by the first, or only the degree of linear polarization;
        "rms" is the paper's deviation, eq. (14), of the latter with equal weights. Ratios have no scale: then the first
        free weight is held at 1, and the others count in it.
    search : {"sobol", "genetic"}
        How starts are found: a low-discrepancy set of which the best are polished, or differential evolution.
    robust : bool
        Whether a direction far from the fit counts by its distance instead of the square (Huber 1964), so that few
        outliers cannot bend it. In any case they are listed in the result, and none is left out.
    start : mapping of str to float, optional
        Values of parameters to start from instead of a search; best weights are found for weights not given. Fast, but
        local: if chi_square is far above degrees_of_freedom afterwards, fit again without it.
    seed : int
        Seed of the search; the same seed gives the same result.

    Returns
    -------
    FitResult
        Standard errors follow from the data's covariances and are not rescaled by chi_square; where the data have none,
        they follow from the scatter about the fit.

    Raises
    ------
    FitError
        If there are fewer values than parameters, if the data leave parameters undetermined, or if least squares does
        not settle.
    ValueError
        If the start lacks a shape or lies outside the bounds, or a choice is unknown.
    """
    if search not in _SEARCHES:
        raise ValueError(f"search is '{search}'; allowed is one of {list(_SEARCHES)}.")
    problem, compared, held = _problem(data, surface, objective, robust)
    if start is None:
        begins = starts(compared, problem, search, seed)
    else:
        begins = off_bounds(problem.family, _checked_start(problem, start))
    problem = problem.resolving(begins)
    ends = minimise(problem, begins, np.zeros(len(begins), np.int64), most_steps=_MOST_STEPS, settled=_SETTLED)
    best = int(np.argmin(np.nan_to_num(ends.cost, nan=np.inf)))
    if not ends.settled[best]:
        raise FitError(
            f"Least squares had not settled after {ends.steps[best]} steps, because {compared.name} hardly tell the "
            f"values of {', '.join(problem.family.names)} apart. No result is given. Measure more directions, or fix "
            f"one of them."
        )
    result = conclude(problem, compared, ends, best, held, start is None)
    return replace(result, biased=int(noisy_ratios(data, compared).sum()))


def follow(
    data: Dataset,
    surface: Surface | SurfaceFamily,
    last: FitResult,
    *,
    objective: Objective = "stokes",
    robust: bool = False,
) -> FitResult:
    """Follow an optimum to data that have grown a little, in a few milliseconds, as a fit beside a running scan does.

    It ends some hundredths of a standard error before the optimum, or after so many steps; from there the next one goes
    on. For a final result, or if chi_square is far above degrees_of_freedom afterwards, `fit`.

    Parameters
    ----------
    data, surface, objective, robust
        As for `fit`.
    last : FitResult
        The fit of the data before they grew.

    Raises
    ------
    FitError
        As for `fit`, but for least squares that have not settled.
    """
    problem, compared, held = _problem(data, surface, objective, robust)
    begin = off_bounds(problem.family, _checked_start(problem, last.values))
    problem = problem.resolving(begin)
    end = minimise(problem, begin, np.zeros(1, np.int64), most_steps=_FOLLOWING_STEPS, settled=_FOLLOWED)
    return replace(conclude(problem, compared, end, 0, held, False), biased=int(noisy_ratios(data, compared).sum()))


def _problem(
    data: Dataset, surface: Surface | SurfaceFamily, objective: Objective, robust: bool
) -> tuple[Problem, Dataset, dict[str, float]]:
    """What is to be minimised, the data in the form in which they are compared, and what must be held."""
    if objective not in OBJECTIVES:
        raise ValueError(f"objective is '{objective}'; allowed is one of {list(OBJECTIVES)}.")
    family = surface if isinstance(surface, SurfaceFamily) else whole_family(surface)
    compared = data.compared_by(objective)
    family, held = _without_scale(family, compared)
    _require_enough(compared, family)
    if robust and compared.covariance is None:
        raise FitError(
            f"A robust fit needs to know which distance is far, and {compared.name} have no errors. Nothing was "
            f"fitted. Give standard errors, or fit without robust."
        )
    if family.prior and compared.covariance is None:
        raise FitError(
            f"What is known of {' and '.join(family.prior)} beforehand cannot be weighed against {compared.name}, "
            f"which count without errors here. Nothing was fitted. Give standard errors, or leave the prior out."
        )
    tolerated = float(np.sqrt(chdtri(compared.values.shape[1], _TOLERATED))) if robust else np.inf
    return Problem.of(compared, family, tolerated), compared, held


def _checked_start(problem: Problem, start: Mapping[str, float]) -> FloatArray:
    family = problem.family
    for name in (*family.shapes, *family.weights, *family.instrument):
        low, high = family.free[name]
        if (name in start and not low <= start[name] <= high) or (name in family.shapes and name not in start):
            raise ValueError(f"start has {name} = {start.get(name)}; it needs a value from {low:g} to {high:g}.")
    x = np.array([[start.get(name, np.nan) for name in family.names]])
    missing = np.isnan(x)
    if missing.any():
        middle = np.clip(1.0, problem.low, problem.high)
        guessed, _ = projected(problem, np.where(missing, middle, x), 0)
        x = np.where(missing, guessed, x)
    return x


def _without_scale(family: SurfaceFamily, data: Dataset) -> tuple[SurfaceFamily, dict[str, float]]:
    """Of a family seen by ratios of light the first free weight is the unit of the others."""
    if data.observable.has_scale:
        return family, {}
    if "gain" in family.free:
        raise ValueError("gain is free; ratios of light do not depend on it. Leave it out.")
    held_weights = any(
        key not in family.free and key not in family.tied
        for lobe in family.lobes
        for key in [family.key(lobe, name) for name in lobe.values if name.startswith("rho_")]
    )
    if held_weights or not family.weights:
        return family, {}
    known = [name for name in family.weights if name in family.prior]
    if known:
        raise ValueError(f"a prior is given for {known[0]}; ratios of light tell weights only in units of another.")
    unit = family.weights[0]
    return family.holding(unit, 1.0), {unit: 1.0}


def _require_enough(data: Dataset, family: SurfaceFamily) -> None:
    known = data.values.size + len(family.prior)
    if known < len(family.names):
        raise FitError(
            f"{data.values.size} values ({len(data)} directions) cannot determine {len(family.names)} parameters "
            f"({', '.join(family.names)}). Nothing was fitted. Measure more directions."
        )
    same = bool((data.values == data.values[0]).all()) and len(data) > 1
    if same and any(np.ptp(angle) > 0.0 for angle in data.directions):
        raise FitError(
            f"All {len(data)} rows of {data.name} hold the same values, though their directions differ: the detector "
            f"was stuck, saturated or dark, or there is no polarization. Nothing was fitted. Measure again."
        )
    polarized = [place for place, name in enumerate(data.observable.columns) if name in ("s1", "s2", "s3")]
    if (
        polarized
        and not data.values[:, polarized].any()
        and {"n", "k"} & {name.split(".")[-1] for name in family.names}
    ):
        raise FitError(
            f"No row of {data.name} shows any polarization, not even noise: the index cannot be found. Nothing was "
            f"fitted. Look whether the analyzer turns, or fix n and k."
        )
