"""What an acceptance cone costs in the mirror direction, by quadrature and by tracing rays: time and error."""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np
from interleaved import ONE_CORE, interleaved_s
from model_peers import INDEX

from model.acceptance import Acceptance
from model.lobes import Specular
from model.raytrace import LitSurface
from model.raytrace_cone import Cone, cone_stokes
from model.surface import Surface

MIRROR_RAD = float(np.radians(60.0))
HALF_ANGLES_DEG = (0.25, 1.0)
# Beyond so many bounces 1e-14 and 1e-5 of the light are left; the ray tracer follows all of it.
BOUNCES = {0.3: 4, 1.0: 8}
NODES = (2, 3, 4, 6, 8, 12, 16, 24)
CONVERGED_NODES = 128
RAYS = (10_000, 100_000, 1_000_000)
SCAN_RAD = np.radians(np.linspace(0.0, 60.0, 61))
ROUNDS = 25


class Cost(NamedTuple):
    """Nodes a line or rays thrown; seconds for the mirror direction, and each of a scan; error or standard error."""

    effort: int
    single_s: float
    scan_s: float
    error: float


class ConeCost(NamedTuple):
    """Quadrature and ray tracing of one cone; `apart`: between the two in standard errors, with the most rays."""

    sigma: float
    half_angle_deg: float
    quadrature: list[Cost]
    rays: list[Cost]
    apart: float


def measure() -> list[ConeCost]:
    return [_cone(sigma, half_angle_deg) for sigma in BOUNCES for half_angle_deg in HALF_ANGLES_DEG]


def _cone(sigma: float, half_angle_deg: float) -> ConeCost:
    half_angle_rad = float(np.radians(half_angle_deg))
    surface = Surface([Specular(1.0, sigma, INDEX, bounces=BOUNCES[sigma])])
    mirror = (MIRROR_RAD, MIRROR_RAD, np.pi)
    means = {nodes: Acceptance(surface, half_angle_rad, nodes=nodes).stokes for nodes in (*NODES, CONVERGED_NODES)}
    exact = means[CONVERGED_NODES](*mirror)
    single = interleaved_s({nodes: partial(means[nodes], *mirror) for nodes in NODES}, ROUNDS)
    scan = interleaved_s({nodes: partial(means[nodes], MIRROR_RAD, SCAN_RAD, np.pi) for nodes in NODES}, ROUNDS)
    quadrature = [
        Cost(
            nodes,
            float(np.median(single[nodes])),
            float(np.median(scan[nodes])) / SCAN_RAD.size,
            float(np.linalg.norm(means[nodes](*mirror) - exact) / exact[0]),
        )
        for nodes in NODES
    ]

    lit, detector = LitSurface(MIRROR_RAD, sigma, 0.0), Cone(MIRROR_RAD, np.pi, half_angle_rad)
    traced = []
    for rays in RAYS:
        start = ONE_CORE()
        sample = cone_stokes(lit, detector, index=INDEX, rays=rays, seed=1)
        duration_s = ONE_CORE() - start
        traced.append(Cost(rays, duration_s, duration_s, float(sample.stderr[0] / exact[0])))
    apart = float((sample.mean[0] - exact[0]) / sample.stderr[0])
    return ConeCost(sigma, half_angle_deg, quadrature, traced, apart)


def report(costs: list[ConeCost]) -> None:
    print(f"\nAcceptance cone at 60°/60°: µs a cone, alone / in a scan of {SCAN_RAD.size}, and relative error\n")
    print(
        "| | " + " | ".join(f"sigma {c.sigma:g}, K = {BOUNCES[c.sigma]}, {c.half_angle_deg:g}°" for c in costs) + " |"
    )
    print("|---|" + "---|" * len(costs))
    for row, nodes in enumerate(NODES):
        cells = [cost.quadrature[row] for cost in costs]
        line = (f"{1e6 * cell.single_s:.0f} / {1e6 * cell.scan_s:.1f} ({cell.error:.0e})" for cell in cells)
        print(f"| {nodes} nodes | {' | '.join(line)} |")
    for row, rays in enumerate(RAYS):
        cells = [cost.rays[row] for cost in costs]
        print(f"| {rays} rays | {' | '.join(f'{1e6 * cell.single_s:.0f} ({cell.error:.0e})' for cell in cells)} |")
    print(f"\nMost rays and quadrature, apart in standard errors of S0: {', '.join(f'{c.apart:+.1f}' for c in costs)}")
