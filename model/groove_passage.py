"""Ways for light to pass through grooves from i to r in k bounces, and how much takes each: f_k of a perfect mirror.

f_k = Σ exp(-t²/2σ²)/(2πσ²) · Δp/(W cos T_i) · t/(2 (n1 α1' + n2 α2') ρ)/cos tr over the two sides of the groove and,
in asymmetric grooves, over which wall is met first.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from model.geometry import FloatArray
from model.groove_plane import GroovePlane
from model.groove_slope import Grooves, sides, solve
from model.groove_visibility import visible


class Passage(NamedTuple):
    """One way through the grooves.

    Attributes
    ----------
    reflectance : ndarray
        Of perfect mirrors, in 1/sr; 0 where it is infinite.
    caustic : ndarray
        Where it is infinite: more than one bounce into the mirror direction itself.
    facing : ndarray
        u: +1 where the first wall faces s, -1 where it faces -s.
    grooves : Grooves
        The walls.
    """

    reflectance: FloatArray
    caustic: NDArray[np.bool_]
    facing: FloatArray
    grooves: Grooves

    @property
    def lit(self) -> NDArray[np.bool_]:
        """Where any light takes this way."""
        lit: NDArray[np.bool_] = self.reflectance > 0.0
        return lit


def passages(bounces: int, plane: GroovePlane, sigma: float, asymmetry: float) -> Iterator[Passage]:
    """Every way through the grooves in so many bounces.

    Parameters
    ----------
    bounces : int
        Number of bounces, at least 1.
    plane : GroovePlane
        Where the light comes from and goes to.
    sigma : float
        rms slope per axis.
    asymmetry : float
        a, at least 0 and below 1.
    """
    skews, copies = ((asymmetry, -asymmetry), 1.0) if asymmetry else ((0.0,), 2.0)
    if bounces == 1:
        for skew in skews:
            yield _single(plane, sigma, skew, copies)
        return
    if bounces % 2:
        half_angle, complement, first_side = plane.half_sum, plane.half_sum_complement, np.ones_like(plane.rho)
    else:
        half_angle, complement = np.abs(plane.half_difference), plane.half_difference_complement
        first_side = np.where(plane.half_difference < 0.0, -1.0, 1.0)
    for side in sides(half_angle, complement):
        facing = first_side if side.steep else -first_side
        for skew in skews:
            grooves = solve(bounces, side, skew)
            share = copies * plane.length * visible(bounces, plane, side, facing, grooves)
            per_slope = (bounces + 1) // 2 * grooves.relative_first / (
                1.0 + grooves.first**2
            ) + bounces // 2 * grooves.relative_second / (1.0 + grooves.second**2)
            spread = grooves.slope / (2.0 * per_slope * np.where(plane.at_mirror, np.inf, plane.rho))
            reflectance = _at_slope(grooves.slope, sigma, share * (spread / (plane.cos_incidence * plane.cos_exit)))
            yield Passage(reflectance, plane.at_mirror & (share > 0.0), facing, grooves)


def _single(plane: GroovePlane, sigma: float, skew: float, copies: float) -> Passage:
    # ρ divides out: the wall that is met bisects i and r, and its slope tan H is ρ/(cos ti + cos tr).
    sum_z = plane.cos_incidence + plane.cos_exit
    first, relative_first, relative_second = plane.rho / sum_z, 1.0 + skew, 1.0 - skew
    slope = first / relative_first
    whole_wall = relative_second * np.hypot(plane.rho, sum_z) * np.hypot(1.0, first) / 4.0
    share = np.minimum(whole_wall, np.minimum(plane.cos_incidence, plane.cos_exit))
    factor = copies * share * (1.0 + first**2) / (2.0 * relative_first**2 * sum_z)
    reflectance = _at_slope(slope, sigma, factor / (plane.cos_incidence * plane.cos_exit))
    return Passage(
        reflectance,
        np.zeros(slope.shape, np.bool_),
        np.ones_like(slope),
        Grooves(slope, first, relative_second * slope, relative_first, relative_second),
    )


def _at_slope(slope: FloatArray, sigma: float, factor: FloatArray) -> FloatArray:
    # Half the exponent twice: a large factor must not meet a density that has already lost its digits to underflow.
    root = np.exp(-((slope / (2.0 * sigma)) ** 2))
    density: FloatArray = root * (factor / (2.0 * np.pi * sigma**2)) * root
    return density
