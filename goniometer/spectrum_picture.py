"""The picture of a scan at several wavelengths: S0 and DoLP in a colour for each, and what the fits found of them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from acquisition.fit_points import in_degrees, surface_family
from acquisition.whole_file import written_whole
from goniometer.fitted_curve import fitted_curve
from goniometer.plot_style import COLOURS, DPI, FAINT, INK, STYLE

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from goniometer.run_folder import StoredRun

_WIDTH_IN, _HEAD_IN, _TOP_IN, _PANEL_IN = 13.0, 1.0, 4.4, 2.9
_MOST_IN_ROW = 4
_MOST_IN_LEGEND = 6
"""Wavelengths beside each other; more come below, beside the remark."""
_STYLE: dict[Any, Any] = {**STYLE, "legend.frameon": False}


def draw_spectrum(path: Path, runs: Sequence[StoredRun]) -> None:
    """Draw S0 and the degree of linear polarization against the exit angle, and each parameter against the wavelength.

    Parameters
    ----------
    path : Path
        The PNG file; replaced as a whole if it exists.
    runs : sequence of StoredRun
        The run at each wavelength; at least one.

    Raises
    ------
    JournalError
        The file cannot be written.
    """
    import matplotlib as mpl  # half a second that a scan's start does not need
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    runs = sorted(runs, key=lambda run: run.recipe.one_wavelength_nm)
    names = list(dict.fromkeys(name for run in runs if run.fit for name in in_degrees(run.fit).parameters))
    rows = -(-len(names) // _MOST_IN_ROW)
    height_in = _HEAD_IN + _TOP_IN + rows * _PANEL_IN
    with mpl.rc_context(_STYLE), written_whole(path) as part:
        layout = ConstrainedLayoutEngine(rect=(0.01, 0.01, 0.98, 1.0 - _HEAD_IN / height_in))
        figure = Figure(figsize=(_WIDTH_IN, height_in), layout=layout)
        FigureCanvasAgg(figure)
        grid = figure.add_gridspec(1 + rows, 2 * _MOST_IN_ROW, height_ratios=[_TOP_IN, *[_PANEL_IN] * rows])
        s0, dolp = figure.add_subplot(grid[0, :_MOST_IN_ROW]), figure.add_subplot(grid[0, _MOST_IN_ROW:])
        for run, colour in zip(runs, _colours(len(runs)), strict=True):
            _draw_measured(s0, dolp, run, colour)
        s0.set_yscale("log")
        s0.set_title("$S_0$ (1/sr)", loc="left", size="medium")
        dolp.set_title("degree of linear polarization", loc="left", size="medium")
        for axes in (s0, dolp):
            axes.set_xlabel("exit angle (°)")
            axes.grid(visible=True)
        for number, name in enumerate(names):
            row, column = divmod(number, _MOST_IN_ROW)
            axes = figure.add_subplot(grid[1 + row, 2 * column : 2 * column + 2])
            _draw_parameter(axes, name, runs)
        top = 1.0 - 0.38 / height_in
        figure.text(0.03, top, runs[0].recipe.recipe, size=16, weight="bold", va="center", parse_math=False)
        about = "points: measured or fitted, ± standard error     lines: fit of each wavelength"
        about += "     crosses: the simulated sample" * any(run.truth for run in runs)
        figure.text(0.03, 1.0 - 0.70 / height_in, about, color=FAINT, va="center")
        anchor, columns = (0.985, 1.0 - 0.1 / height_in), min(len(runs), _MOST_IN_LEGEND)
        figure.legend(*s0.get_legend_handles_labels(), loc="upper right", bbox_to_anchor=anchor, ncols=columns)
        figure.savefig(part, format="png", dpi=DPI)


def _colours(count: int) -> list[str]:
    """A colour for each wavelength, from the shortest to the longest."""
    if count <= len(COLOURS):
        return list(COLOURS[:count])
    from matplotlib import colormaps
    from matplotlib.colors import to_hex

    return [to_hex(colormaps["viridis"](share)) for share in np.linspace(0.0, 0.92, count)]


def _draw_measured(s0: Axes, dolp: Axes, run: StoredRun, colour: str) -> None:
    order = np.argsort([point.exit_deg for point in run.points], kind="stable")
    points = [run.points[number] for number in order.tolist()]
    exit_deg = [point.exit_deg for point in points]
    of_points = {"color": colour, "ls": "", "marker": "o", "ms": 3, "elinewidth": 0.9}
    s0_values, s0_stderr = [point.stokes[0] for point in points], [point.covariance[0, 0] ** 0.5 for point in points]
    s0.errorbar(exit_deg, s0_values, s0_stderr, label=f"{run.recipe.one_wavelength_nm:g} nm", **of_points)  # type: ignore[arg-type]
    values, stderr = [point.dolp_debiased for point in points], [point.dolp_stderr for point in points]
    dolp.errorbar(exit_deg, values, stderr, **of_points)  # type: ignore[arg-type]
    if run.fit is not None and run.recipe.is_one_plane:
        curve = fitted_curve(points, surface_family(run.recipe.fit, run.rig.calibration.acceptance_sr), run.fit)
        s0.plot(curve.exit_deg, curve.stokes[:, 0], color=colour, lw=1.2)
        dolp.plot(curve.exit_deg, np.hypot(*curve.stokes[:, 1:].T) / curve.stokes[:, 0], color=colour, lw=1.2)


def _draw_parameter(axes: Axes, name: str, runs: Sequence[StoredRun]) -> None:
    for run in runs:
        wavelength_nm = run.recipe.one_wavelength_nm
        estimate = None if run.fit is None else in_degrees(run.fit).parameters.get(name)
        if estimate is not None:
            axes.errorbar(wavelength_nm, estimate.value, estimate.stderr or 0.0, color=INK, marker="o", ms=4, capsize=3)
        if name in run.truth:
            axes.plot(wavelength_nm, run.truth[name], color=COLOURS[1], marker="x", ms=8, ls="")
    axes.set_title(name, loc="left", size="medium")
    axes.set_xlabel("wavelength (nm)")
    axes.margins(0.15)
    axes.ticklabel_format(useOffset=False)
    axes.grid(visible=True)
