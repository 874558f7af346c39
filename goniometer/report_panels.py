"""The report's panels: one measured quantity against the exit angle, and what the fit leaves of it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from acquisition.readings import StokesPoint
from goniometer.fitted_curve import FittedCurve
from goniometer.plot_style import BAND, COLOURS, FAINT, RULE
from goniometer.scan_planes import Plane
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

    Arrays have the shape (N,), but for the fit's curves: exit angles in degrees and values, (K,) each, one curve for
    each plane; `plane` says which of them a value belongs to, and None that there is only one. Values below
    `floor` or above `ceiling` are only marked at the edge; a floor goes with a logarithmic axis. Values with a standard
    error above `vaguest` are left out. `period` is that of an angle.
    """

    title: str
    exit_deg: FloatArray
    measured: FloatArray
    stderr: FloatArray
    fitted: FloatArray | None
    curves: tuple[tuple[FloatArray, FloatArray], ...] = ()
    floor: float | None = None
    ceiling: float | None = None
    vaguest: float | None = None
    period: float | None = None
    plane: NDArray[np.intp] | None = None

    def planes(self) -> Iterator[tuple[NDArray[np.bool_], str, str]]:
        """Which values belong to each plane, and the colours of its values and of its curve."""
        if self.plane is None:
            yield np.ones(len(self.exit_deg), bool), DATA_COLOUR, FIT_COLOUR
            return
        count = int(self.plane.max()) + 1
        for number, colour in enumerate(plane_colours(count)):
            yield self.plane == number, colour, colour

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


def plane_colours(count: int) -> list[str]:
    """A colour for each plane of a scan: the first one for a single one; of many, neighbours are alike."""
    if count <= len(COLOURS):
        return list(COLOURS[:count])
    from matplotlib import colormaps
    from matplotlib.colors import to_hex

    return [to_hex(colormaps["viridis"](share)) for share in np.linspace(0.0, 0.92, count)]


def quantities(
    points: Sequence[StokesPoint],
    fit: FitResult | None = None,
    curves: Sequence[FittedCurve] = (),
    planes: Sequence[Plane] = (),
) -> list[Quantity]:
    """S0, DoLP and AoLP of a scan, the last two from the fitted Stokes parameters where there is a fit.

    Where S3 was measured, the degree of circular polarization follows; in plane the fitted surfaces make none. Without
    planes, or with one, all points are in the same; there is a curve for each plane, or none at all.
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
    lines = [[(curve.exit_deg, line) for line in _of_stokes(curve.stokes)] for curve in curves]
    s0_lines, dolp_lines, aolp_lines = (tuple(each) for each in zip(*lines, strict=True)) if lines else ((), (), ())
    plane = _plane_of(len(points), planes)[order] if len(planes) > 1 else None
    shown = [
        Quantity("$S_0$ (1/sr)", exit_deg, s0, s0_stderr, fits[0], s0_lines, floor=_noise_floor(s0, s0_stderr)),
        Quantity("degree of linear polarization", exit_deg, dolp, dolp_stderr, fits[1], dolp_lines, ceiling=1.0),
        Quantity(
            *("angle of linear polarization (°)", exit_deg, aolp_deg, aolp_stderr_deg, fits[2], aolp_lines),
            vaguest=_VAGUEST_DEG,
            period=180.0,
        ),
    ]
    if all(point.has_s3 for point in points):
        docp, docp_stderr = (column(getattr(point, name) for point in points) for name in ("docp", "docp_stderr"))
        fitted = None if fit is None else np.zeros(len(order))
        zeros = tuple((curve.exit_deg, np.zeros(len(curve.exit_deg))) for curve in curves)
        shown.append(Quantity("degree of circular polarization", exit_deg, docp, docp_stderr, fitted, zeros))
    return [replace(quantity, plane=plane) for quantity in shown]


def _plane_of(count: int, planes: Sequence[Plane]) -> NDArray[np.intp]:
    """Of each of the points the number of its plane."""
    plane_of = np.zeros(count, np.intp)
    for number, plane in enumerate(planes):
        plane_of[plane.rows] = number
    return plane_of


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
    above = 3 if len(quantity.exit_deg) > _MANY else 1
    for (_, _, colour), (at_deg, line) in zip(quantity.planes(), quantity.curves, strict=False):
        axes.plot(at_deg, _broken_at_wraps(line, quantity.period), color=colour, lw=1.4, zorder=above)
    _draw_points(axes, quantity, shown, has_errors=True)
    axes.set_title(quantity.title, loc="left", size="medium")
    axes.set_ylim(*_limits(quantity, shown))
    ends_deg = quantity.exit_deg[[0, -1]]
    axes.set_xlim(*(ends_deg + np.array([-1.0, 1.0]) * max(0.04 * np.ptp(ends_deg), 0.5)))
    axes.grid(visible=True)


def draw_residuals(axes: Axes, quantity: Quantity) -> None:
    """Draw what the fit leaves, in standard errors, over a band of one standard error."""
    residuals = quantity.residuals()
    axes.axhspan(-1.0, 1.0, color=BAND, lw=0.0)
    axes.axhline(0.0, color=FIT_COLOUR if quantity.plane is None else RULE, lw=1.2)
    _draw_points(axes, quantity, residuals, has_errors=False)
    reach = 1.15 * float(np.nanmax(np.abs(residuals), initial=_LEAST_RESIDUAL_REACH / 1.15))
    axes.set_ylim(-reach, reach)
    axes.locator_params(axis="y", nbins=4, integer=True)


def _draw_points(axes: Axes, quantity: Quantity, values: FloatArray, *, has_errors: bool) -> None:
    many = len(quantity.exit_deg) > _MANY
    for of_plane, colour, _ in quantity.planes():
        exit_deg, shown = quantity.exit_deg[of_plane], values[of_plane]
        if has_errors:
            width, opacity = (0.4, 0.1) if many else (0.9, 1.0)
            stderr = quantity.stderr[of_plane]
            axes.errorbar(exit_deg, shown, stderr, fmt="none", ecolor=colour, elinewidth=width, alpha=opacity)
        axes.plot(exit_deg, shown, "o", color=colour, ms=1.8 if many else 3.4, mew=0.0, alpha=0.5 if many else 1.0)


def _at_edge(
    axes: Axes, quantity: Quantity, lost: NDArray[np.bool_], edge: float, marker: str, note: str
) -> FloatArray:
    """Mark values that the axis cannot show, or only as accidents of noise, at its edge; the others come back."""
    for of_plane, colour, _ in quantity.planes():
        there_deg = quantity.exit_deg[lost & of_plane]
        axes.plot(there_deg, np.full(len(there_deg), edge), marker, color=colour, mfc="white", ms=4, mew=0.6)
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
    lines = [line for _, line in quantity.curves]
    if quantity.period is not None or not lines:
        lines = [] if quantity.fitted is None else [quantity.fitted]
    values = np.concatenate([shown, *lines])
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
