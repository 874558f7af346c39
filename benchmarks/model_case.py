"""What is timed: a surface of iron, what is asked of it, and for which directions."""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Callable
from functools import cache, partial
from typing import NamedTuple

import numpy as np
from directions import DIRECTION_SETS
from model_peers import INDEX, SIGMA, WEIGHTS
from numpy.typing import NDArray

from model.lobes import Diffuse, Directional, Lobe, Specular
from model.surface import Surface

DIRECTIONS = 100_000
_LARGEST_KEPT = {-1: 2**30, -3: 2**25}  # malloc.h's M_TRIM_THRESHOLD and M_MMAP_THRESHOLD, this at its largest


class Case(NamedTuple):
    """One cell of the tables.

    Attributes
    ----------
    where : str
        Key of `DIRECTION_SETS`.
    lobes : str
        "three lobes" or "specular alone".
    light : str
        "column" of the Mueller matrix, for unpolarized light, or "Mueller" for all of it.
    precision : str
        "float64" or "float32".
    sigma, asymmetry, bounces
        Of the grooves.
    """

    where: str = "random"
    lobes: str = "three lobes"
    light: str = "column"
    precision: str = "float64"
    sigma: float = SIGMA
    asymmetry: float = 0.0
    bounces: int = 1

    def surface(self) -> Surface:
        rho_s, rho_d, rho_dd = WEIGHTS
        lobes: list[Lobe] = [Specular(rho_s, self.sigma, INDEX, self.asymmetry, self.bounces)]
        if self.lobes == "three lobes":
            lobes += [Diffuse(rho_d, self.sigma), Directional(rho_dd, self.sigma, INDEX)]
        return Surface(lobes)

    def call(self) -> Callable[[], NDArray[np.floating]]:
        """A function without arguments that evaluates all directions."""
        surface = self.surface()
        evaluate = surface.mueller if self.light == "Mueller" else surface.stokes
        return partial(evaluate, *angles(self.where, self.precision))

    def column(self) -> NDArray[np.floating]:
        """Stokes vectors under unpolarized light, (..., 4)."""
        result = self.call()()
        return result[..., 0] if self.light == "Mueller" else result


def keep_memory() -> None:
    """Have the C library keep freed arrays for the next ones.

    By itself it keeps them or maps memory anew by the luck of what lies where, and a new page costs as much as many
    directions.
    """
    libc = ctypes.CDLL(None) if sys.platform == "linux" else None
    if libc is not None and hasattr(libc, "mallopt"):
        for parameter, size in _LARGEST_KEPT.items():
            libc.mallopt(parameter, size)


@cache
def angles(where: str, precision: str) -> tuple[NDArray[np.floating], ...]:
    """Incidence, exit and azimuth; shared, so that no case has the caches to itself."""
    return tuple(angle.astype(precision) for angle in DIRECTION_SETS[where](DIRECTIONS))
