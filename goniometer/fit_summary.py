"""A fit in words and as a table of texts, the same wherever a person meets it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import astuple, dataclass

from goniometer.plus_minus import number_and_error
from model.fit import Estimate, FitResult

_UNLIKELY = 3.0
"""Standard deviations of chi-square beyond which it says that model and noise do not belong together."""


@dataclass(frozen=True)
class ParameterRow:
    """One fitted parameter as texts; what is not known is empty.

    `off` is the difference from the truth in standard errors, `note` what a person must know before trusting `value`.
    """

    name: str
    value: str
    error: str
    truth: str
    off: str
    note: str


def parameter_rows(fit: FitResult, truth: Mapping[str, float]) -> list[ParameterRow]:
    """Write each parameter of a fit beside the truth, where that is known.

    Parameters
    ----------
    fit : FitResult
        The fit.
    truth : mapping of str to float
        The simulated sample's own parameters; empty for a real sample.
    """
    return [_row(name, estimate, truth.get(name)) for name, estimate in fit.parameters.items()]


def quality(fit: FitResult) -> str:
    """Chi-square, and what it says, as one sentence."""
    if fit.degrees_of_freedom < 1:
        return f"Chi-square {fit.chi_square:.3g} with no degrees of freedom: there are no more data than parameters."
    per_degree = fit.chi_square / fit.degrees_of_freedom
    # chi-square has the mean dof and the variance 2 dof
    deviations = (fit.chi_square - fit.degrees_of_freedom) / math.sqrt(2.0 * fit.degrees_of_freedom)
    if deviations > _UNLIKELY:
        verdict = "the model misses the data by more than their noise"
    elif deviations < -_UNLIKELY:
        verdict = "the data scatter less than their error bars say"
    else:
        verdict = "the model describes the data to within their noise"
    return (
        f"Chi-square {fit.chi_square:.5g} for {fit.degrees_of_freedom} degrees of freedom "
        f"({per_degree:.3g} per degree): {verdict}."
    )


def fit_summary(fit: FitResult, truth: Mapping[str, float]) -> str:
    """Write a fit for a person to read: parameters, truth where known, chi-square and the model.

    Parameters
    ----------
    fit : FitResult
        The fit.
    truth : mapping of str to float
        The simulated sample's own parameters; empty for a real sample.
    """
    rows = parameter_rows(fit, truth)
    header = ("parameter", "value", "standard error", *(("truth", "off, in errors") if truth else ("", "")), "")
    return "\n".join([*_columns([header, *(astuple(row) for row in rows)]), "", quality(fit), f"Model: {fit.description}"])


def _row(name: str, estimate: Estimate, truth: float | None) -> ParameterRow:
    value, error = number_and_error(estimate.value, estimate.stderr)
    off = ""
    if truth is not None and error and estimate.stderr:
        off = f"{(estimate.value - truth) / estimate.stderr:+.1f}"
    note = "at its bound" if estimate.at_bound else "" if error else "not determined"
    return ParameterRow(name, value, error, "" if truth is None else f"{truth:.6g}", off, note)


def _columns(table: Sequence[Sequence[str]]) -> list[str]:
    """Lines with names to the left, numbers to the right, and errors meeting their numbers at the ±."""
    names, values, errors, truths, offs, notes = ([max(map(len, column)), column] for column in zip(*table, strict=True))
    return []
