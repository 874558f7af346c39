"""What the error of a calibration, which all directions share, does to a fit.

The fit takes directions as independent, and so averages an error that they share. Here the calibration is moved along
each axis of its covariance by one standard deviation, the readings are reduced and fitted again, and what the
parameters move by is added to their covariance. The fit's own part has the calibration's errors in each direction's
covariance as well, as if they were independent; that counts them twice, by little, where there are many directions.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from acquisition.calibrated_slots import PARAMETERS, SlotCalibration
from model.fit import FitResult

Refit = Callable[[SlotCalibration, dict[str, float]], FitResult]
"""Reduces the same readings with another calibration and fits them, starting from some parameters."""

_NONE = 1e-9
"""Variance against the largest one that no refit is worth."""


def with_shared_error(result: FitResult, calibration: SlotCalibration, refit: Refit) -> FitResult:
    """The same fit, with standard errors and correlations that know of the calibration's error.

    Parameters
    ----------
    result : FitResult
        The fit of readings reduced with this calibration.
    calibration : SlotCalibration
        What they were reduced with.
    refit : callable
        Repeats both with another one.
    """
    stderrs = np.array([result.parameters[name].stderr for name in result.names], dtype=float)
    covariance = result.correlation * np.outer(stderrs, stderrs)
    units = np.sqrt(np.diag(calibration.covariance))
    units[units == 0.0] = 1.0
    variances, axes = np.linalg.eigh(calibration.covariance / np.outer(units, units))
    for variance, axis in zip(variances, axes.T, strict=True):
        if variance > _NONE * variances[-1]:
            there = refit(shifted(calibration, np.sqrt(variance) * axis * units), result.values).values
            moved = np.array([there[name] - result.values[name] for name in result.names])
            covariance = covariance + np.outer(moved, moved)
    enlarged = np.sqrt(np.diag(covariance))
    return replace(
        result,
        parameters=result.parameters
        | {
            name: replace(result.parameters[name], stderr=float(stderr))
            for name, stderr in zip(result.names, enlarged, strict=True)
        },
        correlation=covariance / np.outer(enlarged, enlarged),
    )


def shifted(calibration: SlotCalibration, by: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> SlotCalibration:
    """A calibration whose angles, leaks and transmissions are moved by an amount each, in the order of `covariance`."""
    slots = {}
    for (slot, found), moved in zip(calibration.slots.items(), by.reshape(-1, len(PARAMETERS)), strict=True):
        values = np.array(found.values) + moved
        slots[slot] = found.model_copy(update=dict(zip(PARAMETERS, values.tolist(), strict=True)))
    return calibration.model_copy(update={"slots": slots})
