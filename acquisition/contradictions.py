"""Directions whose readings cannot be of one steady light: a lamp that was off for a moment between two references.

What is looked for is light that is gone, not light that is somewhat off: an analyzer that is not quite as stated, an
arm that comes back to a steep peak within its tolerance, and a drifting lamp all leave residuals far beyond the noise.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from acquisition.lamp_level import SIGNIFICANT
from acquisition.readings import StokesPoint

_DARK = 0.1
"""Share of the light that is to be expected, below which a reading is of the dark."""
_WORTH = 1 / 3
"""Share of the mean light from which on it is to be expected: slots off by 5 % feign up to a quarter of it."""
_TOO_POLARIZED = 1.25
"""Slots off by 5 % feign 1.1; of four polarizers, two that were read in the dark feign 1.41."""
_SAME_DEG = 0.1
"""Incidences and azimuths that differ by less belong to one curve over the exit angle."""
_FEWEST = 3
"""Points of which one can lie between two others."""


def lost_light(
    matrix: NDArray[np.float64],
    count: int,
    lit: NDArray[np.bool_],
    power_w: NDArray[np.float64],
    variance_w2: NDArray[np.float64],
) -> bool:
    """Whether some signals of a direction are dark where the others say that there is light.

    Nothing is said where the others do not determine the light by themselves.

    Parameters
    ----------
    matrix : ndarray
        Shape (N, unknowns): makes readings of the Stokes parameters, which come first, and of the dark power.
    count : int
        How many Stokes parameters there are.
    lit : ndarray of bool
        Shape (N,): which readings are signals; the others are of the dark.
    power_w, variance_w2 : ndarray
        Shape (N,): readings and the variance of their noise, in W and W².
    """
    dark_w = float(power_w[~lit].mean()) if not lit.all() else 0.0
    light_w = power_w - dark_w
    gone = lit & (light_w < _DARK * light_w.max())
    others = ~gone
    if not gone.any() or np.linalg.matrix_rank(matrix[others]) < matrix.shape[1]:
        return False
    expectation = matrix[gone, :count] @ np.linalg.pinv(matrix[others])[:count]
    expected_w = expectation @ power_w[others]
    stderr_w = np.sqrt(expectation**2 @ variance_w2[others] + variance_w2[gone])
    missing_w = _DARK * expected_w - light_w[gone]
    is_worth = expected_w > _WORTH * light_w[lit & others].mean()
    return bool((is_worth & (missing_w > 0.0) & (expected_w - light_w[gone] > SIGNIFICANT * stderr_w)).any())


def unsteady(points: Sequence[StokesPoint]) -> Iterator[tuple[str, list[int]]]:
    """What speaks against the light of some directions, in words, and their numbers."""
    contradictory = [point.point for point in points if point.is_contradictory]
    too_polarized = [point.point for point in points if not point.is_contradictory and _is_too_polarized(point)]
    if contradictory:
        yield "are dark in a part where the others say that there is light", contradictory
    if too_polarized:
        yield "would be of light polarized to far more than 100 %", too_polarized
    if dark := _dark_between(points):
        yield "show less than a tenth of the light of the directions on both sides", dark


def _is_too_polarized(point: StokesPoint) -> bool:
    polarized = float(np.linalg.norm(point.stokes[1:]))
    if polarized == 0.0:
        return False
    slopes = np.array([-_TOO_POLARIZED, *(point.stokes[1:] / polarized)])
    excess = polarized - _TOO_POLARIZED * point.stokes[0]
    return bool(excess > SIGNIFICANT * math.sqrt(slopes @ point.covariance @ slopes))


def _dark_between(points: Sequence[StokesPoint]) -> list[int]:
    """Single directions that are dark between bright ones; a peak, however narrow, has no such neighbours inside."""
    curves: dict[tuple[int, ...], list[StokesPoint]] = {}
    for point in points:
        plane_deg = point.incidence_deg, point.azimuth_deg, point.exit_azimuth_deg or 0.0
        key = tuple(round(angle_deg / _SAME_DEG) for angle_deg in plane_deg)
        curves.setdefault(key, []).append(point)
    dark: list[int] = []
    for curve in curves.values():
        if len(curve) < _FEWEST:
            continue
        curve.sort(key=lambda point: point.exit_deg)
        s0 = np.array([point.stokes[0] for point in curve])
        variance = np.array([point.covariance[0, 0] for point in curve])
        sides = np.minimum(s0[:-2], s0[2:])
        noise = np.sqrt(_DARK**2 * np.maximum(variance[:-2], variance[2:]) + variance[1:-1])
        below = _DARK * sides - s0[1:-1] > SIGNIFICANT * noise
        dark += [curve[1 + int(place)].point for place in np.flatnonzero(below)]
    return dark
