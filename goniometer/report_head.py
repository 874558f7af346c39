"""The head of a scan's picture: what was measured, at which angles, and the key of its planes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from acquisition.readings import StokesPoint
from goniometer.plot_style import FAINT, INK
from goniometer.report_panels import DATA_COLOUR, FIT_COLOUR, plane_colours
from goniometer.scan_planes import Plane
from model.fit import FitResult

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

LEFT, RIGHT = 0.045, 0.985
"""Edges of what is drawn, in parts of the width."""
ROW_IN = 0.27
"""A line of the head, and a row of the table of parameters."""
_SAME_DEG = 0.005
"""Angles closer than that are printed alike."""
_MOST_NAMED = 7
"""Planes of a scan that the key names."""
_MOST_IN_ROW = 4
"""Names of planes with both angles that fit in a line."""


def draw_head(
    figure: Figure, title: str, points: Sequence[StokesPoint], fit: FitResult | None, planes: Sequence[Plane]
) -> None:
    """Draw the title, what all points have in common, and the key of symbols and planes."""
    from matplotlib.lines import Line2D

    height_in = figure.get_figheight()
    out_of_plane_deg = [point.exit_azimuth_deg for point in points if point.exit_azimuth_deg is not None]
    aside = f"{_angles('exit azimuth', out_of_plane_deg, planes)}     " if out_of_plane_deg else ""
    details = (
        f"{_angles('incidence', [point.incidence_deg for point in points], planes)}     "
        f"{_angles('sample azimuth', [point.azimuth_deg for point in points], planes)}     "
        f"{aside}{len(points)} point{'s' * (len(points) != 1)}     "
        "polarization: degree without the bias of noise, angle from the s-direction"
    )
    figure.text(LEFT, 1.0 - 0.38 / height_in, title, size=16, weight="bold", va="center", parse_math=False)
    figure.text(LEFT, 1.0 - 0.70 / height_in, details, color=FAINT, va="center")
    several = len(planes) > 1
    colours = (INK, INK) if several else (DATA_COLOUR, FIT_COLOUR)
    key = [Line2D([], [], color=colours[0], marker="o", ls="", ms=4, label="measured ± standard error")]
    if fit is not None:
        key.append(Line2D([], [], color=colours[1], label="fit"))
    at = (RIGHT, 1.0 - (0.70 + (ROW_IN if several else 0.0)) / height_in)
    figure.legend(handles=key, loc="center right", bbox_to_anchor=at, ncols=2, borderaxespad=0.0, borderpad=0.0)
    if several:
        shown, rows = _named_planes(planes), key_rows(planes)
        at = (LEFT, 1.0 - (0.70 + ROW_IN * (rows + 1) / 2) / height_in)
        figure.legend(
            handles=shown,
            loc="center left",
            bbox_to_anchor=at,
            ncols=-(-len(shown) // rows),
            borderaxespad=0.0,
            borderpad=0.0,
        )


def _angles(name: str, angles_deg: Sequence[float], planes: Sequence[Plane]) -> str:
    """An angle that all points have in common, or from where to where it goes."""
    if len(planes) == 1 or np.ptp(angles_deg) < _SAME_DEG:
        return f"{name} {np.mean(angles_deg):z.2f}°"
    return f"{name} {min(angles_deg):z.2f}° to {max(angles_deg):z.2f}°"


def _varying(planes: Sequence[Plane]) -> dict[str, list[float]]:
    """The angles that name the planes of a scan, by what they are called: the incidence, and others that vary."""
    others = {
        "azimuth": [plane.azimuth_deg for plane in planes],
        "exit azimuth": [plane.exit_azimuth_deg for plane in planes],
    }
    varying = {name: angles_deg for name, angles_deg in others.items() if np.ptp(angles_deg) >= _SAME_DEG}
    return {"incidence": [plane.incidence_deg for plane in planes], **varying}


def key_rows(planes: Sequence[Plane]) -> int:
    """How many lines the key of the planes' colours takes; none for a single plane."""
    if len(planes) < 2:
        return 0
    return 2 if len(_varying(planes)) > 1 and len(planes) > _MOST_IN_ROW else 1


def _named_planes(planes: Sequence[Plane]) -> list[Line2D]:
    """The key of the planes' colours; of many planes some, evenly chosen, the first and the last among them."""
    from matplotlib.lines import Line2D

    varying = _varying(planes)
    colours = plane_colours(len(planes))
    places = sorted(set(np.linspace(0, len(planes) - 1, min(_MOST_NAMED, len(planes))).round().astype(int).tolist()))
    names = [
        ", ".join(f"{angle_deg:z.2f}°" for angle_deg in of_plane) for of_plane in zip(*varying.values(), strict=True)
    ]
    names[0] = f"{', '.join(varying)}: {names[0]}"
    key = [Line2D([], [], color=colours[place], marker="o", ms=4, label=names[place]) for place in places]
    if len(places) < len(planes):
        key.append(Line2D([], [], ls="", label=f"and others, {len(planes)} in all"))
    return key
