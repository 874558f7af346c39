"""Where a fit begins: points of the unit box, found without a first guess."""

from __future__ import annotations

from typing import Literal

import numpy as np
from scipy.optimize import differential_evolution
from scipy.stats import qmc

from model.geometry import FloatArray
from model.varpro import Projection

Search = Literal["sobol", "genetic"]


def sobol_starts(projection: Projection, seed: int) -> list[FloatArray]:
    """The best four of 64 scrambled Sobol points, best first."""
    points = qmc.Sobol(projection.dimension, scramble=True, seed=seed).random(64)
    return sorted(points, key=projection.chi_square)[:4]


def genetic_starts(projection: Projection, seed: int) -> list[FloatArray]:
    """The one point that differential evolution ends at, the paper's genetic stage."""
    bounds = [(0.0, 1.0)] * projection.dimension
    evolved = differential_evolution(projection.chi_square, bounds, seed=seed, tol=1e-3, polish=False)
    return [np.asarray(evolved.x, dtype=np.float64)]
