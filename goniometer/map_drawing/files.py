"""Pictures of maps as PNG files: a direction, several directions beside each other, what fits found of the material."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from acquisition.imaging.maps.direction_maps import DirectionMaps
from acquisition.imaging.maps.pixel_fits import MaterialMaps
from acquisition.whole_file import written_whole
from goniometer.map_drawing.material_page import parameters_figure
from goniometer.map_drawing.overview import overview_figure
from goniometer.map_drawing.page import maps_figure
from goniometer.plot_style import DPI, STYLE

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_STYLE: dict[Any, Any] = {**STYLE, "legend.frameon": False, "axes.formatter.limits": (-3, 5), "hatch.linewidth": 0.6}


def draw_maps(path: Path, maps: DirectionMaps, *, title: str = "") -> None:
    """Draw S0, the degree and the angle of linear polarization of one direction.

    Parameters
    ----------
    path : Path
        The PNG file; replaced as a whole if it exists.
    maps : DirectionMaps
        With `S0`, `DoLP` and `AoLP_rad`; without any, the picture says why.
    title : str
        What was measured.

    Raises
    ------
    JournalError
        The file cannot be written.
    """
    _save(path, lambda: maps_figure(maps, title))


def draw_overview(path: Path, directions: Sequence[DirectionMaps], *, title: str = "", of: int = 0) -> None:
    """Draw S0, the degree and the angle of linear polarization of up to 14 directions, with one scale for all.

    Parameters
    ----------
    path : Path
        The PNG file; replaced as a whole if it exists.
    directions : sequence of DirectionMaps
        At least one, all on one grid. Of more than 14 some are shown, evenly chosen. Only `S0`, `DoLP`,
        `DoLP_variance` and `AoLP_rad` are looked at.
    title : str
        What was measured.
    of : int
        How many directions there are, where they are more than these.

    Raises
    ------
    JournalError
        The file cannot be written.
    """
    _save(path, lambda: overview_figure(directions, title, of))


def draw_parameters(path: Path, found: MaterialMaps, *, title: str = "") -> None:
    """Draw what fits of map pixels found: each parameter with its standard error, and how well the fits fit.

    Parameters
    ----------
    path : Path
        The PNG file; replaced as a whole if it exists.
    found : MaterialMaps
        The fits.
    title : str
        What was measured.

    Raises
    ------
    JournalError
        The file cannot be written.
    """
    _save(path, lambda: parameters_figure(found, title))


def _save(path: Path, figure: Callable[[], Figure]) -> None:
    import matplotlib as mpl  # half a second that a scan's start does not need

    with mpl.rc_context(_STYLE), written_whole(path) as part:
        figure().savefig(part, format="png", dpi=DPI)
