"""The page of one direction: S0, the degree and the angle of linear polarization of every pixel."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING

import numpy as np

from acquisition.imaging.maps.direction_maps import DirectionMaps
from goniometer.map_drawing.limits import HALF_TURN, limits
from goniometer.map_drawing.panels import (
    CYCLIC,
    OF_LIGHT,
    OF_VALUES,
    draw_angle_key,
    draw_colour_bar,
    draw_map,
    key_of,
    name_axes,
    s_direction_deg,
    unsure_angles,
    unsure_text,
)
from goniometer.map_drawing.sheet import LEFT_IN, REMARK_IN, MapSheet, fitting

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_WIDTH_IN, _MAP_IN, _MOST_IN = 13.0, 2.95, 5.0
_NEXT_IN, _BAR_IN, _RING_IN = 0.92, 0.13, 0.95
_TITLE_IN = 0.3
NOTE_COLUMNS = 170
SHOWN = ("S0", "DoLP", "AoLP_rad")
EMPTY_SHAPE = (3, 4)


def maps_figure(maps: DirectionMaps, title: str = "") -> Figure:
    """The page as a figure."""
    shape = maps.shape or EMPTY_SHAPE
    width_in, height_in = fitting(shape, _MAP_IN, _MOST_IN)
    remarks = [line for note in maps.notes for line in textwrap.wrap(note, NOTE_COLUMNS)]
    nothing = np.full(shape, np.nan, np.float32)
    s0, dolp, aolp_rad = (maps.maps.get(name, nothing) for name in SHOWN)
    unsure = unsure_angles(maps)
    flagged = int(np.count_nonzero(~np.isfinite([s0, dolp, aolp_rad]).all(axis=0)))
    doubts = 0 if unsure is None else int(np.count_nonzero(unsure))
    key = key_of(flagged, s0.size, unsure=unsure_text(doubts))
    sheet = MapSheet(_WIDTH_IN, _TITLE_IN + height_in, key, remarks)
    sheet.head(title or "Maps of one direction", f"point {maps.point}     {angles(maps)}")
    columns = (
        (s0_name(maps), s0, OF_LIGHT, limits(s0), None),
        ("degree of linear polarization", dolp, OF_VALUES, limits(dolp), None),
        ("angle of linear polarization", np.degrees(aolp_rad), CYCLIC, HALF_TURN, unsure),
    )
    for number, (name, values, colours, ends, doubted) in enumerate(columns):
        left_in = LEFT_IN + number * (_MAP_IN + _NEXT_IN)
        axes = sheet.axes(left_in, _TITLE_IN, width_in, height_in)
        image = draw_map(axes, values, maps.grid, colours, ends, doubted)
        name_axes(axes, maps.grid)
        if number:
            axes.set_ylabel("")
            axes.tick_params(labelleft=False)
        axes.set_title(name, loc="left", size="medium")
        beside_in = left_in + width_in + 0.12
        if colours == CYCLIC:
            ring = sheet.axes(beside_in + 0.26, _TITLE_IN + 0.2, _RING_IN, _RING_IN, projection="polar")
            draw_angle_key(ring, s_direction_deg(maps))
        else:
            draw_colour_bar(sheet.figure, sheet.axes(beside_in, _TITLE_IN, _BAR_IN, height_in), image, ends)
            sheet.remark(left_in, _TITLE_IN + height_in + REMARK_IN, ends.remark)
    return sheet.figure


def angles(maps: DirectionMaps) -> str:
    """The angles of a direction, in words."""
    out_of_plane = maps.exit_azimuth_deg
    aside = "" if out_of_plane is None else f"     exit azimuth {out_of_plane:z.2f}°"
    return (
        f"incidence {maps.incidence_deg:z.2f}°     exit {maps.exit_deg:z.2f}°     "
        f"sample azimuth {maps.azimuth_deg:z.2f}°{aside}"
    )


def s0_name(maps: DirectionMaps) -> str:
    """S0 with its unit."""
    return "$S_0$ (1/sr)" if maps.is_calibrated else "$S_0$ (relative)"
