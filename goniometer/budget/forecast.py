"""How precise a scan will be, said before it: standard errors of the fit's parameters as bench time goes on."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from acquisition.expand import Step
from acquisition.expected_noise import expected_points, light_of
from acquisition.fit_points import dataset, surface_family
from acquisition.recipe import Recipe
from goniometer.budget.assumed_sample import AssumedSample, in_shown_unit, shown
from goniometer.errors import ConfigurationError
from goniometer.planning import detection, plan
from goniometer.rig_file import Rig
from model.design.information import information, prior_information, standard_errors
from model.fit import SurfaceFamily
from model.geometry import FloatArray

_ROUNDING = 1e-6
"""All readings together do not change with a parameter that changes them by so few standard deviations from one bound
to the other."""


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
        Shape (N, P): standard errors then, infinite where the readings so far do not determine a parameter: they do
        not change with it, or so little that its error is larger than the whole range that the fit searches.
    readings : int
        Of the whole scan.
    blind : tuple of str
        Parameters of which the whole scan tells nothing, however often it reads.
    """

    names: tuple[str, ...]
    ends_s: FloatArray
    stderr: FloatArray
    readings: int
    blind: tuple[str, ...] = ()

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
    of_points = told_by_points(recipe, rig, sample.values, sample.dark_w)
    ends_s = _ends_s(steps)
    told = np.cumsum(of_points[np.argsort(ends_s)], axis=0) + prior_information(family)
    names = tuple(map(shown, family.names))
    units = np.array([in_shown_unit(name) for name in family.names])
    stderr = np.array([standard_errors(so_far) for so_far in told])
    blind = tuple(name for name, error in zip(names, stderr[-1], strict=True) if np.isinf(error))
    return Forecast(
        names=names,
        ends_s=np.sort(ends_s),
        stderr=np.where(stderr > _widths(family), np.inf, stderr) * units,
        readings=sum(step.readings for step in steps),
        blind=blind,
    )


def _ends_s(steps: Sequence[Step]) -> FloatArray:
    """When the last reading of each direction is taken, in the order of their numbers; sweeps go forth and back."""
    ends_s = dict(
        zip((step.point for step in steps), itertools.accumulate(step.duration_s for step in steps), strict=True)
    )
    return np.array([end_s for _, end_s in sorted(ends_s.items())])


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
    told = information(family, data.directions, data.covariance, values, data.observable)
    return _without_rounding(told, family)


def _without_rounding(told: FloatArray, family: SurfaceFamily) -> FloatArray:
    """Nothing is told of a parameter without a slope, such as k of a dielectric, where derivatives are of rounding."""
    widths = _widths(family)
    effects = np.sqrt(np.einsum("npp->p", told)) * np.where(np.isfinite(widths), widths, np.inf)
    seen = ~(effects < _ROUNDING)
    return told * np.outer(seen, seen)


def _widths(family: SurfaceFamily) -> FloatArray:
    return np.array([high - low for low, high in (family.free[name] for name in family.names)])
