"""Where least squares starts: found on a simpler problem than the one to solve, where that one is slow.

Cones cost a hundred directions for one, and robust costs have optima of their own where a start is poor.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from model.fit.bounds import off_bounds
from model.fit.dataset import Dataset
from model.fit.family import SurfaceFamily
from model.fit.instrument import ANGLES
from model.fit.levenberg_marquardt import minimise
from model.fit.problem import Problem
from model.fit.start import Search, genetic_start, sobol_starts
from model.geometry import FloatArray

_POLISHED, _STEPS, _SETTLED = 4, 30, 1e-6
_CLOSE = 1e-3
_CONES = 3.0
_ONE = np.zeros(1, np.int64)


def starts(data: Dataset, problem: Problem, search: Search, seed: int) -> FloatArray:
    """Points (b, P) to start least squares from, each next to an optimum of its own as far as can be told.

    Parameters
    ----------
    data : Dataset
        The problem's data.
    problem : Problem
        What is to be minimised.
    search : {"sobol", "genetic"}
        How points are found.
    seed : int
        Of the search.
    """
    rough = problem
    if np.isfinite(problem.tolerated) or problem.family.detector_half_angle_rad:
        # What a cone averages away moves the optimum by less than starts are apart.
        rough = Problem.of(_away_from_the_pole(data, problem.family), problem.family.in_single_directions())
    starts = (
        genetic_start(rough, 0, seed)[None]
        if search == "genetic"
        else sobol_starts(rough, _ONE, _polished(problem), seed)[0]
    )
    if rough is problem:
        return starts
    ends = minimise(rough, starts, np.zeros(len(starts), np.int64), most_steps=_STEPS, settled=_SETTLED)
    order = np.argsort(np.nan_to_num(ends.cost, nan=np.inf))
    apart: list[FloatArray] = []
    for x in ends.x[order]:
        if not any(np.allclose(x, other, rtol=_CLOSE, atol=_CLOSE * np.abs(x).max()) for other in apart):
            apart.append(x)
    # Where the simpler problem has no k, this one may have some, but no slope that leads to it.
    return off_bounds(problem.family, np.array(apart))


def _polished(problem: Problem) -> int:
    # Arms off their zero, and weights that are searched too, make more valleys.
    many = not problem.observable.is_linear or any(name in ANGLES for name in problem.family.names)
    return 4 * _POLISHED if many else _POLISHED


def _away_from_the_pole(data: Dataset, family: SurfaceFamily) -> Dataset:
    """The data without what was measured around the mirror direction, where a cone sees other things than its axis.

    Where that leaves too little, all of them, beside the pole by as much as makes 1/ϱ what its mean over the cone is.
    """
    off = np.abs(data.exit_rad - data.incidence_rad)
    forward = np.cos(data.azimuth_rad) < 0.0
    away = ~forward | (off > _CONES * family.detector_half_angle_rad)
    if data.values[away].size > 2 * len(family.names):
        return data.some(away)
    aside = family.detector_half_angle_rad / 2.0
    close = forward & (off < aside)
    return replace(data, exit_rad=np.where(close, np.maximum(data.incidence_rad - aside, 0.0), data.exit_rad))
