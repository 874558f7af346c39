"""The contact sheet of a scan's maps: directions beside each other, S0, DoLP and AoLP below each other."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from acquisition.imaging.maps.direction_maps import DirectionMaps
from goniometer.map_drawing.blocks import GAP_IN, Blocks, arranged
from goniometer.map_drawing.limits import HALF_TURN, Limits, limits
from goniometer.map_drawing.page import EMPTY_SHAPE, SHOWN
from goniometer.map_drawing.panels import (
    CYCLIC,
    OF_LIGHT,
    OF_VALUES,
    PAPER,
    draw_angle_key,
    draw_colour_bar,
    draw_map,
    key_of,
    name_axes,
    place_ticks,
    s_direction_deg,
    unsure_angles,
    unsure_text,
)
from goniometer.map_drawing.sheet import LEFT_IN, REMARK_IN, MapSheet

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOST_DIRECTIONS = 14
"""A scan from 0 to 60 degrees in steps of 5 is shown whole."""
_NARROWEST_IN, _RING_IN = 9.0, 0.72
_SAME_DEG = 0.005


def chosen(directions: int) -> list[int]:
    """Which of so many directions a sheet shows: all, or some that are evenly chosen, the first and the last too."""
    count = min(directions, MOST_DIRECTIONS)
    return [round(place) for place in np.linspace(0, directions - 1, count)]


def overview_figure(directions: Sequence[DirectionMaps], title: str = "", of: int = 0) -> Figure:
    """The sheet as a figure; `of` says how many directions there are, where they are more than these."""
    shown = [directions[place] for place in chosen(len(directions))]
    of = max(of, len(directions))
    shape = next((one.shape for one in shown if one.shape), EMPTY_SHAPE)
    common, varying = _angles(shown)
    blocks = arranged(shape, len(shown), 1 + varying[0].count("\n"))
    rows = _rows(shown, shape)
    beyond = [f"{row.name}: {row.ends.remark}" for row in rows if row.ends.remark]
    flagged = ~np.isfinite([row.values for row in rows]).all(axis=0)
    doubts = sum(int(np.count_nonzero(one)) for one in rows[2].unsure if one is not None)
    key = key_of(int(np.count_nonzero(flagged)), flagged.size, unsure=unsure_text(doubts))
    sheet = MapSheet(max(blocks.page_in, _NARROWEST_IN), blocks.total_in, key)
    of_all = f"{len(shown)} of {of} directions" if of > len(shown) else f"directions: {len(shown)}"
    sheet.head(title or "Maps", "     ".join([of_all, *common]))
    for block in range(blocks.count):
        places = range(block * blocks.columns, min((block + 1) * blocks.columns, len(shown)))
        for number, row in enumerate(rows):
            axes, image = _draw_row(sheet, row, shown, places, (blocks, blocks.top_in(block, number)))
            for one, place in zip(axes, places, strict=True):
                one.tick_params(labelbottom=number == 2)
                if number < 2:
                    one.set_xlabel("")
                if number == 0:
                    one.set_title(varying[place], size="small")
            _draw_legend(sheet, row, shown, image, (blocks, blocks.top_in(block, number)))
    sheet.remark(LEFT_IN, blocks.total_in + REMARK_IN, "     ".join(beyond))
    return sheet.figure


class _Row(NamedTuple):
    """A quantity of all directions, with one scale."""

    name: str
    values: list[NDArray[np.floating]]
    colours: str
    ends: Limits
    unsure: list[NDArray[np.bool_] | None]


def _rows(shown: Sequence[DirectionMaps], shape: tuple[int, int]) -> list[_Row]:
    nothing = np.full(shape, np.nan, np.float32)
    s0, dolp, aolp_rad = ([one.maps.get(name, nothing) for one in shown] for name in SHOWN)
    sure: list[NDArray[np.bool_] | None] = [None] * len(shown)
    of_s0 = limits(np.concatenate([values.ravel() for values in s0]), may_be_logarithmic=True)
    unit = "1/sr" if shown[0].is_calibrated else "relative"
    return [
        _Row(f"S0 ({unit}){', logarithmic' * of_s0.is_logarithmic}", list(s0), OF_LIGHT, of_s0, sure),
        _Row("DoLP", list(dolp), OF_VALUES, limits(np.concatenate([values.ravel() for values in dolp])), sure),
        _Row("AoLP", [np.degrees(values) for values in aolp_rad], CYCLIC, HALF_TURN, [*map(unsure_angles, shown)]),
    ]


def _draw_row(
    sheet: MapSheet, row: _Row, shown: Sequence[DirectionMaps], places: range, where: tuple[Blocks, float]
) -> tuple[list[Axes], Any]:
    """Draw a row of maps; gives their axes, and what the legend of colours needs."""
    blocks, top_in = where
    every, images = [], []
    for column, place in enumerate(places):
        one = shown[place]
        left_in = LEFT_IN + column * (blocks.width_in + GAP_IN)
        axes = sheet.axes(left_in, top_in, blocks.width_in, blocks.height_in)
        images.append(draw_map(axes, row.values[place], one.grid, row.colours, row.ends, row.unsure[place]))
        name_axes(axes, one.grid)
        place_ticks(axes)
        axes.tick_params(labelsize="small", labelleft=column == 0)
        if column:
            axes.set_ylabel("")
        if not one.maps:
            axes.text(0.5, 0.5, "no map", transform=axes.transAxes, ha="center", va="center", bbox=PAPER)
        every.append(axes)
    return every, max(images, key=lambda image: image.get_array().count())


def _draw_legend(
    sheet: MapSheet, row: _Row, shown: Sequence[DirectionMaps], image: Any, where: tuple[Blocks, float]
) -> None:
    blocks, top_in = where
    beside_in = blocks.beside_in
    if row.colours != CYCLIC:
        sheet.remark(beside_in, top_in + 0.08, row.name)
        bar = sheet.axes(beside_in, top_in + 0.2, 0.13, blocks.legend_height_in - 0.2)
        draw_colour_bar(sheet.figure, bar, image, row.ends)
        return
    turns_deg = [s_direction_deg(one) for one in shown]
    turns = bool(np.ptp(turns_deg) >= _SAME_DEG)
    sheet.remark(beside_in, top_in + 0.08, f"{row.name}; s turns in the maps" if turns else row.name)
    ring = sheet.axes(beside_in + 0.3, top_in + 0.45, _RING_IN, _RING_IN, projection="polar")
    draw_angle_key(ring, 0.0 if turns else turns_deg[0])


def _angles(shown: Sequence[DirectionMaps]) -> tuple[list[str], list[str]]:
    """The angles that all directions have in common, and for each direction those that vary, in words."""
    every = {
        "incidence": [one.incidence_deg for one in shown],
        "exit": [one.exit_deg for one in shown],
        "sample azimuth": [one.azimuth_deg for one in shown],
        "exit azimuth": [one.exit_azimuth_deg or 0.0 for one in shown],
    }
    if all(one.exit_azimuth_deg is None for one in shown):
        del every["exit azimuth"]
    same = {name: np.ptp(angles_deg) < _SAME_DEG and name != "exit" for name, angles_deg in every.items()}
    common = [f"{name} {angles_deg[0]:z.2f}°" for name, angles_deg in every.items() if same[name]]
    varying = [
        "\n".join(f"{name} {angles_deg[place]:z.4g}°" for name, angles_deg in every.items() if not same[name])
        for place in range(len(shown))
    ]
    return common, varying
