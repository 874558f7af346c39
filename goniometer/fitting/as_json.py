"""A fit as JSON: what `fit.json` holds, and what ``goniometer fit --json`` prints."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

from acquisition.fit_choice import FitChoice
from acquisition.fit_points import in_degrees
from goniometer.fitting.summary import comparable_truth
from goniometer.plain_json import plain
from model.fit import FitResult


def fit_json(fit: FitResult, choice: FitChoice, truth: Mapping[str, float], **more: Any) -> str:
    """Write a fit, with angles in degrees.

    Parameters
    ----------
    fit : FitResult
        The fit.
    choice : FitChoice
        What was asked for.
    truth : mapping of str to float
        The simulated sample's own parameters; empty for a real sample.
    **more
        What else to say.
    """
    shown, known = in_degrees(fit), comparable_truth(fit, truth)
    parameters = {}
    for name, estimate in shown.parameters.items():
        parameters[name] = {"value": estimate.value, "stderr": estimate.stderr, "at_bound": estimate.at_bound}
        if name in known:
            parameters[name]["truth"] = known[name]
    weakness = shown.weakness and {
        "changes": shown.weakness.changes,
        "best_exit_deg": math.degrees(shown.weakness.best_exit_rad),
    }
    content = {
        "parameters": parameters,
        "fixed": choice.fixed,
        "tied": choice.tied,
        "prior": choice.prior,
        "held": shown.held,
        "objective": choice.objective,
        "robust": choice.robust,
        "chi_square": shown.chi_square,
        "degrees_of_freedom": shown.degrees_of_freedom,
        "p_value": shown.p_value,
        "rms": shown.rms,
        "correlation": {"names": shown.names, "matrix": shown.correlation},
        "condition": shown.condition,
        "weakness": weakness,
        "alternatives": shown.alternatives,
        "outliers": shown.outliers,
        "biased": shown.biased,
        "model": shown.description,
        **more,
    }
    return json.dumps(plain(content), indent=2, ensure_ascii=False) + "\n"
