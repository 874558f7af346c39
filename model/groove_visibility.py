"""How much of a groove's opening sends light through it in exactly k bounces: Δp over the opening's width W.

In the groove unfolded about its bottom edge the walls become spokes with tips at distances L1, L2, L1, …, γ apart, and
the ray a straight line that meets spokes 1 … k, but neither k + 1 nor 0, the wall that may shade the first. Let A_c be
the angle from the middle of spokes 1 … k to the ray's normal: u D for odd k, u H - δ/2 for even k.
Every difference p_j - p_m is written as a product of sines, or a sum with the exact difference of lengths, before any
number is formed: subtracting two p loses the small openings of steep grooves and the edges of the visible range.
Lengths over W: l1 = c2·sqrt(1 + c1² t²)/2, l2 = c1·sqrt(1 + c2² t²)/2, so that l1² - l2² = (c2² - c1²)/4.
"""

from __future__ import annotations

from model.groove_plane import GroovePlane
from model.groove_slope import Grooves, Side
from model.kernel.expression import Value, maximum, minimum, sqrt


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
    off_axis = plane.half_difference if bounces % 2 else plane.half_sum
    sin_spare = grooves.sin_half * off_axis.cos - grooves.cos_half * off_axis.sin
    if _is_flat(bounces, side):
        sin_last = grooves.cos_half * off_axis.cos - grooves.sin_half * off_axis.sin
    else:
        cos_spare = grooves.cos_half * off_axis.cos + grooves.sin_half * off_axis.sin
        sin_last = sin_spare * side.sin + cos_spare * side.cos
    length = 0.5 / grooves.sin_half
    return [length * sin_last, 2.0 * length * side.sin * sin_spare]


def _even(bounces: int, plane: GroovePlane, side: Side, facing: Value, grooves: Grooves) -> list[Value]:
    # Spokes 1 and k decide; spoke k - 1 can only where k already hides all, for |δ| < γ.
    sin_off, cos_off = facing * plane.half_sum.sin, plane.half_sum.cos
    length1, length2 = _lengths(grooves)
    (sin1, cos1), (sin2, cos2) = _walls(grooves)
    if _is_flat(bounces, side):
        # κ1 + pi/2 - c is α2 here: both may be tiny.
        sin_last1, cos_last1, sin_last2, cos_last2 = cos2, sin2, cos1, sin1
    else:
        sin_last1, cos_last1 = sin1 * side.sin + cos1 * side.cos, cos1 * side.sin - sin1 * side.cos
        sin_last2, cos_last2 = sin2 * side.sin + cos2 * side.cos, cos2 * side.sin - sin2 * side.cos
    return [
        length1 * (sin_last1 * cos_off + cos_last1 * sin_off),
        length2 * (sin_last2 * cos_off - cos_last2 * sin_off),
        2.0 * length1 * side.sin * (sin1 * cos_off + cos1 * sin_off),
        2.0 * length2 * side.sin * (sin2 * cos_off - cos2 * sin_off),
        plane.cos_lower,
    ]


def _odd(plane: GroovePlane, side: Side, grooves: Grooves) -> list[Value]:
    # On the side the ray leans to, spoke k or the perhaps shorter k - 1 decides, against spoke 0.
    off_axis = plane.half_difference
    length1, length2 = _lengths(grooves)
    sum_of_lengths = length1 + length2
    difference = (grooves.relative_second - grooves.relative_first) / 2.0 / sum_of_lengths
    (sin1, cos1), _ = _walls(grooves)
    sin_opening = 2.0 * grooves.sin_half * grooves.cos_half
    cos_opening = (grooves.cos_half - grooves.sin_half) * (grooves.cos_half + grooves.sin_half)
    sin_middle = grooves.sin_half * off_axis.cos - grooves.cos_half * off_axis.sin
    cos_middle = grooves.cos_half * off_axis.cos + grooves.sin_half * off_axis.sin
    # δ/2, half the walls' difference, from sin δ = a sin γ.
    sin_delta = (grooves.relative_first - grooves.relative_second) * 0.5 * sin_opening
    both = grooves.relative_first * grooves.relative_second
    cos_delta = sqrt(cos_opening * cos_opening + both * (sin_opening * sin_opening))
    cos_half_delta = sqrt((1.0 + cos_delta) * 0.5)
    sin_half_delta = sin_delta / (2.0 * cos_half_delta)
    sin_whole = side.sin * cos_half_delta + side.cos * sin_half_delta
    cos_whole = side.cos * cos_half_delta - side.sin * sin_half_delta
    sin_tilt, cos_tilt = sin1 * side.sin + cos1 * side.cos, cos1 * side.sin - sin1 * side.cos
    sin_last = sin_tilt * off_axis.cos - cos_tilt * off_axis.sin
    cos_last = cos_tilt * off_axis.cos + sin_tilt * off_axis.sin
    sin_spare = sin_opening * off_axis.cos - cos_opening * off_axis.sin
    return [
        length1 * sin_last,
        length2 * (sin_last * cos_opening + cos_last * sin_opening),
        sum_of_lengths * sin_middle * sin_whole + difference * cos_middle * cos_whole,
        2.0 * length2 * sin_spare * (side.sin * cos1 - side.cos * sin1),
    ]


def _walls(grooves: Grooves) -> tuple[tuple[Value, Value], tuple[Value, Value]]:
    # Sine and cosine of κ1 and κ2, the walls' angles against the vertical.
    sin1, sin2 = 1.0 / _secant(grooves.first), 1.0 / _secant(grooves.second)
    return (sin1, grooves.first * sin1), (sin2, grooves.second * sin2)


def _lengths(grooves: Grooves) -> tuple[Value, Value]:
    return (
        grooves.relative_second * _secant(grooves.first) * 0.5,
        grooves.relative_first * _secant(grooves.second) * 0.5,
    )


def _secant(slope: Value) -> Value:
    return sqrt(1.0 + slope * slope)


def _is_flat(bounces: int, side: Side) -> bool:
    return bounces == 2 and not side.steep
