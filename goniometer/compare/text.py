"""A comparison of models as a table, and in words."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterator, Sequence

import numpy as np

from goniometer.compare.command import EQUAL, UNLIKELY, Comparison, is_refused, refused
from model.comparison.comparison import Compared
from model.comparison.measured_dolp import measured_dolp

_HEADER = ("model", "parameters", "chi²/dof", "data", "AIC", "held-out", "rms DoLP")
_ALIGN = "<>><>>>"
_GAP = "   "
_WIDTH = 118
_MOST_COLUMNS = 6
_COMPARED = {
    "stokes": "",
    "normalised": " Compared are the values divided by the first.",
    "dolp": " Compared is the degree of linear polarization.",
    "rms": " Compared is the degree of linear polarization, with equal weights.",
}
_LEGEND = {
    "chi²/dof": "1 if the model and the errors of the data are right; the data refuse a model if chance alone gives as "
    f"much in fewer than 1 of {1 / UNLIKELY:.0f} scans",
    "AIC": "Akaike's criterion, above the best: misfit, and 2 for every parameter; models that differ by less than "
    f"{EQUAL:.0f} are equally good, and beyond 10 next to nothing speaks for the worse",
    "held-out": "on the same scale, how badly a model predicts exit angles that were left out of its fit, a fifth of "
    "them at a time, neighbours together",
    "rms DoLP": "root mean square deviation of the degree of linear polarization, eq. (14) of Hao et al. 2023",
}


def compare_text(found: Comparison) -> str:
    """A table of the models, best first, what it says, what its columns mean, and whose the models are."""
    blocks = [[_head(found)], _table(found), list(_verdict(found)), _explained(_LEGEND), _explained(_sources(found))]
    return "\n\n".join("\n".join(block) for block in blocks)


def criterion(found: Comparison, model: Compared) -> str:
    """Akaike's criterion of a model and its verdict, in few words."""
    verdict = {None: "", True: ", refused", False: ""}[is_refused(model)]
    return f"AIC {_difference(found.aic_above_best(model))}{verdict}"


def _head(found: Comparison) -> str:
    data = found.given.data
    columns = data.observable.columns
    shown = ", ".join(columns) if len(columns) <= _MOST_COLUMNS else f"{columns[0]} to {columns[-1]}"
    errors = "their errors known" if data.covariance is not None else "their errors not stated"
    return (
        f"{data.name}: {len(data)} points, {data.values.size} values of {shown}, {errors}.{_COMPARED[found.objective]}"
    )


def _table(found: Comparison) -> list[str]:
    rows = [_HEADER, *(_row(found, model) for model in found.models if model.fit is not None)]
    widths = [max(len(row[column]) for row in rows) for column in range(len(_HEADER))]
    lines = [
        _GAP.join(f"{text:{align}{width}}" for text, align, width in zip(row, _ALIGN, widths, strict=True)).rstrip()
        for row in rows
    ]
    lines += [f"{model.candidate.name}: not fitted, see below" for model in found.models if model.fit is None]
    return lines


def _row(found: Comparison, model: Compared) -> Sequence[str]:
    assert model.fit is not None, "only models that could be fitted have a row"
    refused = is_refused(model)
    per_degree = model.fit.chi_square / model.fit.degrees_of_freedom if model.fit.degrees_of_freedom else math.nan
    return (
        model.candidate.name,
        str(len(model.fit.parameters)),
        "" if refused is None else f"{per_degree:.3g}",
        {None: "", True: "refuse it", False: "agree"}[refused],
        _difference(found.aic_above_best(model)),
        _difference(found.held_out_above_best(model)),
        "" if model.dolp_rms is None else f"{model.dolp_rms:.3g}",
    )


def _difference(above: float) -> str:
    if not math.isfinite(above):
        return "–"
    return "best" if above == 0.0 else f"+{above:.1f}" if above < 1e4 else f"+{above:.3g}"


def _verdict(found: Comparison) -> Iterator[str]:
    best, *others = found.equally_good or ("",)
    if others:
        yield f"The data do not tell {_listed([best, *others])} apart: their criteria differ by less than {EQUAL:.0f}."
    elif best:
        yield f"{best} describes the data best."
    predictors = found.best_predictors
    if predictors and best and best not in predictors:
        yield f"Held-out exit angles speak for {_listed(predictors)} instead: the ranking hangs by few directions."
    if found.exact:
        yield from textwrap.wrap(
            f"{_listed(found.exact)} {'leave' if len(found.exact) > 1 else 'leaves'} nothing of the data but rounding: "
            "these are too few to judge a model by, or hold no noise. The criterion means nothing then.",
            _WIDTH,
            subsequent_indent="  ",
        )
    unranked = [
        model.candidate.name for model in found.models if model.aic is not None and not math.isfinite(model.aic)
    ]
    if unranked:
        yield (
            f"{_listed(unranked)}: without a criterion, because {found.given.data.values.size} values without errors "
            "are too few for so many parameters."
        )
    verdicts = [is_refused(model) for model in found.models]
    if True in verdicts and False not in verdicts:
        yield "The data refuse every model: the best one is the least wrong, and its parameters' errors are too small."
    dolp = measured_dolp(found.given.data)
    dark = 0 if dolp is None else int(np.isnan(dolp.values).sum())
    if dark:
        yield f"rms DoLP leaves out {dark} of {len(found.given.data)} points, where S0 is not above 0."
    for what, models in (
        ("not fitted", [model for model in found.models if model.fit is None]),
        ("not predicted", [model for model in found.models if model.fit is not None]),
    ):
        for reason, names in refused(models).items():
            who = "Held-out exit angles" if len(names) == len(found.models) else _listed(names)
            yield from textwrap.wrap(f"{who}, {what}: {reason}", _WIDTH, subsequent_indent="  ")


def _sources(found: Comparison) -> dict[str, str]:
    return {model.candidate.name: model.candidate.source for model in found.models}


def _explained(words: dict[str, str]) -> list[str]:
    width = max(len(word) for word in words) + len(_GAP)
    lines = []
    for word, meaning in words.items():
        first, *rest = textwrap.wrap(meaning, _WIDTH - width)
        lines += [f"{word:<{width}}{first}", *(" " * width + line for line in rest)]
    return lines


def _listed(names: Sequence[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
