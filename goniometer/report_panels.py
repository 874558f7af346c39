"""The report's panels: one measured quantity against the exit angle, and what the fit leaves of it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from acquisition.readings import StokesPoint
from goniometer.fitted_curve import FittedCurve
from goniometer.plot_style import BAND, COLOURS, FAINT
from model.fit import FitResult
from model.geometry import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes

DATA_COLOUR, FIT_COLOUR = COLOURS[:2]
_MANY = 150
"""Number of points above which they are small and faint."""
_LEAST_RESIDUAL_REACH = 3.5
_LEAST_ANGLE_SPAN_DEG = 10.0
_VAGUEST_DEG = 20.0


@dataclass(frozen=True)
class Quantity:
    """One measured quantity in the order of the exit angle, and the fit's values where there is a fit.

    Arrays have the shape (N,), but for the fit's curve: exit angles in degrees and values, (K,) each. Values below
    `floor` or above `ceiling` are only marked at the edge; a floor goes with a logarithmic axis. Values with a standard
    error above `vaguest` are left out. `period` is that of an angle.
    """

    title: str
    exit_deg: FloatArray
    measured: FloatArray
    stderr: FloatArray
    fitted: FloatArray | None
    curve: tuple[FloatArray, FloatArray] | None = None
    floor: float | None = None
    ceiling: float | None = None
    vaguest: float | None = None
    period: float | None = None

    def residuals(self) -> FloatArray:
        """Measured less fitted in standard errors.

        For an angle it is the sine of the difference: the part of the measured polarization that lies across the fitted
        direction, which scatters evenly also where little polarization lets the angle itself be almost anything.
        """
        if self.fitted is None:
            return np.full_like(self.measured, np.nan)
        difference = self.measured - self.fitted
        if self.period is not None:
            turns_to_rad = 2.0 * math.pi / self.period
            difference = np.sin(difference * turns_to_rad) / turns_to_rad
        return difference / self.stderr


def quantities(
    points: Sequence[StokesPoint], fit: FitResult | None = None, curve: FittedCurve | None = None
) -> list[Quantity]:
    """S0, DoLP and AoLP of a scan, the last two from the fitted Stokes parameters where there is a fit.

    Where S3 was measured, the degree of circular polarization follows; in plane the fitted surfaces make none.
    """
    order = np.argsort([point.exit_deg for point in points], kind="stable")

    def column(values: Iterable[float]) -> FloatArray:
        return np.array(list(values), dtype=float)[order]

    exit_deg = column(point.exit_deg for point in points)
    s0 = column(point.stokes[0] for point in points)
    s0_stderr = column(math.sqrt(point.covariance[0, 0]) for point in points)
    dolp = column(point.dolp_debiased for point in points)
    dolp_stderr = column(point.dolp_stderr for point in points)
    aolp_deg = column(point.aolp_deg for point in points)
    aolp_stderr_deg = column(point.aolp_stderr_deg for point in points)
    fits = [None] * 3 if fit is None else _of_stokes(fit.stokes[order])
    curves = [None] * 3 if curve is None else [(curve.exit_deg, line) for line in _of_stokes(curve.stokes)]
    shown = [
        Quantity("$S_0$ (1/sr)", exit_deg, s0, s0_stderr, fits[0], curves[0], floor=_noise_floor(s0, s0_stderr)),
        Quantity("degree of linear polarization", exit_deg, dolp, dolp_stderr, fits[1], curves[1], ceiling=1.0),
        Quantity(
            *("angle of linear polarization (°)", exit_deg, aolp_deg, aolp_stderr_deg, fits[2], curves[2]),
            vaguest=_VAGUEST_DEG,
            period=180.0,
        ),
    ]
    if all(point.has_s3 for point in points):
        docp, docp_stderr = (column(getattr(point, name) for point in points) for name in ("docp", "docp_stderr"))
        fitted = None if fit is None else np.zeros(len(order))
        line = None if curve is None else (curve.exit_deg, np.zeros(len(curve.exit_deg)))
        shown.append(Quantity("degree of circular polarization", exit_deg, docp, docp_stderr, fitted, line))
    return shown


def _of_stokes(stokes: FloatArray) -> list[FloatArray]:
    """S0, DoLP and AoLP in degrees, (N,) each."""
    s0, s1, s2 = stokes.T
    return [s0, np.hypot(s1, s2) / s0, np.degrees(0.5 * np.arctan2(s2, s1))]


def draw_quantity(axes: Axes, quantity: Quantity) -> None:
    """Draw the measured values with error bars and the fit as a line."""
    shown = quantity.measured
    if quantity.floor is not None:
        axes.set_yscale("log", nonpositive="clip")
        shown = _at_edge(axes, quantity, ~(shown >= quantity.floor), quantity.floor, "v", "▽ {} below the noise")
    if quantity.ceiling is not None:
        shown = _at_edge(axes, quantity, shown > quantity.ceiling, quantity.ceiling, "^", "△ {} above 1")
    if quantity.vaguest is not None:
        shown = _left_out(axes, shown, quantity.stderr > quantity.vaguest, "{} undetermined, not shown")
    if quantity.curve is not None:
        at_deg, line = quantity.curve
        above = 3 if len(quantity.exit_deg) > _MANY else 1
        axes.plot(at_deg, _broken_at_wraps(line, quantity.period), color=FIT_COLOUR, lw=1.4, zorder=above)
    _draw_points(axes, quantity.exit_deg, shown, quantity.stderr)
    axes.set_title(quantity.title, loc="left", size="medium")
    axes.set_ylim(*_limits(quantity, shown))
    ends_deg = quantity.exit_deg[[0, -1]]
    axes.set_xlim(*(ends_deg + np.array([-1.0, 1.0]) * max(0.04 * np.ptp(ends_deg), 0.5)))
    axes.grid(visible=True)


def draw_residuals(axes: Axes, quantity: Quantity) -> None:
    """Draw what the fit leaves, in standard errors, over a band of one standard error."""
    residuals = quantity.residuals()
    axes.axhspan(-1.0, 1.0, color=BAND, lw=0.0)
    axes.axhline(0.0, color=FIT_COLOUR, lw=1.2)
    _draw_points(axes, quantity.exit_deg, residuals, None)
    reach = 1.15 * float(np.nanmax(np.abs(residuals), initial=_LEAST_RESIDUAL_REACH / 1.15))
    axes.set_ylim(-reach, reach)
    axes.locator_params(axis="y", nbins=4, integer=True)


def _draw_points(axes: Axes, exit_deg: FloatArray, values: FloatArray, stderr: FloatArray | None) -> None:
    many = len(exit_deg) > _MANY
    if stderr is not None:
        width, opacity = (0.4, 0.1) if many else (0.9, 1.0)
        axes.errorbar(exit_deg, values, stderr, fmt="none", ecolor=DATA_COLOUR, elinewidth=width, alpha=opacity)
    axes.plot(exit_deg, values, "o", color=DATA_COLOUR, ms=1.8 if many else 3.4, mew=0.0, alpha=0.5 if many else 1.0)


def _at_edge(
    axes: Axes, quantity: Quantity, lost: NDArray[np.bool_], edge: float, marker: str, note: str
) -> FloatArray:
    """Mark values that the axis cannot show, or only as accidents of noise, at its edge; the others come back."""
    edges = np.full(np.count_nonzero(lost), edge)
    axes.plot(quantity.exit_deg[lost], edges, marker, color=DATA_COLOUR, mfc="white", ms=4, mew=0.6)
    return _left_out(axes, quantity.measured, lost, note)


def _left_out(axes: Axes, values: FloatArray, lost: NDArray[np.bool_], note: str) -> FloatArray:
    """Take values out of the picture, and say how many."""
    if lost.any():
        text = note.format(np.count_nonzero(lost))
        edge = {"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1.0}
        axes.text(
            0.99, 0.99, text, transform=axes.transAxes, ha="right", va="top", size="small", color=FAINT, bbox=edge
        )
    return np.where(lost, np.nan, values)


def _noise_floor(measured: FloatArray, stderr: FloatArray) -> float | None:
    """The least value that is worth showing on a logarithmic axis; None when there is none at all."""
    positive = measured[measured > 0.0]
    return max(float(positive.min()), float(stderr.min())) if positive.size and positive.max() > stderr.min() else None


def _limits(quantity: Quantity, shown: FloatArray) -> tuple[float, float]:
    """Limits by the values: error bars may run out of the picture, values may not."""
    # An angle turns anywhere where hardly anything is polarized: there its curve may leave the picture.
    line = quantity.fitted if quantity.period is not None or quantity.curve is None else quantity.curve[1]
    values = shown if line is None else np.concatenate([shown, line])
    values = values[np.isfinite(values)]
    low, high = (float(values.min()), float(values.max())) if values.size else (0.0, 1.0)
    if quantity.floor is not None:
        return min(low, quantity.floor) / 1.6, high * 1.6
    if quantity.period is not None:
        middle, half = (low + high) / 2.0, max(high - low, _LEAST_ANGLE_SPAN_DEG) / 2.0
        return middle - 1.1 * half, middle + 1.1 * half
    if quantity.ceiling is not None and (quantity.measured > quantity.ceiling).any():
        high = quantity.ceiling
    low, high = min(low, 0.0), max(high, 0.0)
    margin = 0.08 * (high - low) or 1.0
    return low - margin / 2.0, high + margin


def _broken_at_wraps(line: FloatArray, period: float | None) -> FloatArray:
    """Leave gaps where an angle jumps by a period, so that no line crosses the picture."""
    if period is None:
        return line
    jumps = np.flatnonzero(np.abs(np.diff(line)) > period / 2.0)
    broken = line.copy()
    broken[jumps] = np.nan
    return broken
