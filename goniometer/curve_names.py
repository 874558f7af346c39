"""Names of curves beside their panel, at the heights where the curves end but clear of one another."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.optimize import isotonic_regression

from goniometer.plot_style import FAINT, INK
from model.geometry import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_SIZE = 8.5
_LINE_IN = 1.45 * _SIZE / 72.0
_AT = 1.05
"""Where names begin, in widths of the panel."""


@dataclass(frozen=True)
class CurveName:
    """A name, and where in the panel's units its curve ends; None if there is no curve to be seen."""

    text: str
    end: tuple[float, float] | None
    colour: str
    dashes: Any = "-"
    is_bold: bool = False


def name_curves(axes: Axes, names: Sequence[CurveName]) -> None:
    """Write names at the right of a panel that is drawn already; what ends above or below it is named at its edge."""
    low, high = axes.get_ylim()
    ends = [(axes.get_xlim()[1], high) if name.end is None else name.end for name in names]
    inside = [(x, float(np.clip(np.nan_to_num(y, nan=low), low, high))) for x, y in ends]
    places = axes.transAxes.inverted().transform(axes.transData.transform(inside))
    panel_in = axes.get_window_extent().height / axes.figure.dpi
    for name, end, height in zip(names, inside, apart(places[:, 1], _LINE_IN / panel_in), strict=True):
        look: dict[str, Any] = {"va": "center", "size": _SIZE, "weight": "bold" if name.is_bold else "normal"}
        if name.end is None:
            axes.text(_AT, height, name.text, transform=axes.transAxes, color=FAINT, parse_math=False, **look)
            continue
        leader = {"arrowstyle": "-", "color": name.colour, "ls": name.dashes, "lw": 1.0, "shrinkA": 2, "shrinkB": 3}
        axes.annotate(
            *(name.text, end),
            xytext=(_AT, height),
            textcoords="axes fraction",
            color=INK,
            parse_math=False,
            arrowprops={**leader, "relpos": (0.0, 0.5)},
            **look,
        )


def apart(heights: FloatArray, gap: float) -> FloatArray:
    """Heights moved as little as leaves a gap between any two, in their order, and all within 0 and 1.

    Where there is no room for such gaps they are narrower.
    """
    order = np.argsort(heights, kind="stable")
    steps = min(gap, 1.0 / max(len(heights) - 1, 1)) * np.arange(len(heights))
    lowest = np.clip(isotonic_regression(heights[order] - steps).x, 0.0, 1.0 - steps[-1])
    placed = np.empty_like(heights)
    placed[order] = lowest + steps
    return placed
