"""Ways for light to pass through grooves from i to r in k bounces, and how much takes each: f_k of a perfect mirror.

f_k = Σ exp(-t²/2σ²)/(2πσ²) · Δp/(W cos T_i) · t/(2 (n1 α1' + n2 α2') ρ)/cos tr over the two sides of the groove and,
in asymmetric grooves, over which wall is met first.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from model.geometry import Facet
from model.groove_plane import GroovePlane
from model.groove_slope import Grooves, sides, solve
from model.groove_visibility import visible
from model.kernel.expression import Value, both, either, minimum, sqrt, where
from model.slopes import slope_density

# Beyond it, closer to the mirror direction than any number can tell, nothing finite is left to be said.
_LARGEST = 1e290


@dataclass(frozen=True)
class Passage:
    """One way through the grooves.

    Attributes
    ----------
    reflectance : Value
        Of perfect mirrors, in 1/sr; 0 where it is infinite.
    caustic : Value
        Whether it is infinite, in the mirror direction itself.
    facing : Value
        u: +1 where the first wall faces s, -1 where it faces -s.
    grooves : Grooves
        The walls.
    """

    reflectance: Value
    caustic: Value
    facing: Value
    grooves: Grooves


def skews(asymmetry: Value) -> tuple[list[Value], float]:
    """Which first walls to tell apart, by +a (the steeper) or -a, and how many of each there are."""
    if isinstance(asymmetry, float) and asymmetry == 0.0:
        return [0.0], 2.0
    return [asymmetry, -asymmetry], 1.0


def single_bounce(at: Facet, sigma: Value, asymmetry: Value) -> Value:
    """Single-bounce reflectance of a perfect mirror in 1/sr; with a = 0 it is D G/(4 cos ti cos tr).

    ρ divides out: the wall that is met bisects i and r, and its slope tan θ_h is ρ/(cos ti + cos tr).

    Parameters
    ----------
    at : Facet
        The wall that is met.
    sigma, asymmetry : Value
        As for `passages`.
    """
    stretch = 1.0 + at.slope * at.slope
    whole_wall = at.cos * sqrt(stretch) * 0.5
    per_area = stretch / (2.0 * at.sum_of_cosines * at.cos_incidence * at.cos_exit)
    signs, copies = skews(asymmetry)
    reflectance: Value = 0.0
    for skew in signs:
        first, second = 1.0 + skew, 1.0 - skew
        share = copies * minimum(second * whole_wall, at.cos_lower)
        reflectance = reflectance + slope_density(at.slope / first, sigma, share * per_area / (first * first))
    return reflectance


def passages(bounces: int, plane: GroovePlane, sigma: Value, asymmetry: Value) -> Iterator[Passage]:
    """Every way through the grooves in two bounces or more.

    Parameters
    ----------
    bounces : int
        Number of bounces, at least 2.
    plane : GroovePlane
        Where the light comes from and goes to.
    sigma : Value
        rms slope per axis.
    asymmetry : Value
        a, at least 0 and below 1; the number 0 for symmetric grooves.
    """
    lean = plane.half_sum if bounces % 2 else plane.half_difference
    first_side: Value = 1.0 if bounces % 2 else plane.leaning
    signs, copies = skews(asymmetry)
    common = copies * plane.length * plane.inverse_rho / (2.0 * plane.cos_incidence * plane.cos_exit)
    for side in sides(lean):
        facing = first_side if side.steep else -first_side
        for skew in signs:
            grooves = solve(bounces, side, skew)
            share = visible(bounces, plane, side, facing, grooves)
            spread = grooves.slope * _slope_per_angle(bounces, grooves)
            reflectance = slope_density(grooves.slope, sigma, common * (share * spread))
            caustic = either(both(share > 0.0, plane.at_mirror), reflectance > _LARGEST)
            yield Passage(where(caustic, 0.0, reflectance), caustic, facing, grooves)


def _slope_per_angle(bounces: int, grooves: Grooves) -> Value:
    # 1/(n1 α1' + n2 α2'), with α' = c/(1 + c² t²).
    first, second = 1.0 + grooves.first * grooves.first, 1.0 + grooves.second * grooves.second
    if grooves.symmetric:
        return first * (1.0 / bounces)
    rate1, rate2 = (bounces + 1) // 2 * grooves.relative_first, bounces // 2 * grooves.relative_second
    return first * second / (rate1 * second + rate2 * first)
