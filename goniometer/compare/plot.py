"""The picture of a comparison: the data with every model's curve, and what each model leaves of them."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from goniometer.compare.command import Comparison
from goniometer.compare.panels import Line, Quantity, Scan, draw_curves, draw_strip, quantities, scans
from goniometer.compare.text import criterion
from goniometer.errors import FitError, JournalError
from goniometer.plot_style import COLOURS, DASHES, DPI, FAINT, STYLE

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_HEAD_IN, _PANEL_IN, _BETWEEN_IN, _STRIP_IN, _FOOT_IN = 1.25, 3.7, 0.6, 0.8, 0.6
_LEFT_IN, _COLUMN_IN, _LABELS_IN = 0.75, 4.4, 1.95


def draw_comparison(path: Path, found: Comparison) -> None:
    """Draw S0 and DoLP against the exit angle with every model's curve, and each model's residuals, as a PNG file.

    Parameters
    ----------
    path : Path
        The file; replaced if it exists.
    found : Comparison
        What is drawn; S0 is left out where it was not compared.

    Raises
    ------
    FitError
        The data hold neither S0 nor DoLP.
    JournalError
        The file cannot be written.
    """
    import matplotlib as mpl  # half a second that other commands do not need
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    along = scans(found.given.data)
    shown = list(quantities(found, along))
    if not shown:
        raise FitError(f"{found.given.path} holds neither S0 nor DoLP. The picture {path} was not drawn.")
    lines = _lines(found)
    height_in = _HEAD_IN + _PANEL_IN + _BETWEEN_IN + _STRIP_IN * len(lines) + _FOOT_IN
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(_LEFT_IN + (_COLUMN_IN + _LABELS_IN) * len(shown), height_in))
        FigureCanvasAgg(figure)
        _draw_head(figure, found)
        for column, quantity in enumerate(shown):
            _draw_column(figure, column, quantity, lines, along)
        _name_strips(figure, found, lines)
        try:
            figure.savefig(path, format="png", dpi=DPI)
        except OSError as error:
            raise JournalError(
                f"The picture {path} cannot be written: {error.strerror}. The comparison is complete without it. "
                "Choose another name."
            ) from error


def _lines(found: Comparison) -> dict[str, Line]:
    """By name, in the order of the ranking; a model looks the same whatever its rank."""
    names = sorted(model.candidate.name for model in found.models)
    looks = zip(itertools.cycle(COLOURS), itertools.cycle(DASHES), strict=False)
    by_name = {name: Line(*look) for name, look in zip(names, looks, strict=False)}
    return {model.candidate.name: by_name[model.candidate.name] for model in found.models if model.fit is not None}


def _draw_head(figure: Figure, found: Comparison) -> None:
    data, height_in = found.given.data, figure.get_figheight()
    left = _LEFT_IN / figure.get_figwidth()
    incidence_deg = ", ".join(f"{value:g}°" for value in np.unique(np.round(np.degrees(data.incidence_rad), 2)))
    dots = "dots: measured" if data.covariance is None else "dots: measured ± standard error"
    details = f"incidence {incidence_deg}     {len(data)} points     {dots}     lines: each model's best fit"
    figure.text(left, 1.0 - 0.36 / height_in, data.name, size=16, weight="bold", va="center", parse_math=False)
    figure.text(left, 1.0 - 0.68 / height_in, details, color=FAINT, va="center")


def _draw_column(
    figure: Figure, column: int, quantity: Quantity, lines: Mapping[str, Line], scans: Sequence[Scan]
) -> None:
    top_in = figure.get_figheight() - _HEAD_IN
    panel = _axes(figure, column, top_in, _PANEL_IN)
    draw_curves(panel, quantity, lines, scans)
    residuals = {name: quantity.residuals(name) for name in lines}
    reach = float(np.nanmax(np.abs(list(residuals.values()))))
    for place, (name, line) in enumerate(lines.items()):
        strip = _axes(figure, column, _strip_top_in(figure, place) - 0.06, _STRIP_IN - 0.12, sharex=panel)
        draw_strip(strip, residuals[name], line, scans, reach)
        strip.tick_params(labelbottom=place == len(lines) - 1)
        if place == 0:
            unit = "the rms that the best model leaves" if quantity.stderr is None else "standard errors"
            strip.set_title(
                f"measured less model, in {unit}; logarithmic beyond 3", loc="left", size=9, color=FAINT, pad=7
            )
    strip.set_xlabel("exit angle (°)")


def _name_strips(figure: Figure, found: Comparison, lines: Mapping[str, Line]) -> None:
    """The model of each row of residuals, and how it ranks, at the right edge."""
    width_in, height_in = figure.get_size_inches()
    left = (width_in - _LABELS_IN + 0.15) / width_in
    models = {model.candidate.name: model for model in found.models}
    for place, (name, line) in enumerate(lines.items()):
        middle = (_strip_top_in(figure, place) - _STRIP_IN / 2.0) / height_in
        step = 0.085 / height_in
        figure.text(left, middle + step, name, color=line.colour, weight="bold", size=9, va="center", parse_math=False)
        figure.text(left, middle - step, criterion(found, models[name]), color=FAINT, size=8, va="center")


def _strip_top_in(figure: Figure, place: int) -> float:
    return float(figure.get_figheight()) - _HEAD_IN - _PANEL_IN - _BETWEEN_IN - _STRIP_IN * place


def _axes(figure: Figure, column: int, top_in: float, high_in: float, **keywords: Any) -> Axes:
    width_in, height_in = figure.get_size_inches()
    left_in = _LEFT_IN + column * (_COLUMN_IN + _LABELS_IN)
    box = (left_in / width_in, (top_in - high_in) / height_in, _COLUMN_IN / width_in, high_in / height_in)
    axes: Axes = figure.add_axes(box, **keywords)
    return axes
