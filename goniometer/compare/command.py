"""What ``goniometer compare`` does: fit every model to one input, and rank them by how well they describe it."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from acquisition.fit_points import fit_arguments, surface_family
from goniometer.errors import FitError
from goniometer.fitting.input import FitInput, read_input, with_recipe
from goniometer.plain_json import plain
from model.acceptance import half_angle_rad
from model.comparison.candidates import BOUNCES, candidates
from model.comparison.comparison import Compared, compare
from model.comparison.held_out import ROUNDING
from model.fit.dataset import Objective
from model.fit.ellipsometric import Ellipsometric

UNLIKELY = 1e-3
"""Data refuse a model if chance alone gives a chi-square as high less often than this."""
EQUAL = 2.0
"""Models whose criteria differ by no more are equally good: a parameter that tells nothing makes as much."""


@dataclass(frozen=True)
class Comparison:
    """Models beside one input, the best first; `objective` is what of the data was compared."""

    given: FitInput
    objective: Objective
    models: tuple[Compared, ...]

    @property
    def equally_good(self) -> tuple[str, ...]:
        """The best model by Akaike's criterion, and those that are as good."""
        return tuple(model.candidate.name for model in self.models if self.aic_above_best(model) <= EQUAL)

    @property
    def exact(self) -> tuple[str, ...]:
        """Models that leave nothing of data without errors, where the criterion counts digits of rounding."""
        data = self.given.data
        rounding = math.sqrt(ROUNDING * float(np.mean(data.values**2)))
        fits = {model.candidate.name: model.fit for model in self.models if model.fit is not None}
        return tuple(name for name, fit in fits.items() if data.covariance is None and fit.rms <= rounding)

    @property
    def best_predictors(self) -> tuple[str, ...]:
        """The model that predicts best what was left out of its fit, and those that do as well."""
        return tuple(model.candidate.name for model in self.models if self.held_out_above_best(model) <= EQUAL)

    def aic_above_best(self, model: Compared) -> float:
        """By how much a model's criterion is above the lowest; infinite if it has none."""
        return _above(model.aic, (other.aic for other in self.models))

    def held_out_above_best(self, model: Compared) -> float:
        """By how much the deviance of a model's predictions is above the lowest; infinite if it has none."""
        deviances = [None if other.held_out is None else other.held_out.deviance for other in self.models]
        return _above(deviances[self.models.index(model)], deviances)

    def json_text(self) -> str:
        """The comparison as JSON."""
        whole = {
            "input": str(self.given.path),
            "rows": len(self.given.data),
            "columns": self.given.data.observable.columns,
            "errors_known": self.given.data.covariance is not None,
            "objective": self.objective,
            "equally_good": self.equally_good,
            "best_predictors": self.best_predictors,
            "models": [self._as_json(model) for model in self.models],
        }
        return json.dumps(plain(whole), indent=2)

    def _as_json(self, model: Compared) -> dict[str, Any]:
        return {
            "name": model.candidate.name,
            "source": model.candidate.source,
            "refusals": model.refusals,
            "parameters": None if model.fit is None else len(model.fit.parameters),
            "refused_by_the_data": is_refused(model),
            "aic": model.aic,
            "aic_above_best": self.aic_above_best(model),
            "held_out": model.held_out,
            "held_out_above_best": self.held_out_above_best(model),
            "dolp_rms": model.dolp_rms,
            "fit": model.fit,
        }


def is_refused(model: Compared) -> bool | None:
    """Whether the data refuse a model; None if that is not known, as of data that do not say their errors."""
    if model.fit is None or model.fit.p_value is None:
        return None
    return model.fit.p_value < UNLIKELY


def refused(models: Iterable[Compared]) -> dict[str, list[str]]:
    """Why models could not be fitted or asked for predictions, and the names of those for which that holds."""
    reasons: dict[str, list[str]] = {}
    for model in models:
        for reason in model.refusals:
            reasons.setdefault(reason, []).append(model.candidate.name)
    return reasons


def compare_models(path: Path, recipe: Path | None = None, objective: Objective | None = None) -> Comparison:
    """Fit every model to a run, a NeXus file or a table.

    Parameters
    ----------
    path : Path
        What to fit.
    recipe : Path, optional
        A file whose fit section says what is known of the sample, in place of the run's own.
    objective : {"stokes", "normalised", "dolp", "rms"}, optional
        What is compared, in place of what the fit section says.

    Raises
    ------
    GoniometerError
        If the input or the recipe cannot be used, or no model can be fitted.
    """
    given = read_input(path)
    if recipe is not None:
        given = with_recipe(given, recipe)
    if isinstance(given.data.observable, Ellipsometric):
        raise FitError(
            f"{path} holds psi and delta, of a sample that is taken for smooth: they tell its index, and no model of "
            f"rough surfaces from another. Nothing was compared. Fit the index with goniometer fit {path}."
        )
    choice, acceptance_sr = given.choice, given.acceptance_sr
    tried = candidates(
        None if choice is None else surface_family(choice, acceptance_sr),
        bounces=BOUNCES if choice is None or choice.bounces == 1 else choice.bounces,
        detector_half_angle_rad=0.0 if acceptance_sr is None else half_angle_rad(acceptance_sr),
    )
    if objective is None:
        objective = "stokes" if choice is None else fit_arguments(choice)["objective"]
    models = tuple(compare(given.data, tried, objective=objective))
    if all(model.fit is None for model in models):
        reasons = "\n".join(f"  {', '.join(names)}: {reason}" for reason, names in refused(models).items())
        raise FitError(f"No model can be fitted to {path}:\n{reasons}")
    return Comparison(given, objective, models)


def _above(value: float | None, all_values: Iterable[float | None]) -> float:
    if value is None or not math.isfinite(value):
        return math.inf
    return value - min(other for other in all_values if other is not None)
