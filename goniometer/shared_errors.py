"""What errors that all directions share do to a fit: those of a calibration, and of the arms' zeros.

The fit takes directions as independent, and so averages an error that they share. Here what is shared is moved by one
standard deviation, a calibration along each axis of its covariance, the readings are reduced and fitted again, and what
the parameters move by is added to their covariance. The fit's own part has the calibration's errors in each direction's
covariance as well, as if they were independent; that counts them twice, by little, where there are many directions.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from acquisition.calibrated_slots import PARAMETERS, SlotCalibration
from acquisition.fit_choice import FitChoice
from acquisition.fit_names import ParameterName
from acquisition.fit_points import dataset, fit_arguments, surface_family
from acquisition.readings import StokesPoint
from goniometer.planning import reduction
from goniometer.rig_devices.entry import Role
from model.fit import FitResult, fit

if TYPE_CHECKING:
    from goniometer.run_folder import MeasuredRun

Refit = Callable[[dict[str, float]], FitResult]
"""Fits the same readings, with what is shared moved by one standard deviation, starting from some parameters."""

_ZEROS: dict[Role, ParameterName] = {"source_arm": "incidence_offset_deg", "detector_arm": "exit_offset_deg"}
"""What a fit calls the error of an arm's zero."""

_NONE = 1e-9
"""Variance against the largest one that no refit is worth."""


def with_shared_errors(result: FitResult, refits: Iterable[Refit]) -> FitResult:
    """The same fit, with standard errors and correlations that know of what all directions share.

    Parameters
    ----------
    result : FitResult
        The fit.
    refits : iterable of callable
        One for each independent error that is shared.
    """
    stderrs = np.array([result.parameters[name].stderr for name in result.names], dtype=float)
    others = [refit(result.values).values for refit in refits]
    if not others:
        return result
    moved = np.array([[there[name] - result.values[name] for name in result.names] for there in others])
    covariance = result.correlation * np.outer(stderrs, stderrs) + moved.T @ moved
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


def refits(run: MeasuredRun) -> Iterator[Refit]:
    """The fits of a run with its calibration moved, and with the zeros of arms that its own fit does not search."""
    choice = run.recipe.fit
    for calibration in () if run.calibration is None else moved_calibrations(run.calibration):
        points = reduction(run.recipe, run.rig, calibration).scan(run.readings)
        yield partial(_refitted, run, points, choice)
    for role, name in _ZEROS.items():
        stderr_deg = run.rig.axes()[role].zero_stderr_deg
        if stderr_deg > 0.0 and name not in {*choice.free, *choice.fixed}:
            moved = choice.model_copy(update={"fixed": {**choice.fixed, name: stderr_deg}})
            yield partial(_refitted, run, run.points, moved)


def _refitted(run: MeasuredRun, points: Sequence[StokesPoint], choice: FitChoice, start: dict[str, float]) -> FitResult:
    family = surface_family(choice, run.rig.calibration.acceptance_sr)
    return fit(dataset(points, run.folder.name), family, start=start, **fit_arguments(choice))


def moved_calibrations(calibration: SlotCalibration) -> Iterator[SlotCalibration]:
    """A calibration, moved along each axis of its covariance by one standard deviation."""
    units = np.sqrt(np.diag(calibration.covariance))
    units[units == 0.0] = 1.0
    variances, axes = np.linalg.eigh(calibration.covariance / np.outer(units, units))
    for variance, axis in zip(variances, axes.T, strict=True):
        if variance > _NONE * variances[-1]:
            yield shifted(calibration, np.sqrt(variance) * axis * units)


def shifted(calibration: SlotCalibration, by: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> SlotCalibration:
    """A calibration whose angles, leaks and transmissions are moved by an amount each, in the order of `covariance`."""
    slots = {}
    for (slot, found), moved in zip(calibration.slots.items(), by.reshape(-1, len(PARAMETERS)), strict=True):
        values = np.array(found.values) + moved
        slots[slot] = found.model_copy(update=dict(zip(PARAMETERS, values.tolist(), strict=True)))
    return calibration.model_copy(update={"slots": slots})
