"""The picture of a scan: what was measured, the fit, what is left over, and the parameters with their errors."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from acquisition.fit_points import dataset
from acquisition.readings import StokesPoint
from acquisition.whole_file import written_whole
from goniometer.fitted_curve import FittedCurve
from goniometer.fitting.remarks import remarks
from goniometer.fitting.summary import ParameterRow, parameter_rows, quality
from goniometer.plot_style import DPI, FAINT, RULE, STYLE
from goniometer.report_head import LEFT, RIGHT, ROW_IN, draw_head, key_rows
from goniometer.report_panels import (
    Quantity,
    draw_quantity,
    draw_residuals,
    quantities,
)
from goniometer.scan_planes import Plane
from model.fit import Dataset, FitResult

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_WIDTH_IN, _HEAD_IN, _PANELS_IN, _X_LABEL_IN = 13.0, 1.15, 5.2, 0.7
_SMALL_ROW_IN, _FOOT_MARGIN_IN = 0.155, 0.3
_GAP_OF_WIDTH = 0.052
"""Between two panels, for the numbers on their axes."""
_TEXT_LEFT, _TEXT_COLUMNS, _QUALITY_COLUMNS = 0.535, 96, 92
_COLUMNS = {"name": 0.0, "meaning": 0.04, "value": 0.225, "error": 0.235, "truth": 0.365, "off": 0.43}
"""Left edges of the parameter table's columns in parts of the width; value, truth and off end there."""
_STYLE: dict[Any, Any] = {
    **STYLE,
    "legend.frameon": False,
    "axes.formatter.min_exponent": 3,
    "axes.formatter.limits": (-3, 5),
}
_SYMBOLS = {
    "sigma": ("$\\sigma$", "roughness, rms slope"),
    "n": ("$n$", "refractive index"),
    "k": ("$k$", "extinction coefficient"),
    "asymmetry": ("$a$", "asymmetry of grooves"),
    "rho_s": ("$\\rho_\\mathrm{s}$", "weight, specular"),
    "rho_d": ("$\\rho_\\mathrm{d}$", "weight, diffuse"),
    "rho_dd": ("$\\rho_\\mathrm{dd}$", "weight, directional"),
    "incidence_offset_deg": ("$\\delta_\\mathrm{i}$", "offset of incidence (°)"),
    "exit_offset_deg": ("$\\delta_\\mathrm{r}$", "offset of exit (°)"),
    "analyzer_offset_deg": ("$\\delta_\\psi$", "offset of analyzer (°)"),
    "gain": ("$g$", "gain"),
    "background_per_sr": ("$b$", "background (1/sr)"),
}


def draw_report(
    path: Path,
    *,
    title: str,
    points: Sequence[StokesPoint],
    fit: FitResult | None,
    curves: Sequence[FittedCurve],
    truth: Mapping[str, float],
    planes: Sequence[Plane] = (),
) -> None:
    """Draw S0, DoLP and AoLP against the exit angle with the fit, its residuals and its parameters, as a PNG file.

    Where S3 was measured, the degree of circular polarization stands beside them. The DoLP is the one with the bias of
    noise removed. S0 that a logarithmic axis cannot show is marked at its edge.

    Parameters
    ----------
    path : Path
        The file; replaced as a whole if it exists.
    title : str
        What was measured.
    points : sequence of StokesPoint
        At least one.
    fit : FitResult or None
        The fit of these points; without it there are no lines, residuals and parameters.
    curves : sequence of FittedCurve
        The same fit between the points of each plane; none without a fit.
    truth : mapping of str to float
        The simulated sample's own parameters; empty for a real sample.
    planes : sequence of Plane
        Which points are at one incidence and one azimuth, each plane in a colour of its own; none: all of them.

    Raises
    ------
    JournalError
        The file cannot be written.
    """
    import matplotlib as mpl  # half a second that a scan's start does not need
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    verdict, description = ([], []) if fit is None else _wrapped(fit, dataset(points))
    foot_in = _FOOT_MARGIN_IN
    if fit is not None:
        table_in = ROW_IN * (len(fit.parameters) + 1.6) + _SMALL_ROW_IN * len(verdict)
        foot_in += max(table_in, _SMALL_ROW_IN * len(description))
    with mpl.rc_context(_STYLE), written_whole(path) as part:
        head_in = _HEAD_IN + ROW_IN * key_rows(planes)
        figure = Figure(figsize=(_WIDTH_IN, head_in + _PANELS_IN + foot_in))
        FigureCanvasAgg(figure)
        draw_head(figure, title, points, fit, planes)
        _draw_panels(figure, quantities(points, fit, curves, planes), head_in, foot_in, has_fit=fit is not None)
        if fit is not None:
            _draw_table(figure, parameter_rows(fit, truth), foot_in)
            _draw_text(figure, LEFT, foot_in - ROW_IN * (len(fit.parameters) + 1.4), verdict)
            _draw_text(figure, _TEXT_LEFT, foot_in, description)
        figure.savefig(part, format="png", dpi=DPI)


def _draw_panels(figure: Figure, shown: Sequence[Quantity], head_in: float, foot_in: float, *, has_fit: bool) -> None:
    height_in = figure.get_figheight()
    grid = figure.add_gridspec(
        2,
        len(shown),
        height_ratios=(3.2, 1.0),
        left=LEFT,
        right=RIGHT,
        top=1.0 - head_in / height_in,
        bottom=(foot_in + _X_LABEL_IN) / height_in,
        wspace=_GAP_OF_WIDTH * len(shown) / (RIGHT - LEFT - _GAP_OF_WIDTH * (len(shown) - 1)),
        hspace=0.16,
    )
    for column, quantity in enumerate(shown):
        lowest = axes = figure.add_subplot(grid[0, column] if has_fit else grid[:, column])
        draw_quantity(axes, quantity)
        if has_fit:
            lowest = figure.add_subplot(grid[1, column], sharex=axes)
            draw_residuals(lowest, quantity)
            lowest.set_title("residual in standard errors", loc="left", size="small", color=FAINT, pad=3.0)
            axes.tick_params(labelbottom=False)
        lowest.set_xlabel("exit angle (°)")


def _draw_table(figure: Figure, rows: Sequence[ParameterRow], foot_in: float) -> None:
    from matplotlib.lines import Line2D

    height_in = figure.get_figheight()
    has_truth = any(row.truth for row in rows)

    def write(line: float, column: str, text: str, align: str = "left", **style: Any) -> None:
        y = (foot_in - ROW_IN * (line + 0.5)) / height_in
        figure.text(LEFT + _COLUMNS[column], y, text, ha=align, va="center", **style)

    def rule(line: float, width: float) -> None:
        y = (foot_in - ROW_IN * line) / height_in
        right = LEFT + (_COLUMNS["off"] if has_truth else _COLUMNS["truth"])
        figure.add_artist(Line2D([LEFT, right], [y, y], color=RULE, linewidth=width))

    write(0, "name", "parameter", color=FAINT)
    write(0, "value", "value", "right", color=FAINT)
    write(0, "error", "± error", color=FAINT)
    if has_truth:
        write(0, "truth", "truth", "right", color=FAINT)
        write(0, "off", "off, in ±", "right", color=FAINT)
    for line, row in enumerate(rows, start=1):
        symbol, meaning = _SYMBOLS.get(row.name, (row.name, ""))
        write(line, "name", symbol)
        write(line, "meaning", meaning, color=FAINT)
        write(line, "value", row.value, "right", weight="bold")
        write(line, "error", f"± {row.error}" if row.error else row.note)
        if has_truth:
            write(line, "truth", row.truth, "right")
            write(line, "off", row.off.replace("-", "−"), "right")
    rule(0, 1.0)
    rule(1, 0.6)
    rule(len(rows) + 1, 1.0)


def _draw_text(figure: Figure, left: float, top_in: float, lines: Sequence[str]) -> None:
    figure.text(left, top_in / figure.get_figheight(), "\n".join(lines), va="top", size=8.0, linespacing=1.35)


def _wrapped(fit: FitResult, data: Dataset) -> tuple[list[str], list[str]]:
    """What is to be said about the fit, and what the model consists of, in lines that fit their places."""
    said = [line for remark in (quality(fit), *remarks(fit, data)) for line in remark.splitlines()]
    verdict = [line for text in said for line in textwrap.wrap(text, _QUALITY_COLUMNS)]
    paragraphs = [textwrap.wrap(paragraph, _TEXT_COLUMNS) for paragraph in fit.description.splitlines()]
    return verdict, [line for lines in paragraphs for line in (*lines, "")]
