"""The panels of a comparison's picture: a measured quantity with every model's curve, and what one model leaves."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from goniometer.compare.command import Comparison
from model.comparison.measured_dolp import measured_dolp
from model.fit import Dataset
from model.fit.observable import Elements
from model.geometry import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes

INK, FAINT = "#222222", "#6f6f6f"
_BAND = "#e9e9e9"
_LABEL_GAP = 0.058
_BELOW = 3.0
"""A curve of S0 is shown down to so much below the least measured value."""
_LINEAR = 3.0
"""Residuals in standard errors up to which a strip is linear; beyond it is logarithmic."""
_ROUNDS = 500
_SCAN_NAME: dict[str, Any] = {"size": 8, "color": FAINT, "zorder": 21}


@dataclass(frozen=True)
class Line:
    """How a model's curve looks."""

    colour: str
    dashes: Any


@dataclass(frozen=True, eq=False)
class Scan:
    """What a curve may connect: rows of one incidence in one plane, in the order of their signed exit angles."""

    rows: NDArray[np.int64]
    exit_deg: FloatArray
    incidence_deg: float


@dataclass(frozen=True, eq=False)
class Quantity:
    """One measured quantity and every model's, shape (N,), with the unit in which residuals are counted."""

    title: str
    measured: FloatArray
    stderr: FloatArray | None
    models: Mapping[str, FloatArray]
    is_logarithmic: bool

    def residuals(self, name: str) -> FloatArray:
        """What a model leaves, in standard errors; where nobody knows these, in the rms of what the best leaves."""
        left = self.measured - self.models[name]
        if self.stderr is not None:
            return left / self.stderr
        best = self.measured - next(iter(self.models.values()))
        unit = float(np.sqrt(np.nanmean(best**2)))
        return left / unit if unit > 0.0 else left


def quantities(found: Comparison) -> Iterator[Quantity]:
    """S0, where it was compared, and the DoLP, where the data hold it."""
    data = found.given.data
    fits = {model.candidate.name: model.fit for model in found.models if model.fit is not None}
    if found.objective == "stokes" and isinstance(data.observable, Elements) and 0 in data.observable.picked:
        place = data.observable.picked.index(0)
        stderr = None if data.covariance is None else np.sqrt(data.covariance[:, place, place])
        s0 = {name: fit.stokes[:, 0] for name, fit in fits.items()}
        yield Quantity("$S_0$ (1/sr)", data.values[:, place], stderr, s0, is_logarithmic=True)
    dolp = measured_dolp(data)
    if dolp is not None:
        fitted = {name: np.hypot(*fit.stokes[:, 1:].T) / fit.stokes[:, 0] for name, fit in fits.items()}
        yield Quantity("degree of linear polarization", dolp.values, dolp.stderr, fitted, is_logarithmic=False)


def scans(data: Dataset) -> list[Scan]:
    """The scans that data consist of; an exit angle on the source's side is negative."""
    exit_deg = np.degrees(np.where(np.cos(data.azimuth_rad) < 0.0, data.exit_rad, -data.exit_rad))
    planes = np.round(np.column_stack([data.incidence_rad, np.abs(np.sin(data.azimuth_rad))]), 6)
    found = []
    for plane in np.unique(planes, axis=0):
        rows = np.flatnonzero((planes == plane).all(axis=1))
        rows = rows[np.argsort(exit_deg[rows], kind="stable")]
        found.append(Scan(rows, exit_deg[rows], float(np.degrees(plane[0]))))
    return found


def draw_curves(axes: Axes, quantity: Quantity, lines: Mapping[str, Line], scans: Sequence[Scan]) -> None:
    """Draw the measured values, every model's curve, the best on top, and the models' names beside the curves' ends."""
    if quantity.is_logarithmic:
        axes.set_yscale("log", nonpositive="mask")
    for place, (name, line) in enumerate(reversed(list(lines.items()))):
        for scan in scans:
            curve = quantity.models[name][scan.rows]
            axes.plot(scan.exit_deg, curve, ls=line.dashes, color=line.colour, lw=1.5, zorder=3 + place)
    for scan in scans:
        stderr = None if quantity.stderr is None else quantity.stderr[scan.rows]
        measured = quantity.measured[scan.rows]
        axes.errorbar(scan.exit_deg, measured, stderr, fmt="o", color=INK, ms=3, mew=0, elinewidth=0.8, zorder=20)
        if len(scans) > 1:
            at = (scan.exit_deg[-1], measured[-1])
            axes.annotate(f"{scan.incidence_deg:.4g}°", at, (4, 5), textcoords="offset points", **_SCAN_NAME)
    axes.set_title(quantity.title, loc="left", size=10.5, weight="bold", pad=10)
    axes.set_ylim(*_limits(quantity))
    hidden = _hidden(quantity)
    if hidden:
        axes.set_title(f"{hidden} not shown", loc="right", size=9, color=FAINT, pad=10)
    axes.grid(visible=True)
    axes.tick_params(labelbottom=False)
    _name_curves(axes, {name: (scans[-1].exit_deg, quantity.models[name][scans[-1].rows]) for name in lines}, lines)


def draw_strip(axes: Axes, residuals: FloatArray, line: Line, scans: Sequence[Scan], reach: float) -> None:
    """Draw what one model leaves, on an axis that is linear up to a few standard errors."""
    from matplotlib.ticker import FixedLocator, NullLocator

    axes.set_yscale("symlog", linthresh=_LINEAR, linscale=1.6)
    axes.axhspan(-1.0, 1.0, color=_BAND, lw=0.0)
    axes.axhline(0.0, color=line.colour, lw=0.8)
    for scan in scans:
        axes.plot(scan.exit_deg, residuals[scan.rows], "o", color=line.colour, ms=2.6, mew=0.0)
    top = max(1.6 * reach, 2.0 * _LINEAR)
    outermost = 10.0 ** np.floor(np.log10(top))
    axes.set_ylim(-top, top)
    axes.yaxis.set_major_locator(FixedLocator([-outermost, 0.0, outermost]))
    axes.yaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_major_formatter(
        lambda value, _: f"{value:+.0f}" if 0.0 < abs(value) < 1e4 else f"{value:+.0e}" if value else "0"
    )
    axes.tick_params(axis="y", labelsize=7.5)


def _limits(quantity: Quantity) -> tuple[float, float]:
    measured = quantity.measured[np.isfinite(quantity.measured)]
    curves = np.concatenate([curve[np.isfinite(curve)] for curve in quantity.models.values()])
    if quantity.is_logarithmic:
        positive = measured[measured > 0.0]
        low, high = (positive.min(), positive.max()) if positive.size else (1e-3, 1.0)
        return float(low) / _BELOW, float(max(high, min(curves.max(initial=high), _BELOW * high))) * 1.4
    high = max(measured.max(initial=0.0), curves.max(initial=0.0))
    return -0.02, float(min(max(1.08 * high, 0.05), 1.05))


def _hidden(quantity: Quantity) -> str:
    """How many measured values the axis cannot show."""
    if quantity.is_logarithmic:
        count, what = int((quantity.measured <= 0.0).sum()), "not above 0"
    else:
        beyond = np.isnan(quantity.measured) | (quantity.measured > _limits(quantity)[1])
        count, what = int(beyond.sum()), "above 1 or without S0"
    return f"{count} values {what}" if count else ""


def _name_curves(axes: Axes, curves: Mapping[str, tuple[FloatArray, FloatArray]], lines: Mapping[str, Line]) -> None:
    """Names at the heights where curves end, moved apart as little as they must."""
    low, high = axes.get_ylim()
    ends = {
        name: (at[-1], float(np.clip(np.nan_to_num(curve[-1], nan=low), low, high)))
        for name, (at, curve) in curves.items()
    }
    places = axes.transAxes.inverted().transform(axes.transData.transform(list(ends.values())))
    heights = _apart(places[:, 1])
    for name, end, height in zip(ends, places, heights, strict=True):
        colour = lines[name].colour
        axes.annotate(
            *(name, end),
            xytext=(1.05, height),
            xycoords="axes fraction",
            textcoords="axes fraction",
            va="center",
            size=8.5,
            color=colour,
            parse_math=False,
            arrowprops={
                "arrowstyle": "-",
                "color": colour,
                "lw": 0.7,
                "alpha": 0.6,
                "shrinkA": 1,
                "shrinkB": 2,
                "relpos": (0.0, 0.5),
            },
        )


def _apart(heights: FloatArray) -> FloatArray:
    """Heights moved as little as leaves a gap between any two, in their order, and all within the panel."""
    order = np.argsort(heights, kind="stable")
    placed = heights[order]
    for _ in range(_ROUNDS):
        overlaps = np.maximum(_LABEL_GAP - np.diff(placed), 0.0) / 2.0
        placed[:-1] -= overlaps
        placed[1:] += overlaps
        placed = np.clip(placed, 0.0, 1.0)
    return placed[np.argsort(order)]
