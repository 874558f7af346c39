"""How well a model predicts what it was not fitted to: exit angles left out in turn, side by side."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from goniometer.errors import FitError
from model.fit.dataset import Dataset
from model.fit.family import SurfaceFamily
from model.fit.fit import fit
from model.fit.problem import Problem
from model.geometry import FloatArray

FOLDS = 5
_SIDE_BY_SIDE = 4
_ONE = np.zeros(1, np.int64)
# What is left out tells of no parameter more than so many times what the rest does: then its error is known at all.
_MOST_TOLD = 1e12
# A slope this small, against the steepest parameter's, is of rounding.
_NO_SLOPE = 1e-10
# Squares of differences this small, against those of the values, are of rounding.
ROUNDING = 1e-18


@dataclass(frozen=True)
class HeldOut:
    """Predictions of values that were left out of the fit.

    Attributes
    ----------
    deviance : float
        -2 ln of the probability density that the model gave to the values beforehand, but for a constant that is the
        same for all models: on the scale of Akaike's criterion, the lower the better.
    chi_square : float
        Squared differences between values and predictions, in units of the errors of both; of data that do not state
        errors, where those of the values are counted by 1, in units of the values.
    count : int
        How many values were predicted. Where errors are known, a true model has a chi-square of about as much.
    """

    deviance: float
    chi_square: float
    count: int


def folds(data: Dataset) -> list[NDArray[np.bool_]]:
    """Which rows (N,) to leave out at a time: blocks of neighbouring exit angles, so that none is told by the next.

    Each row is left out once. Blocks that are left out together are far from one another, so that no model has to
    predict half of the scan.

    Raises
    ------
    FitError
        If there are fewer exit angles than folds.
    """
    signed_rad = np.where(np.cos(data.azimuth_rad) < 0.0, data.exit_rad, -data.exit_rad)
    distinct, places = np.unique(signed_rad, return_inverse=True)
    if len(distinct) < FOLDS:
        raise FitError(
            f"{len(distinct)} exit angles in {data.name}: nothing was left out and predicted. Measure at least {FOLDS}."
        )
    blocks = FOLDS * max(1, len(distinct) // (FOLDS * _SIDE_BY_SIDE))
    block = np.arange(len(distinct)) * blocks // len(distinct)
    return [block[places] % FOLDS == fold for fold in range(FOLDS)]


def held_out(data: Dataset, family: SurfaceFamily) -> HeldOut:
    """Fit a family to all but some exit angles and predict these, until each has been predicted once.

    A prediction has an error of its own, from that of the parameters; values that are left out together share it.
    Where nobody knows the errors of the data, their size is the one that makes the predictions most probable.

    Raises
    ------
    FitError
        If there are too few exit angles, or what is left does not determine the parameters.
    """
    predictions = [_predicted(data.some(~out), data.some(out), family) for out in folds(data)]
    chi_square, vagueness = np.sum(predictions, axis=0).tolist()
    count = data.values.size
    misfit = chi_square
    if data.covariance is None:
        misfit = count * math.log(max(chi_square / count, ROUNDING * float(np.mean(data.values**2))))
    return HeldOut(misfit + vagueness, chi_square, count)


def _predicted(rest: Dataset, left: Dataset, family: SurfaceFamily) -> tuple[float, float]:
    """Chi-square of what was left out, and the logarithm of by how much its predictions are vaguer than itself."""
    found = fit(rest, family)
    for name, value in found.held.items():
        family = family.holding(name, value)
    x = np.array([[found.values[name] for name in family.names]])
    told = Problem.of(rest, family).difference(x, _ONE).jacobian[0]
    at = Problem.of(left, family).difference(x, _ONE)
    count = left.values.size
    differences, slopes = at.residuals[0, :count], at.jacobian[0, :, :count]
    # The values' own errors, which are 1, and the parameters', which all values share.
    covariance = np.eye(count) + slopes.T @ _inverse(told @ told.T, slopes @ slopes.T) @ slopes
    root = np.linalg.cholesky(covariance)
    independent = np.linalg.solve(root, differences)
    return float(independent @ independent), 2.0 * float(np.log(np.diag(root)).sum())


def _inverse(told: FloatArray, left: FloatArray) -> FloatArray:
    """Covariance of parameters from what the fitted values tell of them, where what was left out tells of them too.

    A parameter without slope, as k is at 0, makes no prediction vague; its slope is 0 to rounding.
    """
    both = np.diag(told) + np.diag(left)
    counts = both > _NO_SLOPE**2 * both.max()
    unit = np.where(counts, 1.0 / np.sqrt(np.where(counts, both, 1.0)), 0.0)
    scaled = told * np.outer(unit, unit) + np.eye(len(told)) * np.where(counts, 1.0 / _MOST_TOLD, 1.0)
    inverse: FloatArray = np.linalg.inv(scaled) * np.outer(unit, unit)
    return inverse
