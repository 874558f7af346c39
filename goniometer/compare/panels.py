"""The panels of a comparison's picture: a measured quantity with every model's curve, and what one model leaves."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from goniometer.compare.command import Comparison
from goniometer.curve_names import CurveName, name_curves
from goniometer.fitted_curve import filled, fitted_stokes
from goniometer.plot_style import BAND, FAINT, INK, RULE
from model.comparison.measured_dolp import measured_dolp
from model.fit import Dataset
from model.fit.observable import Elements
from model.geometry import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_BELOW = 3.0
"""A curve of S0 is shown down to so much below the least measured value."""
_LINEAR = 3.0
"""Residuals in standard errors up to which a strip is linear; beyond it is logarithmic."""
_SCAN_NAME: dict[str, Any] = {"size": 8, "color": FAINT, "zorder": 21}


@dataclass(frozen=True)
class Line:
    """How a model's curve looks."""

    colour: str
    dashes: Any


@dataclass(frozen=True, eq=False)
class Scan:
    """What a curve may connect: rows of one incidence in one plane, in the order of their signed exit angles.

    The curve itself goes through more directions, in rad, at the signed exit angles `curve_deg`.
    """

    rows: NDArray[np.int64]
    exit_deg: FloatArray
    incidence_deg: float
    curve_deg: FloatArray
    curve_rad: tuple[FloatArray, FloatArray, FloatArray]


@dataclass(frozen=True, eq=False)
class Quantity:
    """One measured quantity and every model's, shape (N,), with the unit in which residuals are counted.

    `curves` holds every model's along each of the scans.
    """

    title: str
    measured: FloatArray
    stderr: FloatArray | None
    models: Mapping[str, FloatArray]
    curves: Mapping[str, Sequence[FloatArray]]
    is_logarithmic: bool

    def residuals(self, name: str) -> FloatArray:
        """What a model leaves, in standard errors; where nobody knows these, in the rms of what the best leaves."""
        left = self.measured - self.models[name]
        if self.stderr is not None:
            return left / self.stderr
        best = self.measured - next(iter(self.models.values()))
        unit = float(np.sqrt(np.nanmean(best**2)))
        return left / unit if unit > 0.0 else left


def quantities(found: Comparison, scans: Sequence[Scan]) -> Iterator[Quantity]:
    """S0, where it was compared, and the DoLP, where the data hold it."""
    data = found.given.data
    fits = {model.candidate.name: model.fit for model in found.models if model.fit is not None}
    lights = {
        model.candidate.name: [fitted_stokes(model.candidate.family, model.fit, scan.curve_rad) for scan in scans]
        for model in found.models
        if model.fit is not None
    }
    if found.objective == "stokes" and isinstance(data.observable, Elements) and 0 in data.observable.picked:
        place = data.observable.picked.index(0)
        stderr = None if data.covariance is None else np.sqrt(data.covariance[:, place, place])
        s0 = {name: fit.stokes[:, 0] for name, fit in fits.items()}
        curves = {name: [light[:, 0] for light in along] for name, along in lights.items()}
        yield Quantity("$S_0$ (1/sr)", data.values[:, place], stderr, s0, curves, is_logarithmic=True)
    dolp = measured_dolp(data)
    if dolp is not None:
        fitted = {name: _dolp(fit.stokes) for name, fit in fits.items()}
        curves = {name: [_dolp(light) for light in along] for name, along in lights.items()}
        yield Quantity("degree of linear polarization", dolp.values, dolp.stderr, fitted, curves, is_logarithmic=False)


def _dolp(stokes: FloatArray) -> FloatArray:
    s0, s1, s2 = stokes.T
    return np.asarray(np.hypot(s1, s2) / s0)


def scans(data: Dataset) -> list[Scan]:
    """The scans that data consist of; an exit angle on the source's side is negative."""
    exit_deg = np.degrees(np.where(np.cos(data.azimuth_rad) < 0.0, data.exit_rad, -data.exit_rad))
    planes = np.round(np.column_stack([data.incidence_rad, np.abs(np.sin(data.azimuth_rad))]), 6)
    found = []
    for plane in np.unique(planes, axis=0):
        rows = np.flatnonzero((planes == plane).all(axis=1))
        rows = rows[np.argsort(exit_deg[rows], kind="stable")]
        found.append(_scan(rows, exit_deg[rows], *plane.tolist()))
    return found


def _scan(rows: NDArray[np.int64], exit_deg: FloatArray, incidence_rad: float, sine: float) -> Scan:
    """`sine` is that of the azimuth, without its sign: light on either side of the plane of incidence is as bright."""
    curve_deg, aside_rad = filled(exit_deg), np.arcsin(sine)
    azimuth_rad = np.where(curve_deg >= 0.0, np.pi - aside_rad, aside_rad)
    directions_rad = np.full(len(curve_deg), incidence_rad), np.abs(np.radians(curve_deg)), azimuth_rad
    return Scan(rows, exit_deg, float(np.degrees(incidence_rad)), curve_deg, directions_rad)


def draw_curves(axes: Axes, quantity: Quantity, lines: Mapping[str, Line], scans: Sequence[Scan]) -> None:
    """Draw the measured values, every model's curve, the best on top, and the models' names beside the curves' ends."""
    if quantity.is_logarithmic:
        axes.set_yscale("log", nonpositive="mask")
    for place, (name, line) in enumerate(reversed(list(lines.items()))):
        for scan, curve in zip(scans, quantity.curves[name], strict=True):
            axes.plot(scan.curve_deg, curve, ls=line.dashes, color=line.colour, lw=1.5, zorder=3 + place)
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
    last = scans[-1]
    ends = {name: (float(last.exit_deg[-1]), float(quantity.models[name][last.rows[-1]])) for name in lines}
    name_curves(axes, [CurveName(name, ends[name], line.colour, line.dashes) for name, line in lines.items()])


def draw_strip(axes: Axes, residuals: FloatArray, line: Line, scans: Sequence[Scan], reach: float) -> None:
    """Draw what one model leaves, on an axis that is linear up to a few standard errors."""
    from matplotlib.ticker import FixedLocator, NullLocator

    # An eighth more than the farthest point needs of the logarithmic part.
    top = _LINEAR * max(reach / _LINEAR, 1.5) ** 1.125
    decades = np.log10(top / _LINEAR)
    # As much room up to where the axis changes as beyond.
    axes.set_yscale("symlog", linthresh=_LINEAR, linscale=0.9 * max(decades, 1.0))
    axes.axhspan(-1.0, 1.0, color=BAND, lw=0.0)
    axes.axhline(0.0, color=line.colour, lw=0.8)
    for side in (-_LINEAR, _LINEAR):
        axes.axhline(side, color=RULE, lw=0.6, ls=(0, (1, 2)))
    for scan in scans:
        axes.plot(scan.exit_deg, residuals[scan.rows], "o", color=line.colour, ms=2.6, mew=0.0)
    axes.set_ylim(-top, top)
    outermost = 10.0 ** np.floor(np.log10(top))
    beyond = [outermost] if outermost > _LINEAR else []
    ticks = [0.0, *(side * tick for tick in (_LINEAR, *beyond) for side in (-1.0, 1.0))]
    axes.yaxis.set_major_locator(FixedLocator(ticks))
    axes.yaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_major_formatter(lambda value, _: _signed(value))
    axes.tick_params(axis="y", labelsize=7)


def _signed(value: float) -> str:
    text = f"{value:+.0f}" if 0.0 < abs(value) < 1e4 else f"{value:+.0e}" if value else "0"
    return text.replace("-", "\N{MINUS SIGN}", 1)


def _limits(quantity: Quantity) -> tuple[float, float]:
    measured = quantity.measured[np.isfinite(quantity.measured)]
    every = np.concatenate([curve for along in quantity.curves.values() for curve in along])
    curves = every[np.isfinite(every)]
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
