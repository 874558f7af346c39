"""How much of a groove's opening sends light through it in exactly k bounces: Δp over the opening's width W.

In the groove unfolded about its bottom edge the walls become spokes with tips at distances L1, L2, L1, …, γ apart, and
the ray a straight line that meets spokes 1 … k, but not 0 and k + 1. The shadow of section 4 is spoke 0 under another
name. Let A_c be the angle from the middle of spokes 1 … k to the ray's normal: u D for odd k, u H - δ/2 for even k.
Every difference p_j - p_m is written as a product of sines, or a sum with the exact difference of lengths, before any
number is formed: subtracting two p loses the small openings of steep grooves and the edges of the visible range.
Lengths over W: l1 = c2·sqrt(1 + c1² t²)/2, l2 = c1·sqrt(1 + c2² t²)/2, so that l1² - l2² = (c2² - c1²)/4.
"""

from __future__ import annotations

from model.groove_plane import GroovePlane
from model.groove_slope import Grooves, Side
from model.kernel.expression import Value, atan2, cos, maximum, minimum, sin, sqrt


def visible(bounces: int, plane: GroovePlane, side: Side, facing: Value, grooves: Grooves) -> Value:
    """Δp/W, from 0 to 1, of two bounces or more.

    Parameters
    ----------
    bounces : int
        Number of bounces, at least 2.
    plane : GroovePlane
        Where the light comes from and goes to.
    side : Side
        Side of the groove that was solved for.
    facing : Value
        u: +1 where the first wall faces s, -1 where it faces -s.
    grooves : Grooves
        What was found.
    """
    if grooves.symmetric:
        edges = _symmetric(bounces, plane, side, grooves)
    elif bounces % 2:
        edges = _odd(plane, side, grooves)
    else:
        edges = _even(bounces, plane, side, facing, grooves)
    return maximum(minimum(*edges), 0.0)


def _symmetric(bounces: int, plane: GroovePlane, side: Side, grooves: Grooves) -> list[Value]:
    # Of all spokes the last one, and of those not met the first, on the side the ray leans to, decide.
    length = _secant(grooves.slope) / 2.0
    off_axis = abs(plane.half_difference) if bounces % 2 else plane.half_sum
    spare = side.total / bounces - off_axis
    last = side.near / 2.0 - off_axis if _is_flat(bounces, side) else spare + side.signed
    return [length * sin(last), 2.0 * length * sin(side.near) * sin(spare)]


def _even(bounces: int, plane: GroovePlane, side: Side, facing: Value, grooves: Grooves) -> list[Value]:
    # Spokes 1 and k decide; spoke k - 1 can only where k already hides all, for |δ| < γ.
    off_axis = facing * plane.half_sum
    length1, length2 = _lengths(grooves)
    kappa1, kappa2 = atan2(1.0, grooves.first), atan2(1.0, grooves.second)
    if _is_flat(bounces, side):
        # κ1 + pi/2 - c is α2 here: both may be tiny.
        last1, last2 = atan2(grooves.second, 1.0), atan2(grooves.first, 1.0)
    else:
        last1, last2 = kappa1 + side.signed, kappa2 + side.signed
    sin_total = sin(side.near)
    return [
        length1 * sin(last1 + off_axis),
        length2 * sin(last2 - off_axis),
        2.0 * length1 * sin_total * sin(kappa1 + off_axis),
        2.0 * length2 * sin_total * sin(kappa2 - off_axis),
        plane.cos_lower,
    ]


def _odd(plane: GroovePlane, side: Side, grooves: Grooves) -> list[Value]:
    # On the side the ray leans to, spoke k or the perhaps shorter k - 1 decides, against spoke 0.
    length1, length2 = _lengths(grooves)
    sum_of_lengths = length1 + length2
    difference = (grooves.relative_second - grooves.relative_first) / 2.0 / sum_of_lengths
    kappa1, kappa2 = atan2(1.0, grooves.first), atan2(1.0, grooves.second)
    off_axis, opening = abs(plane.half_difference), kappa1 + kappa2
    middle, whole, last = (
        opening / 2.0 - off_axis,
        side.total + (kappa2 - kappa1) / 2.0,
        kappa1 + side.signed - off_axis,
    )
    return [
        length1 * sin(last),
        length2 * sin(last + opening),
        sum_of_lengths * sin(middle) * sin(whole) + difference * cos(middle) * cos(whole),
        2.0 * length2 * sin(opening - off_axis) * sin(side.total - kappa1),
    ]


def _lengths(grooves: Grooves) -> tuple[Value, Value]:
    return (
        grooves.relative_second * _secant(grooves.first) / 2.0,
        grooves.relative_first * _secant(grooves.second) / 2.0,
    )


def _secant(slope: Value) -> Value:
    return sqrt(1.0 + slope * slope)


def _is_flat(bounces: int, side: Side) -> bool:
    return bounces == 2 and not side.steep
