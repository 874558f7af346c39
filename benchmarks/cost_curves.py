"""What each bounce costs and brings: nanoseconds a direction, and the share of the light that is still wrong."""

from __future__ import annotations

from functools import cache, partial, reduce
from typing import NamedTuple

import numpy as np
from interleaved import interleaved_s
from model_case import DIRECTIONS, Case, angles
from model_peers import INDEX
from numpy.typing import NDArray

from model.bounce_bound import light_beyond
from model.vgroove import bounce_stokes

SIGMAS = (0.3, 1.0)
BOUNCES = range(1, 9)
# Light beyond is below 1e-17 at the larger sigma.
CONVERGED_BOUNCES = 14
ROUNDS = 9

_BASE = Case(lobes="specular alone")
VARIANTS = {
    "float64, column, a = 0, random": _BASE,
    "float32": _BASE._replace(precision="float32"),
    "a = 0.4": _BASE._replace(asymmetry=0.4),
    "full Mueller": _BASE._replace(light="Mueller"),
    "grid": _BASE._replace(where="grid"),
    "in plane": _BASE._replace(where="in plane"),
}


class Curve(NamedTuple):
    """One variant at one sigma: for 1, 2, … bounces, cost and error."""

    variant: str
    sigma: float
    ns: list[float]
    error: list[float]


def measure() -> list[Curve]:
    cases = {
        (name, sigma): [case._replace(sigma=sigma, bounces=bounces) for bounces in BOUNCES]
        for sigma in SIGMAS
        for name, case in VARIANTS.items()
    }
    samples = interleaved_s({case: case.call() for group in cases.values() for case in group}, ROUNDS)
    return [
        Curve(name, sigma, [1e9 * float(np.median(samples[case])) / DIRECTIONS for case in group], errors(group))
        for (name, sigma), group in cases.items()
    ]


def errors(cases: list[Case]) -> list[float]:
    """Sum of |difference of Stokes vectors| over that of S0, each direction weighted with the light it carries."""
    exact = _converged(cases[0].where, cases[0].sigma, cases[0].asymmetry)
    exit_rad = np.broadcast_to(angles(cases[0].where, "float64")[1], exact.shape[:-1])
    weight = np.sin(exit_rad) * np.cos(exit_rad)
    light = (weight * exact[..., 0]).sum()
    return [
        float((weight * np.linalg.norm(case.column().astype(np.float64) - exact, axis=-1)).sum() / light)
        for case in cases
    ]


@cache
def _converged(where: str, sigma: float, asymmetry: float) -> NDArray[np.floating]:
    one_count = partial(bounce_stokes, sigma=sigma, asymmetry=asymmetry, index=INDEX)
    directions = angles(where, "float64")
    counts = (one_count(bounces, *directions) for bounces in range(1, CONVERGED_BOUNCES + 1))
    return np.asarray(reduce(np.add, counts))


def report(curves: list[Curve]) -> None:
    for sigma in SIGMAS:
        chosen = [curve for curve in curves if curve.sigma == sigma]
        print(f"\nSpecular lobe, iron, sigma {sigma:g}: ns a direction, and error as a share of the light\n")
        print("| K | " + " | ".join(curve.variant for curve in chosen) + " | bound on light beyond |")
        print("|---|" + "---|" * (len(chosen) + 1))
        for row, bounces in enumerate(BOUNCES):
            cells = [f"{curve.ns[row]:.1f} ({curve.error[row]:.0e})" for curve in chosen]
            print(f"| {bounces} | {' | '.join(cells)} | {light_beyond(bounces, sigma):.0e} |")
