"""The table of a surface's Mueller matrices, and what its interpolation misses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import RegularGridInterpolator

from goniometer.pbsdf.axes import Axes, fitting_axes, random_pairs, relative_error
from goniometer.pbsdf.half_angles import Reflectance, mueller_in_facet_frames
from model.geometry import FloatArray

NODES = 200_000
"""Directions in a table: Mueller matrices in single precision for five wavelengths make at most 64 MB of them."""

_PAIRS = 20_000
_SEED_OF_AXES, _SEED_OF_JUDGEMENT = 0, 1
"""A table is judged by other directions than those by which it was made."""


@dataclass(frozen=True)
class InterpolationError:
    """How far matrices out of a table are from the surface's own, as `relative_error` counts it, over random pairs."""

    median: float
    p95: float
    p99: float

    def __str__(self) -> str:
        """The three in percent."""
        return f"{self.median:.1%} (median), {self.p95:.1%} (of 95 %), {self.p99:.1%} (of 99 % of all directions)"


@dataclass(frozen=True)
class Table:
    """Mueller matrices in the frames of `mueller_in_facet_frames`; `matrices` has the shape (*axes.shape, 4, 4)."""

    axes: Axes
    matrices: NDArray[np.float32]
    error: InterpolationError


def tabulated(surface: Reflectance, nodes: int = NODES) -> Table:
    """The table of a surface, with angles where it changes most, and its interpolation error.

    Parameters
    ----------
    surface : Reflectance
        What is tabulated.
    nodes : int
        The most directions, 4851 and up; as many matrices are computed, and ten times as many to place them well.
    """
    axes = fitting_axes(surface, nodes, _SEED_OF_AXES)
    angles = (axes.phi_d_rad, axes.theta_d_rad, axes.theta_h_rad)
    matrices = mueller_in_facet_frames(surface, *np.meshgrid(*angles, indexing="ij", sparse=True))
    return Table(axes, matrices.astype(np.float32), _judged(surface, angles, matrices))


def _judged(
    surface: Reflectance, angles: tuple[FloatArray, FloatArray, FloatArray], matrices: FloatArray
) -> InterpolationError:
    pairs = random_pairs(_PAIRS, _SEED_OF_JUDGEMENT)
    found = RegularGridInterpolator(angles, matrices)(np.stack(pairs, axis=-1))
    errors = relative_error(found, mueller_in_facet_frames(surface, *pairs))
    return InterpolationError(*(float(part) for part in np.quantile(errors, (0.5, 0.95, 0.99))))
