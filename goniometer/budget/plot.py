"""The picture of a budget: standard errors against bench time, as the recipe is and after each change."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from goniometer.budget.budget import Budget
from goniometer.budget.forecast import Forecast
from goniometer.budget.text import NOT_DETERMINED
from goniometer.curve_names import CurveName, name_curves
from goniometer.durations import clock_text
from goniometer.errors import ConfigurationError
from goniometer.plot_style import COLOURS, DASHES, DPI, FAINT, INK, STYLE
from model.geometry import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_DESIGN = "#B00020"
_THIN, _MEDIUM, _THICK = 1.2, 1.6, 2.4
_LEFT = 0.06
_DECADES_ABOVE = 3.0
"""How far above its end a curve is shown: what a handful of directions leave open is of no interest."""
_TICKS_S = (1, 2, 5, 10, 20, 30, 60, 120, 180, 300, 600, 1200, 1800, 3600, 7200, 14400, 36000, 86400)


@dataclass(frozen=True, eq=False)
class _Curve:
    label: str
    ends_s: FloatArray
    stderr: FloatArray
    colour: str
    dashes: Any = "-"
    width: float = _MEDIUM


def draw_budget(
    path: Path, *, title: str, assumed: str, found: Budget, wanted: str | None, design: Forecast | None
) -> None:
    """Draw every parameter of the recipe as it is, and one of them after each change, as a PNG file.

    Parameters
    ----------
    path : Path
        The file; replaced if it exists.
    title, assumed : str
        The recipe's name, and the values that were assumed.
    found : Budget
        What is drawn.
    wanted : str or None
        The parameter that matters; None for the first of the recipe's.
    design : Forecast or None
        What comes of a designed recipe.

    Raises
    ------
    ConfigurationError
        The file cannot be written.
    """
    import matplotlib as mpl  # half a second that other commands do not need
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    now = found.now
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(13.0, 5.6))
        FigureCanvasAgg(figure)
        left, right = figure.subplots(
            1, 2, gridspec_kw={"left": _LEFT, "right": 0.8, "wspace": 0.55, "top": 0.8, "bottom": 0.11}
        )
        figure.text(_LEFT, 0.95, title, size=16, weight="bold", va="center", parse_math=False)
        figure.text(_LEFT, 0.895, f"assumed: {assumed}", color=FAINT, va="center", parse_math=False)
        place = now.names.index(wanted) if wanted else 0
        _draw(left, "Every parameter, with the recipe as it is", list(_parameters(now)))
        _draw(right, f"{now.names[place]} with the recipe changed", list(_changes(found, place, design)))
        left.set_ylabel("standard error")
        try:
            figure.savefig(path, format="png", dpi=DPI)
        except OSError as error:
            raise ConfigurationError([f"{path} cannot be written: {error.strerror}. Choose another name."]) from error


def _parameters(now: Forecast) -> Iterator[_Curve]:
    looks = zip(itertools.cycle(COLOURS), itertools.cycle(DASHES), strict=False)
    for place, (name, look) in enumerate(zip(now.names, looks, strict=False)):
        yield _Curve(name, now.ends_s, now.stderr[:, place], *look)


def _changes(found: Budget, place: int, design: Forecast | None) -> Iterator[_Curve]:
    looks = zip(itertools.cycle(COLOURS), itertools.cycle(DASHES), strict=False)
    for outcome, look in zip(found.outcomes, looks, strict=False):
        yield _Curve(outcome.words, outcome.forecast.ends_s, outcome.forecast.stderr[:, place], *look, _THIN)
    yield _Curve("as the recipe is", found.now.ends_s, found.now.stderr[:, place], INK, width=_THICK)
    if design is not None:
        yield _Curve("the design", design.ends_s, design.stderr[:, place], _DESIGN, width=_THICK)


def _draw(axes: Axes, title: str, curves: Sequence[_Curve]) -> None:
    from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

    axes.set_title(title, loc="left", size=10.5, weight="bold", pad=10)
    shown = [curve for curve in curves if np.isfinite(curve.stderr[-1])]
    if not shown:
        axes.text(0.5, 0.5, NOT_DETERMINED, transform=axes.transAxes, ha="center", color=FAINT)
        axes.set_axis_off()
        return
    axes.set(xscale="log", yscale="log", xlabel="bench time, min:s")
    axes.grid(True, which="major")
    for curve in shown:
        seen = curve.stderr <= curve.stderr[-1] * 10.0**_DECADES_ABOVE
        axes.plot(curve.ends_s[seen], curve.stderr[seen], ls=curve.dashes, color=curve.colour, lw=curve.width)
        axes.plot(curve.ends_s[-1], curve.stderr[-1], "o", color=curve.colour, ms=4 + curve.width)
    low, high = axes.get_xlim()
    axes.xaxis.set_major_locator(FixedLocator([tick for tick in _TICKS_S if low <= tick <= high]))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: clock_text(value)))
    name_curves(axes, [_name(curve) for curve in curves])


def _name(curve: _Curve) -> CurveName:
    last = float(curve.stderr[-1])
    if not np.isfinite(last):
        return CurveName(f"{curve.label}   {NOT_DETERMINED}", None, FAINT)
    end = (float(curve.ends_s[-1]), last)
    return CurveName(f"{curve.label}   {last:.2g}", end, curve.colour, curve.dashes, is_bold=curve.width == _THICK)
