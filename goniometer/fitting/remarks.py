"""What a person must know before trusting a fit: what it held or left open, what trades off, other optima, outliers."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from acquisition.fit_points import in_degrees
from model.fit import Dataset, FitResult
from model.fit.quantities import quantity
from model.fit.result import Weakness

_TRADES_OFF = 0.95
_ILL_CONDITIONED = 1e3
_OPEN, _HALF = 0.25, 0.5
"""Share of its usual range, or of itself where it is above 0, beyond which a parameter's error leaves it open."""
_CARRIES = 0.5
"""Of a parameter's standard error, as much lies in the weakest combination if the parameter carries it."""
_MOST_CARRIERS = 4
_MOST_OUTLIERS = 10


def remarks(fit: FitResult, data: Dataset | None = None) -> list[str]:
    """Say what is remarkable about a fit; nothing if nothing is.

    Parameters
    ----------
    fit : FitResult
        The fit.
    data : Dataset, optional
        What was fitted, for the directions of outliers.

    Returns
    -------
    list of str
        One remark each; that on outliers has several lines.
    """
    shown = in_degrees(fit)
    return [
        *_held(shown),
        *_biased(shown, data),
        *_undetermined(shown),
        *_open(fit),
        *_weakness(shown),
        *_alternatives(shown),
        *_outliers(shown, data),
    ]


def _held(fit: FitResult) -> Iterator[str]:
    for name, value in fit.held.items():
        yield f"Ratios of light have no scale: {name} was held at {value:g}, and whatever adds to light counts in it."


def _biased(fit: FitResult, data: Dataset | None) -> Iterator[str]:
    if not fit.biased:
        return
    remedy = "measure longer there"
    if data is None or data.observable.has_scale:
        remedy = "fit with --objective stokes, which has no such bias"
    yield (
        f"In {fit.biased} of {len(fit.fitted)} directions S0 or the degree of polarization is less than 5 standard "
        f"errors: there noise makes ratios, most of all the DoLP, too large. The parameters may be biased; {remedy}."
    )


def _undetermined(fit: FitResult) -> Iterator[str]:
    names = [name for name, estimate in fit.parameters.items() if estimate.stderr is None and not estimate.at_bound]
    if names and fit.degrees_of_freedom > 0:
        others = " The errors of the others allow for that." if fit.names else ""
        each = "it" if len(names) == 1 else "each of them"
        yield f"The data do not determine {_listed(names)}: {each} could be anything between its bounds.{others}"


def _open(fit: FitResult) -> Iterator[str]:
    """Parameters, in the model's units, whose errors span much of what there is."""
    names = []
    for name, estimate in fit.parameters.items():
        low, high = quantity(name).usual
        reach = min(_OPEN * (high - low), _HALF * abs(estimate.value) if low > 0.0 else math.inf)
        if math.isfinite(high) and estimate.stderr is not None and estimate.stderr > reach:
            names.append(name)
    if names:
        shown = [name for name, own in zip(in_degrees(fit).parameters, fit.parameters, strict=True) if own in names]
        yield f"The data hardly determine {_listed(shown)}: almost any value would do as well."


def _weakness(fit: FitResult) -> Iterator[str]:
    between = np.abs(fit.correlation - np.eye(len(fit.names)))
    if fit.weakness is None or (between.max(initial=0.0) <= _TRADES_OFF and fit.condition <= _ILL_CONDITIONED):
        return
    carriers = _carriers(fit, fit.weakness)
    sign = math.copysign(1.0, fit.weakness.changes[carriers[0]])
    changes = [(name, sign * fit.weakness.changes[name]) for name in carriers]
    moves = [f"{name} {'rises' if change > 0.0 else 'falls'} by {abs(change):.2g}" for name, change in changes]
    yield (
        f"{_listed(carriers)} trade off (condition {fit.condition:.2g}): the data hardly notice when {moves[0]} while "
        f"{_listed(moves[1:])}; {_advice(fit, fit.weakness)}."
    )


def _carriers(fit: FitResult, weakness: Weakness) -> list[str]:
    """The parameters that make up the weakest combination, in the order of the fit: two, or few more."""
    shares = {
        name: abs(change) / (fit.parameters[name].stderr or math.inf) for name, change in weakness.changes.items()
    }
    ranked = sorted(shares, key=lambda name: -shares[name])
    chosen = {*ranked[:2], *(name for name in ranked[:_MOST_CARRIERS] if shares[name] > _CARRIES)}
    return [name for name in fit.names if name in chosen]


def _advice(fit: FitResult, weakness: Weakness) -> str:
    if fit.columns[0] == "psi":
        return "add angles of incidence"
    return f"add exit angles near {math.degrees(weakness.best_exit_rad):.0f}°"


def _alternatives(fit: FitResult) -> Iterator[str]:
    for other in fit.alternatives:
        values = ", ".join(f"{name} {value:.4g}" for name, value in other.parameters.items())
        yield f"Another optimum fits almost as well (chi-square higher by {other.excess:.2g}): {values}."


def _outliers(fit: FitResult, data: Dataset | None) -> Iterator[str]:
    if not fit.outliers:
        return
    shown = fit.outliers[:_MOST_OUTLIERS]
    lines = [
        f"  {_place(data, outlier.row)}{_direction(data, outlier.row)}: {outlier.deviations:.1f} standard deviations"
        for outlier in shown
    ]
    more = len(fit.outliers) - len(shown)
    if more:
        lines.append(f"  and {more} more")
    counted = " counted from 0" if data is None or data.lines is None else ""
    head = f"Too far from the fit for their errors, of {len(fit.fitted)} rows{counted}: {len(fit.outliers)}"
    yield "\n".join([head, *lines])


def _place(data: Dataset | None, row: int) -> str:
    return f"row {row}" if data is None else data.place(row)


def _direction(data: Dataset | None, row: int) -> str:
    """Where a row was measured: a signed exit angle in the plane of incidence, an azimuth elsewhere."""
    if data is None:
        return ""
    incidence_deg, exit_deg, azimuth_deg = (float(np.degrees(angle[row])) for angle in data.directions)
    cosine = math.cos(math.radians(azimuth_deg))
    if abs(cosine) > 1.0 - 1e-9:
        return f", incidence {incidence_deg:.4g}°, exit {math.copysign(exit_deg, -cosine):z.4g}°"
    return f", incidence {incidence_deg:.4g}°, exit {exit_deg:.4g}°, phi {azimuth_deg:.4g}°"


def _listed(words: list[str]) -> str:
    return " and ".join(filter(None, (", ".join(words[:-1]), words[-1])))
