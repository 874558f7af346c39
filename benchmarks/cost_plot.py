"""The picture of what accuracy costs: error against time for bounces, and for acceptance cones."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib as mpl
from cost_cones import BOUNCES, NODES, SCAN_RAD, ConeCost
from cost_curves import SIGMAS, Curve
from matplotlib.axes import Axes
from matplotlib.figure import Figure

# Okabe and Ito's colours, which readers with colour blindness tell apart; every curve has a marker of its own besides.
STYLES: dict[str, dict[str, Any]] = {
    "float64, column, a = 0, random": {"color": "#000000", "marker": "o", "zorder": 3},
    "float32": {"color": "#E69F00", "marker": "s"},
    "a = 0.4": {"color": "#D55E00", "marker": "^"},
    "full Mueller": {"color": "#0072B2", "marker": "D"},
    "grid": {"color": "#009E73", "marker": "v"},
    "in plane": {"color": "#CC79A7", "marker": "P"},
}
CONE_COLOURS = {(0.3, 0.25): "#000000", (0.3, 1.0): "#0072B2", (1.0, 0.25): "#D55E00", (1.0, 1.0): "#E69F00"}
ROUNDING = 1e-16  # smaller errors are drawn as large


def draw(path: Path, curves: list[Curve], cones: list[ConeCost]) -> None:
    with mpl.rc_context({"font.size": 11.0, "axes.grid": True, "grid.color": "#e4e4e4", "axes.axisbelow": True}):
        figure = Figure(figsize=(15.0, 6.0))
        figure.subplots_adjust(left=0.055, right=0.985, bottom=0.27, top=0.935, wspace=0.24)
        left, middle, right = figure.subplots(1, 3)
        middle.sharex(left)
        middle.sharey(left)
        for axes, sigma in zip((left, middle), SIGMAS, strict=True):
            _bounces(axes, sigma, [curve for curve in curves if curve.sigma == sigma])
        left.set_ylabel("error, share of the light")
        _cones(right, cones)
        for axes, centre, columns in ((middle, -0.12, 3), (right, 0.4, 2)):
            place = {"loc": "upper center", "bbox_to_anchor": (centre, -0.14)}
            axes.legend(fontsize=9.5, ncols=columns, frameon=False, **place)
        figure.savefig(path, dpi=110)


def _bounces(axes: Axes, sigma: float, curves: list[Curve]) -> None:
    for curve in curves:
        shown = [max(error, ROUNDING) for error in curve.error]
        axes.loglog(curve.ns, shown, linewidth=1.3, markersize=5.0, label=curve.variant, **STYLES[curve.variant])
    base = curves[0]
    for bounces, (ns, error) in enumerate(zip(base.ns, base.error, strict=True), start=1):
        if error > ROUNDING:
            label = f"K = {bounces}" if bounces == 1 else f"{bounces}"
            axes.annotate(label, (ns, error), xytext=(4.0, 4.0), textcoords="offset points", fontsize=10.0, zorder=4)
    axes.set_title(f"Bounces K = 1 … 8, $\\sigma$ = {sigma:g}")
    axes.set_xlabel("ns a direction, one core")


def _cones(axes: Axes, cones: list[ConeCost]) -> None:
    for cone in cones:
        colour = CONE_COLOURS[cone.sigma, cone.half_angle_deg]
        style: dict[str, Any] = {"color": colour, "markersize": 5.0, "linewidth": 1.3}
        errors = [cost.error for cost in cone.quadrature]
        label = f"$\\sigma$ = {cone.sigma:g}, K = {BOUNCES[cone.sigma]}, cone of {cone.half_angle_deg:g}°"
        axes.loglog([1e6 * cost.single_s for cost in cone.quadrature], errors, "o-", label=label, **style)
        axes.loglog([1e6 * cost.scan_s for cost in cone.quadrature], errors, "o--", markerfacecolor="white", **style)
        traced = [cost.error for cost in cone.rays]
        axes.loglog([1e6 * cost.single_s for cost in cone.rays], traced, "s:", **style)
    grey: dict[str, Any] = {"color": "#6f6f6f", "markersize": 5.0}
    axes.plot([], [], "o-", label=f"one cone, {NODES[0]} … {NODES[-1]} nodes", **grey)
    axes.plot([], [], "o--", markerfacecolor="white", label=f"the same in a scan of {SCAN_RAD.size}", **grey)
    axes.plot([], [], "s:", label="ray tracer's standard error", **grey)
    axes.set_title("Cone about the mirror direction at 60°")
    axes.set_xlabel("µs a cone, one core")
    axes.set_ylabel("relative error of the Stokes vector")
