"""A fit between the exit angles that were measured: the light that it has there, as the instrument reports it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from acquisition.fit_points import directions
from acquisition.readings import StokesPoint
from model.fit import FitResult, SurfaceFamily
from model.fit.observable import Elements
from model.fit.problem import Problem
from model.geometry import FloatArray

_STEPS = 240
"""Into how many steps a curve parts the range of exit angles: a picture shows no finer ones."""


@dataclass(frozen=True, eq=False)
class FittedCurve:
    """Fitted S0, S1, S2 (K, 3) in 1/sr, as the instrument reports them, at exit angles (K,) in degrees, upwards."""

    exit_deg: FloatArray
    stokes: FloatArray


def fitted_curve(points: Sequence[StokesPoint], family: SurfaceFamily, fit: FitResult) -> FittedCurve:
    """The fit at all exit angles of a scan in one plane, and evenly between.

    Parameters
    ----------
    points : sequence of StokesPoint
        The scan.
    family : SurfaceFamily
        What was fitted.
    fit : FitResult
        The best of the family.
    """
    exit_deg = filled(np.array([point.exit_deg for point in points]))
    incidence_deg = np.full(len(exit_deg), np.mean([point.incidence_deg for point in points]))
    there = directions(
        incidence_deg, exit_deg, exit_azimuth_deg=np.mean([one.exit_azimuth_deg or 0.0 for one in points])
    )
    return FittedCurve(exit_deg, fitted_stokes(family, fit, there))


def filled(exit_deg: FloatArray) -> FloatArray:
    """Exit angles (N,), each once and upwards, and so many evenly between that a curve looks smooth."""
    return np.union1d(exit_deg, np.linspace(exit_deg.min(), exit_deg.max(), _STEPS + 1))


def fitted_stokes(
    family: SurfaceFamily, fit: FitResult, directions_rad: tuple[FloatArray, FloatArray, FloatArray]
) -> FloatArray:
    """S0, S1, S2 (K, 3) of a family's fit under unpolarized light, at incidence, exit and azimuth (K,) in rad."""
    for name, value in fit.held.items():
        family = family.holding(name, value)
    nothing, whitener = np.zeros((1, 3, len(directions_rad[0]))), np.ones((1, 3, 3, 1))
    problem = Problem(family, Elements(), directions_rad, nothing, whitener)
    return problem.stokes(np.array([fit.values[name] for name in family.names]))
