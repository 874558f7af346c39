"""A fit in words and as a table of texts, the same wherever a person meets it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from acquisition.fit_points import in_degrees
from goniometer.fitting.remarks import remarks
from goniometer.plus_minus import number_and_error
from model.fit import Dataset, Estimate, FitResult
from model.fit.quantities import is_weight
from model.lobes import Lobe, Specular

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


_HEADER = ParameterRow("parameter", "value", "error", "truth", "off, in ±", "")
_HEADER_WITHOUT_TRUTH = replace(_HEADER, truth="", off="")


def parameter_rows(fit: FitResult, truth: Mapping[str, float]) -> list[ParameterRow]:
    """Write each parameter of a fit beside the truth, where that is known.

    Parameters
    ----------
    fit : FitResult
        The fit.
    truth : mapping of str to float
        The simulated sample's own parameters; empty for a real sample.
    """
    comparable = comparable_truth(fit, truth)
    return [_row(name, estimate, comparable.get(name)) for name, estimate in in_degrees(fit).parameters.items()]


def comparable_truth(fit: FitResult, truth: Mapping[str, float]) -> dict[str, float]:
    """The truth in the units of a fit: where ratios have no scale, weights count in the one that was held."""
    units = [truth[name] / value for name, value in fit.held.items() if truth.get(name)]
    return {name: value / units[0] if units and is_weight(name) else value for name, value in truth.items()}


def quality(fit: FitResult) -> str:
    """Chi-square, and what it says of the model and of the errors, in a few sentences."""
    if is_without_errors(fit):
        return (
            "The data came without errors, and there are no more of them than parameters: nothing shows how well any "
            "parameter is known, nor whether the model is right. Measure more directions, or give standard errors."
        )
    if fit.degrees_of_freedom < 1:
        return (
            f"Chi-square {fit.chi_square:.3g} with no degrees of freedom: there are no more data than parameters, so "
            f"that nothing shows whether the model is right.{_at_bounds(fit)}"
        )
    if fit.p_value is None:
        return (
            f"The data came without errors: the errors here are those that their scatter about the fit makes, rms "
            f"{fit.rms:.3g}, and nothing shows whether the model is right.{_at_bounds(fit)}"
        )
    per_degree = fit.chi_square / fit.degrees_of_freedom
    # chi-square has the mean dof and the variance 2 dof
    deviations = (fit.chi_square - fit.degrees_of_freedom) / math.sqrt(2.0 * fit.degrees_of_freedom)
    if deviations > _UNLIKELY:
        verdict = "this is a bad fit. The model misses the data by more than their noise, and the errors do not hold"
    elif deviations < -_UNLIKELY:
        verdict = "the data scatter less than their error bars say"
    else:
        verdict = "the model describes the data to within their noise"
    return (
        f"Chi-square {fit.chi_square:.5g} for {fit.degrees_of_freedom} degrees of freedom "
        f"({per_degree:.3g} per degree, p-value {fit.p_value:.2g}): {verdict}.{_at_bounds(fit)}"
    )


def is_without_errors(fit: FitResult) -> bool:
    """Whether nothing tells how well any parameter is known: neither errors of the data nor their scatter."""
    undetermined = any(not estimate.at_bound for estimate in fit.parameters.values())
    return fit.degrees_of_freedom < 1 and not fit.names and undetermined


def _at_bounds(fit: FitResult) -> str:
    held = [name for name, estimate in in_degrees(fit).parameters.items() if estimate.at_bound]
    if not held:
        return ""
    verb = "is" if len(held) == 1 else "are"
    return f" The errors of the others hold only if {' and '.join(held)} {verb} truly at the bound."


def model_name(fit: FitResult) -> str:
    """Which lobes the fitted surface is made of; `FitResult.description` says more."""
    return f"Model: {' + '.join(_lobe_name(lobe) for lobe in fit.surface.lobes)}."


def _lobe_name(lobe: Lobe) -> str:
    name = type(lobe).__name__.lower()
    if isinstance(lobe, Specular) and lobe.followed > 1:
        return f"{name} (up to {lobe.followed} reflections, averaged over the detector's acceptance)"
    return name


def fit_summary(fit: FitResult, truth: Mapping[str, float], data: Dataset | None = None) -> str:
    """Write a fit for a person to read: parameters, truth where known, chi-square, remarks and the model.

    Parameters
    ----------
    fit : FitResult
        The fit.
    truth : mapping of str to float
        The simulated sample's own parameters; empty for a real sample.
    data : Dataset, optional
        What was fitted; then outliers are named by their directions.
    """
    table = table_lines(parameter_rows(fit, truth))
    return "\n".join([*table, "", quality(fit), *remarks(fit, data), model_name(fit)])


def table_lines(rows: Sequence[ParameterRow]) -> list[str]:
    """Lay rows out in lines: a header, then one line a parameter, the columns aligned and all ± below each other."""
    texts = [_HEADER, *rows] if any(row.truth for row in rows) else [_HEADER_WITHOUT_TRUTH, *rows]
    names, values, errors, truths, offs = (
        max(len(getattr(row, column)) for row in texts) for column in ("name", "value", "error", "truth", "off")
    )
    return [
        f"{row.name:<{names}}   {row.value:>{values}} {'±' if row.error else ' '} {row.error:<{errors}}"
        f"   {row.truth:>{truths}}   {row.off:>{offs}}   {row.note}".rstrip()
        for row in texts
    ]


def _row(name: str, estimate: Estimate, truth: float | None) -> ParameterRow:
    value, error = number_and_error(estimate.value, estimate.stderr)
    off = ""
    if truth is not None and error and estimate.stderr:
        off = f"{(estimate.value - truth) / estimate.stderr:+.1f}"
    note = "at its bound" if estimate.at_bound else "" if error else "not determined"
    return ParameterRow(name, value, error, "" if truth is None else f"{truth:.6g}", off, note)
