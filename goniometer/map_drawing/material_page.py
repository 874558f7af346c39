"""The page of fits of map pixels: each parameter with its standard error, and how well the fits fit."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from acquisition.imaging.maps.pixel_fits import MaterialMaps
from goniometer.map_drawing.limits import Limits, limits
from goniometer.map_drawing.page import NOTE_COLUMNS
from goniometer.map_drawing.panels import (
    OF_ERRORS,
    OF_LIGHT,
    OF_VALUES,
    draw_colour_bar,
    draw_map,
    key_of,
    name_axes,
)
from goniometer.map_drawing.sheet import LEFT_IN, REMARK_IN, MapSheet, fitting
from model.many_fits.result import Status

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

_WIDTH_IN, _MAP_IN, _MOST_IN = 13.0, 2.1, 3.2
_ACROSS_IN, _BAR_IN, _TITLE_IN, _BELOW_IN = 3.12, 0.12, 0.3, 0.4
_IN_ROW, _REMARK_IN = 4, 0.2
_TAILS_PERCENT = 2.5
"""Beyond which colours may end: blocks on the border of two materials are of neither, and are many."""
_WHY = {
    Status.TOO_FEW: "known in too few directions",
    Status.ONE_VALUE: "one value in all directions",
    Status.NOT_SETTLED: "fit did not settle",
    Status.UNDETERMINED: "parameters not told apart",
    Status.UNPOLARIZED: "no polarization",
}


_NO_ERROR = "no standard error: at a bound, or hardly known"


class _Panel(NamedTuple):
    title: str
    values: NDArray[np.floating]
    colours: str
    unsure: NDArray[np.bool_] | None = None
    ends: Limits | None = None


def parameters_figure(found: MaterialMaps, title: str = "") -> Figure:
    """The page as a figure."""
    panels = _panels(found)
    rows = -(-len(panels) // _IN_ROW)
    width_in, height_in = fitting(found.status.shape, _MAP_IN, _MOST_IN)
    down_in = _TITLE_IN + height_in + _BELOW_IN
    remarks = [line for note in found.notes for line in textwrap.wrap(note, NOTE_COLUMNS)]
    sheet = MapSheet(_WIDTH_IN, rows * down_in - _BELOW_IN, _key(found, panels), remarks)
    fitted = int(np.count_nonzero(found.status == Status.FITTED))
    size = f"blocks of {found.bin_px} x {found.bin_px} pixels" if found.bin_px > 1 else "single pixels"
    sheet.head(title or "Material of every pixel", f"{fitted} of {found.status.size} fits     {size}")
    for number, panel in enumerate(panels):
        row, column = divmod(number, _IN_ROW)
        left_in, top_in = LEFT_IN + column * _ACROSS_IN, _TITLE_IN + row * down_in
        axes = sheet.axes(left_in, top_in, width_in, height_in)
        ends = panel.ends or limits(panel.values, tails_percent=_TAILS_PERCENT)
        image = draw_map(axes, panel.values, found.grid, panel.colours, ends, panel.unsure)
        name_axes(axes, found.grid)
        axes.locator_params(nbins=5)
        axes.tick_params(labelsize="small", labelleft=column == 0, labelbottom=number + _IN_ROW >= len(panels))
        if column:
            axes.set_ylabel("")
        if number + _IN_ROW < len(panels):
            axes.set_xlabel("")
        axes.set_title(panel.title, loc="left", size="medium")
        bar = sheet.axes(left_in + width_in + 0.1, top_in, _BAR_IN, height_in)
        draw_colour_bar(sheet.figure, bar, image, ends)
        below_in = _REMARK_IN if number + _IN_ROW < len(panels) else REMARK_IN
        sheet.remark(left_in, top_in + height_in + below_in, ends.remark)
    return sheet.figure


def _panels(found: MaterialMaps) -> list[_Panel]:
    fitted = found.status == Status.FITTED
    panels = []
    for name, values in found.parameters.items():
        stderr = found.stderr[name]
        panels.append(_Panel(name, values, OF_VALUES))
        panels.append(_Panel(f"{name}: standard error", stderr, OF_ERRORS, fitted & ~np.isfinite(stderr)))
    quality = np.where(fitted, found.chi_square / np.maximum(found.degrees_of_freedom, 1), np.nan)
    all_directions = Limits(0.0, float(max(found.directions.max(), 1)))
    return [
        *panels,
        _Panel("reduced chi-square", quality, OF_VALUES),
        _Panel("directions that count", np.where(fitted, found.directions, np.nan), OF_LIGHT, ends=all_directions),
    ]


def _key(found: MaterialMaps, panels: Sequence[_Panel]) -> list[Patch]:
    counts = [(text, int(np.count_nonzero(found.status == why))) for why, text in _WHY.items()]
    why = ", ".join(f"{text} {count}" for text, count in counts if count)
    unsure = any(panel.unsure is not None and panel.unsure.any() for panel in panels)
    return key_of(
        sum(count for _, count in counts), found.status.size, f"no fit ({why})", unsure=_NO_ERROR if unsure else ""
    )
