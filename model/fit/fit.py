"""Fit surfaces to data: a global search, bounded least squares, standard errors, and what else a person must know."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc, chdtri

from goniometer.errors import FitError
from model.fit.dataset import OBJECTIVES, Dataset, Objective
from model.fit.family import SurfaceFamily, whole_family
from model.fit.levenberg_marquardt import Optimum, minimise
from model.fit.problem import Problem, whitened
from model.fit.result import Alternative, Estimate, FitResult, Outlier, Weakness
from model.fit.start import Search, genetic_start, projected, sobol_starts
from model.fit.uncertainty import Uncertainty, uncertainty
from model.geometry import FloatArray, in_plane
from model.surface import Surface

_SEARCHES = ("sobol", "genetic")
_POLISHED = 4
_MOST_STEPS, _ROUGH_STEPS, _CLOSE = 1000, 30, 1e-3
# Share of chi-square that a step must promise. A fit that follows a running scan ends sooner: what is left is some
# hundredths of a standard error, and the next point moves the optimum by more.
_SETTLED, _FOLLOWED = 1e-12, 1e-6
_EXCESS = 4.0
_SAME = 0.3
_AT_BOUND, _BESIDE = 1e-6, 1e-2
_TOLERATED = 0.05
_UNLIKELY = 0.01
_ONE = np.zeros(1, np.int64)


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
        Values of parameters to start from instead of a search, such as the last optimum of a live fit; best weights are
        found for weights not given. Fast, but local, and ended some hundredths of a standard error before the optimum:
        for a final result, or if chi_square is far above degrees_of_freedom afterwards, fit again without it.
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
    if objective not in OBJECTIVES:
        raise ValueError(f"objective is '{objective}'; allowed is one of {list(OBJECTIVES)}.")
    family = surface if isinstance(surface, SurfaceFamily) else whole_family(surface)
    compared = data.compared_by(objective)
    family, held = _without_scale(family, compared)
    _require_enough(compared, family)
    tolerated = float(np.sqrt(chdtri(compared.values.shape[1], _TOLERATED))) if robust else np.inf
    problem = Problem.of(compared, family, tolerated)
    if start is not None:
        begins, settled = _checked_start(problem, start), _FOLLOWED
    else:
        begins, settled = _searched(compared, problem, search, seed), _SETTLED
    problem = problem.resolving(begins)
    ends = minimise(problem, begins, np.zeros(len(begins), np.int64), most_steps=_MOST_STEPS, settled=settled)
    best = int(np.argmin(np.nan_to_num(ends.cost, nan=np.inf)))
    if not ends.settled[best]:
        raise FitError(
            f"Least squares had not settled after {ends.steps[best]} steps, because {compared.name} hardly tell the "
            f"values of {', '.join(family.names)} apart. No result is given. Measure more directions, or fix one of "
            f"them."
        )
    return _conclude(problem, compared, ends, best, held, start is None)


def _searched(data: Dataset, problem: Problem, search: Search, seed: int) -> FloatArray:
    """Starts (b, P) for least squares."""
    rough = problem
    if np.isfinite(problem.tolerated) or problem.family.detector_half_angle_rad:
        # What a cone averages away moves the optimum by less than starts are apart.
        rough = Problem.of(_beside_the_pole(data, problem.family), problem.family.in_single_directions())
    starts = (
        genetic_start(rough, 0, seed)[None] if search == "genetic" else sobol_starts(rough, _ONE, _POLISHED, seed)[0]
    )
    if rough is problem:
        return starts
    ends = minimise(rough, starts, np.zeros(len(starts), np.int64), most_steps=_ROUGH_STEPS, settled=_FOLLOWED)
    order = np.argsort(np.nan_to_num(ends.cost, nan=np.inf))
    apart: list[FloatArray] = []
    for x in ends.x[order]:
        if not any(np.allclose(x, other, rtol=_CLOSE, atol=_CLOSE * np.abs(x).max()) for other in apart):
            apart.append(x)
    return np.array(apart)


def _beside_the_pole(data: Dataset, family: SurfaceFamily) -> Dataset:
    """The data as if measured beside the mirror direction by half the cone's angle, where they are closer to it.

    There a pole 1/ϱ is as high as its mean over the cone.
    """
    aside = family.detector_half_angle_rad / 2.0
    forward = np.cos(data.azimuth_rad) < 0.0
    close = forward & (np.abs(data.exit_rad - data.incidence_rad) < aside)
    return replace(data, exit_rad=np.where(close, np.maximum(data.incidence_rad - aside, 0.0), data.exit_rad))


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


def _conclude(
    problem: Problem, data: Dataset, ends: Optimum, best: int, held: dict[str, float], searched: bool
) -> FitResult:
    family, x = problem.family, ends.x[best]
    at = problem.difference(x[None], _ONE)
    gradient = at.jacobian[0] @ at.residuals[0]
    inside = ~_is_held(x, gradient, problem, at.jacobian)
    known = uncertainty(at.jacobian[0][inside], _chosen(family.names, inside))
    vague = np.zeros_like(inside)
    vague[inside] = _is_vague(x[inside], known.stderr, problem.low[inside], problem.high[inside])
    if vague.any():
        inside &= ~vague
        known = uncertainty(at.jacobian[0][inside], _chosen(family.names, inside))
    names = _chosen(family.names, inside)
    fitted = at.values[0]
    left = whitened(np.moveaxis(data.whitener, 0, -1), fitted - data.values.T)
    freedom = data.values.size + len(family.prior) - len(names)
    chi_square = float((left * left).sum()) + _from_priors(family, x)
    scale = 1.0
    if data.covariance is None:
        scale = float(np.sqrt(chi_square / freedom)) if freedom > 0 else np.nan
        chi_square = float(freedom)
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
        weakness=_weakness(family, data, x, names, known) if searched else None,
        alternatives=_alternatives(family, ends, best, scale, known, inside),
        outliers=_outliers(left / scale),
        held=held,
        fitted=fitted.T,
        stokes=fitted[:3].T if data.observable.columns[:3] == ("s0", "s1", "s2") else problem.stokes(x),
        surface=family.seen(values),
        columns=data.observable.columns,
    )


def _is_held(x: FloatArray, gradient: FloatArray, problem: Problem, jacobian: FloatArray) -> NDArray[np.bool_]:
    """Which parameters are at a bound, or so close that the search has but not quite got there.

    At k = 0 reflectance has no slope by k, so that the last of the way is never gone.
    """
    unseen = problem.unseen(np.einsum("bpr,bpr->bp", jacobian, jacobian))[0] & problem.is_weight
    width = problem.high - problem.low
    close = np.where(np.isfinite(width), _AT_BOUND * width, 0.0)
    at_low = (x <= problem.low + close) & ((gradient >= 0.0) | unseen | (x > problem.low))
    held: NDArray[np.bool_] = at_low | ((x >= problem.high - close) & ((gradient <= 0.0) | (x < problem.high)))
    return held


def _is_vague(x: FloatArray, stderr: FloatArray, low: FloatArray, high: FloatArray) -> NDArray[np.bool_]:
    """Which parameters are beside a bound, with an error beyond all bounds: one that says nothing.

    So it is with k beside 0, where reflectance goes with k².
    """
    width = high - low
    vague: NDArray[np.bool_] = (stderr > width) & (np.minimum(x - low, high - x) < _BESIDE * width)
    return vague & np.isfinite(width)


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
    return bool((apart[inside] > _SAME * stderr).any() or (apart[~inside] > 1e-3 * np.abs(one[~inside])).any())


def _outliers(left: FloatArray) -> tuple[Outlier, ...]:
    width, count = left.shape
    length2 = (left * left).sum(axis=0)
    strange = np.flatnonzero(length2 > chdtri(width, _UNLIKELY / count))
    worst_first = strange[np.argsort(-length2[strange])]
    return tuple(Outlier(int(row), float(np.sqrt(length2[row]))) for row in worst_first)


def _weakness(
    family: SurfaceFamily, data: Dataset, x: FloatArray, names: tuple[str, ...], known: Uncertainty
) -> Weakness | None:
    """What the data can hardly tell apart, and where in the plane of incidence a further reading would tell most."""
    if len(names) < 2:
        return None
    exit_deg = np.arange(-80.0, 81.0)
    exit_rad, azimuth_rad = in_plane(np.radians(exit_deg))
    incidence_rad = np.full(len(exit_rad), np.median(data.incidence_rad))
    middle = np.median(np.moveaxis(data.whitener, 0, -1), axis=-1, keepdims=True)[None]
    whitener = np.broadcast_to(middle, (*middle.shape[:-1], len(exit_rad)))
    elsewhere = Problem(
        family.in_single_directions(),
        data.observable,
        (incidence_rad, exit_rad, azimuth_rad),
        np.zeros((1, middle.shape[1], len(exit_rad))),
        whitener,
    )
    rows = elsewhere.difference(x[None], _ONE).jacobian[0][[family.names.index(name) for name in names]]
    change = (known.weakest @ rows)[: middle.shape[1] * len(exit_rad)].reshape(middle.shape[1], -1)
    told = np.nan_to_num((change * change).sum(axis=0), posinf=0.0)
    return Weakness(dict(zip(names, known.weakest.tolist(), strict=True)), float(np.radians(exit_deg[np.argmax(told)])))
