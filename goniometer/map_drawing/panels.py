"""Panels of maps: values in colours, what is not known hatched, and the legend of the colours."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from acquisition.imaging.maps.direction_maps import DirectionMaps
from acquisition.imaging.place.map_grid import MapGrid
from goniometer.map_drawing.limits import HALF_TURN, Limits
from goniometer.plot_style import DPI, FAINT, INK

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

FLAGGED: dict[str, Any] = {"facecolor": "#d4d4d4", "edgecolor": "#8a8a8a", "hatch": "/////", "linewidth": 0.0}
UNSURE_COLOUR = "#8f8f8f"
"""Neutral grey, which the colours of angles and of errors do not pass through."""
OF_LIGHT, OF_VALUES, OF_ERRORS, CYCLIC = "cividis", "viridis", "plasma", "twilight"
PAPER = {"facecolor": "white", "edgecolor": "none", "pad": 0.6}
"""What lies behind a text that stands on something."""
_MOST_LABELS = 5
"""Of a colour bar, some of which are short."""
_STEPS = (1, 2, 5, 10)
_SIGNIFICANT = 3.0
"""Standard errors of the degree of polarization from which its angle means something."""


def draw_map(
    axes: Axes,
    values: NDArray[np.floating],
    grid: MapGrid | None,
    colours: str,
    ends: Limits,
    unsure: NDArray[np.bool_] | None = None,
) -> Any:
    """Draw a map, hatched where it is NaN and grey where it is unsure; gives what a colour bar needs."""
    from matplotlib.colors import ListedColormap, LogNorm, Normalize

    axes.patch.set(**FLAGGED)
    scale = LogNorm(ends.low, ends.high) if ends.is_logarithmic else Normalize(ends.low, ends.high)
    # Where pixels of the map share one of the picture, their colours are averaged: means of angles would be wrong.
    smoothing = "antialiased" if _is_finer(axes, values.shape) else "nearest"
    place: dict[str, Any] = {
        "extent": _extent(grid, values.shape),
        "interpolation": smoothing,
        "interpolation_stage": "rgba",
    }
    shown = np.where(np.isfinite(values), values, np.nan)
    if ends.is_logarithmic:
        shown = np.where(shown <= 0.0, ends.low / 2.0, shown)
    image = axes.imshow(np.ma.masked_invalid(shown), cmap=colours, norm=scale, **place)
    if unsure is not None and unsure.any():
        axes.imshow(np.ma.masked_where(~unsure, np.ones(unsure.shape)), cmap=ListedColormap([UNSURE_COLOUR]), **place)
    axes.spines[["top", "right"]].set_visible(True)
    return image


def name_axes(axes: Axes, grid: MapGrid | None) -> None:
    """Write what the axes of a map are."""
    axes.set_xlabel("column (px)" if grid is None else "x (mm)")
    axes.set_ylabel("row (px)" if grid is None else "y (mm)")


def draw_colour_bar(figure: Figure, axes: Axes, image: Any, ends: Limits) -> None:
    """Draw the legend of a map's colours into axes; nothing where the map holds nothing."""
    axes.set_label("<colorbar>")
    if not image.get_array().count():
        axes.set_axis_off()
        return
    from matplotlib.ticker import MaxNLocator, ScalarFormatter

    bar = figure.colorbar(image, cax=axes, extend=ends.extend, extendfrac=0.04)
    bar.outline.set_visible(False)
    if ends.is_logarithmic:
        ticks = decimal_ticks(ends)
        bar.set_ticks(ticks, labels=[f"{tick:g}" for tick in ticks])
        bar.minorticks_off()
    else:
        plain = ScalarFormatter(useOffset=False)
        plain.set_powerlimits((-6, 6))
        bar.ax.yaxis.set_major_locator(MaxNLocator(_MOST_LABELS, steps=_STEPS))
        bar.ax.yaxis.set_major_formatter(plain)
    axes.tick_params(labelsize="small", color=FAINT)


def decimal_ticks(ends: Limits) -> list[float]:
    """Up to five round values of a logarithmic scale: 1, 2 and 5 of each power of ten, or 1 and 3, or powers alone."""
    decades = range(math.floor(math.log10(ends.low)), math.ceil(math.log10(ends.high)) + 1)
    choices = [[float(f"{lead}e{decade}") for decade in decades for lead in leads] for leads in ((1, 2, 5), (1, 3))]
    choices += [[float(f"1e{decade}") for decade in decades[::every]] for every in range(1, len(decades) + 1)]
    within = ([value for value in choice if ends.low <= value <= ends.high] for choice in choices)
    return next(ticks for ticks in within if len(ticks) <= _MOST_LABELS)


def place_ticks(axes: Axes) -> None:
    """Set a few round ticks on a map's axes, none so near to its sides that labels of neighbouring maps could touch."""
    from matplotlib.ticker import MaxNLocator

    page, place = axes.figure, axes.get_position()
    across_in, up_in = place.width * page.get_figwidth(), place.height * page.get_figheight()  # type: ignore[union-attr]
    for axis, limits, side_in, label_in in (
        (axes.xaxis, axes.get_xlim(), across_in, 0.28),
        (axes.yaxis, axes.get_ylim(), up_in, 0.1),
    ):
        low, high = sorted(limits)
        margin = 0.5 * label_in / side_in * (high - low)
        fewest = min(max(2, int(side_in / (1.5 * label_in))), 4)
        every = (MaxNLocator(nbins, steps=_STEPS).tick_values(low, high) for nbins in range(fewest, fewest + 4))
        within = [[tick for tick in ticks if low + margin <= tick <= high - margin] for ticks in every]
        axis.set_ticks(next((ticks for ticks in within if len(ticks) > 1), within[-1]))


def draw_angle_key(axes: Axes, s_direction_deg: float) -> None:
    """Draw which colour stands for which direction of polarization in the picture, into polar axes.

    Parameters
    ----------
    axes : Axes
        With polar projection.
    s_direction_deg : float
        Where the s-direction stands in the picture, counterclockwise from its right.
    """
    edges_deg = np.linspace(0.0, 360.0, 361)
    aolp_deg = (edges_deg[:-1] + edges_deg[1:]) / 2.0 - s_direction_deg
    aolp_deg = (aolp_deg + 90.0) % 180.0 - 90.0
    edges = np.meshgrid(np.radians(edges_deg), (0.55, 1.0))
    axes.pcolormesh(*edges, aolp_deg[None], cmap=CYCLIC, vmin=HALF_TURN.low, vmax=HALF_TURN.high, rasterized=True)
    axes.set_ylim(0.0, 1.0)
    axes.set_yticks([])
    axes.spines["polar"].set_visible(False)
    axes.grid(visible=False)
    named_deg = np.array([-90.0, -45.0, 0.0, 45.0, 90.0, 135.0, 180.0, 225.0])
    names = ["±90°", "−45°", "0°", "45°", "±90°", "−45°", "0°", "45°"]
    axes.set_xticks(np.radians((named_deg + s_direction_deg) % 360.0), names)
    axes.tick_params(axis="x", pad=-2.0, labelsize="small")
    for at_deg, reach, name in ((0.0, 0.5, "s"), (90.0, 0.5, "p")):
        along = np.radians(at_deg + s_direction_deg)
        axes.plot([along + np.pi, along], [reach, reach], color=FAINT, lw=0.7)
        axes.text(along, 0.34, name, ha="center", va="center", size="small", color=INK, bbox=PAPER)


def s_direction_deg(maps: DirectionMaps) -> float:
    """Where the s-direction stands in the picture of maps, counterclockwise from its right.

    A camera's own picture has it to the right. The sample's coordinates turn with the sample, and the s-direction with
    the detector's arm.
    """
    return 0.0 if maps.grid is None else (maps.exit_azimuth_deg or 0.0) - maps.azimuth_deg


def unsure_angles(maps: DirectionMaps) -> NDArray[np.bool_] | None:
    """Pixels whose degree of polarization is within three of its standard errors of none; None where nobody knows."""
    if "DoLP_variance" not in maps.maps:
        return None
    with np.errstate(invalid="ignore"):
        unsure: NDArray[np.bool_] = maps.maps["DoLP"] < _SIGNIFICANT * np.sqrt(maps.maps["DoLP_variance"])
    return unsure


def key_of(flagged: int, of: int, why: str = "flagged", *, unsure: str = "") -> list[Patch]:
    """Legend entries for what colours do not show: pixels that are hatched, and what grey ones are if there are any."""
    from matplotlib.patches import Patch

    key = []
    if flagged:
        key.append(Patch(**{**FLAGGED, "hatch": "////"}, label=f"{why}: {flagged} of {of} pixels"))
    if unsure:
        key.append(Patch(facecolor=UNSURE_COLOUR, label=unsure))
    return key


def unsure_text(count: int) -> str:
    """What grey pixels in a map of angles are; empty if there are none."""
    return f"angle unsure, DoLP below {_SIGNIFICANT:g} of its standard errors: {count} pixels" if count else ""


def _is_finer(axes: Axes, shape: tuple[int, ...]) -> bool:
    """Whether a map has more columns than the picture has for it."""
    return bool(shape[1] > axes.get_position().width * axes.figure.get_figwidth() * DPI)  # type: ignore[union-attr]


def _extent(grid: MapGrid | None, shape: tuple[int, ...]) -> tuple[float, float, float, float]:
    """Left, right, lower and upper edge of a map on its axes."""
    height, width = shape
    if grid is None:
        return -0.5, width - 0.5, height - 0.5, -0.5
    right, bottom = grid.left_mm + grid.width * grid.pixel_mm, grid.top_mm - grid.height * grid.pixel_mm
    return grid.left_mm, right, bottom, grid.top_mm
