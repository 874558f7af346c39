"""How precise a scan will be, said before it: standard errors of the fit's parameters as bench time goes on."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from acquisition.expected_noise import expected_points, light_of
from acquisition.fit_points import dataset, surface_family
from acquisition.recipe import Recipe
from goniometer.budget.assumed_sample import AssumedSample, in_shown_unit, shown
from goniometer.errors import ConfigurationError
from goniometer.planning import detection, plan
from goniometer.rig_file import Rig
from model.design.information import information, prior_information, standard_errors
from model.geometry import FloatArray


@dataclass(frozen=True, eq=False)
class Forecast:
    """Standard errors after each direction of a scan.

    Attributes
    ----------
    names : tuple of str
        The free parameters, as people name them.
    ends_s : ndarray
        Shape (N,): bench time at which each direction is done.
    stderr : ndarray
        Shape (N, P): standard errors then, infinite where the readings so far do not determine a parameter.
    readings : int
        Of the whole scan.
    """

    names: tuple[str, ...]
    ends_s: FloatArray
    stderr: FloatArray
    readings: int

    @property
    def duration_s(self) -> float:
        """Bench time of the whole scan."""
        return float(self.ends_s[-1])

    @property
    def final(self) -> dict[str, float]:
        """Standard errors after the whole scan."""
        return dict(zip(self.names, self.stderr[-1].tolist(), strict=True))

    @property
    def undetermined(self) -> tuple[str, ...]:
        """Parameters that the whole scan leaves open."""
        return tuple(name for name, stderr in self.final.items() if np.isinf(stderr))


def forecast(recipe: Recipe, rig: Rig, sample: AssumedSample) -> Forecast:
    """Predict the standard errors of a recipe's fit from Fisher's information at the assumed sample.

    Raises
    ------
    ConfigurationError
        When the fit's errors do not follow from those of the readings.
    ReductionError
        When the readings could not be reduced.
    """
    steps = plan(recipe, rig)
    family = surface_family(recipe.fit, rig.calibration.acceptance_sr)
    told = np.cumsum(told_by_points(recipe, rig, sample.values, sample.dark_w), axis=0) + prior_information(family)
    units = np.array([in_shown_unit(name) for name in family.names])
    ends_s = dict(
        zip((step.point for step in steps), itertools.accumulate(step.duration_s for step in steps), strict=True)
    )
    return Forecast(
        names=tuple(map(shown, family.names)),
        ends_s=np.array(list(ends_s.values())),
        stderr=np.array([standard_errors(so_far) for so_far in told]) * units,
        readings=sum(step.readings for step in steps),
    )


def told_by_points(recipe: Recipe, rig: Rig, values: Mapping[str, float], dark_w: float) -> FloatArray:
    """Fisher's information (N, P, P) of each direction of a recipe on its fit's free parameters."""
    if recipe.fit.objective == "rms":
        raise ConfigurationError(
            [
                "The fit's objective is rms, whose errors follow from the scatter about the fit and not from those of "
                "the readings. Nothing was computed. Choose the objective dolp."
            ]
        )
    family = surface_family(recipe.fit, rig.calibration.acceptance_sr)
    points = expected_points(plan(recipe, rig), light_of(family.seen(values)), detection(recipe, rig, dark_w))
    data = dataset(points).compared_by(recipe.fit.objective)
    assert data.covariance is not None, "points have covariances, and every objective but rms keeps them"
    return information(family, data.directions, data.covariance, values, data.observable)
