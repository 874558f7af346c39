"""How much of a groove's opening sends light through it in exactly k bounces: Δp over the opening's width W.

In the groove unfolded about its bottom edge the walls become spokes with tips at distances L1, L2, L1, …, γ apart, and
the ray a straight line that meets spokes 1 … k, but not 0 and k + 1. The shadow of section 4 is spoke 0 under another
name. Let A_c be the angle from the middle of spokes 1 … k to the ray's normal: u D for odd k, u H - δ/2 for even k.
Every difference p_j - p_m is written as a product of sines, or a sum with the exact difference of lengths, before any
number is formed: subtracting two p loses the small openings of steep grooves and the edges of the visible range.
Lengths over W: l1 = c2·sqrt(1 + c1² t²)/2, l2 = c1·sqrt(1 + c2² t²)/2, so that l1² - l2² = (c2² - c1²)/4.
"""

from __future__ import annotations

import numpy as np

from model.geometry import FloatArray
from model.groove_plane import GroovePlane
from model.groove_slope import Grooves, Side


def visible(bounces: int, plane: GroovePlane, side: Side, facing: FloatArray, grooves: Grooves) -> FloatArray:
    """Δp/W, from 0 to 1, of two bounces or more.

    Parameters
    ----------
    bounces : int
        Number of bounces, at least 2.
    plane : GroovePlane
        Where the light comes from and goes to.
    side : Side
        Side of the groove that was solved for.
    facing : ndarray
        u: +1 where the first wall faces s, -1 where it faces -s.
    grooves : Grooves
        What was found.
    """
    if grooves.relative_first == grooves.relative_second:
        edges = _symmetric(bounces, plane, side, grooves)
    elif bounces % 2:
        edges = _odd(plane, side, grooves)
    else:
        edges = _even(bounces, plane, side, facing, grooves)
    share: FloatArray = np.maximum(np.minimum.reduce(edges), 0.0)
    return share


def _symmetric(bounces: int, plane: GroovePlane, side: Side, grooves: Grooves) -> list[FloatArray]:
    # Of all spokes the last one, and of those not met the first, on the side the ray leans to, decide.
    length = np.hypot(1.0, grooves.slope) / 2.0
    off_axis = np.abs(plane.half_difference) if bounces % 2 else plane.half_sum
    spare = side.total / bounces - off_axis
    last = side.near / 2.0 - off_axis if _is_flat(bounces, side) else spare + side.signed
    return [length * np.sin(last), 2.0 * length * np.sin(side.near) * np.sin(spare)]


def _even(bounces: int, plane: GroovePlane, side: Side, facing: FloatArray, grooves: Grooves) -> list[FloatArray]:
    # Spokes 1 and k decide; spoke k - 1 can only where k already hides all, for |δ| < γ.
    off_axis = facing * plane.half_sum
    length1, length2 = _lengths(grooves)
    kappa1, kappa2 = np.arctan2(1.0, grooves.first), np.arctan2(1.0, grooves.second)
    if _is_flat(bounces, side):
        # κ1 + pi/2 - c is α2 here: both may be tiny.
        last1, last2 = np.arctan(grooves.second), np.arctan(grooves.first)
    else:
        last1, last2 = kappa1 + side.signed, kappa2 + side.signed
    sin_total = np.sin(side.near)
    return [
        length1 * np.sin(last1 + off_axis),
        length2 * np.sin(last2 - off_axis),
        2.0 * length1 * sin_total * np.sin(kappa1 + off_axis),
        2.0 * length2 * sin_total * np.sin(kappa2 - off_axis),
        plane.cos_lower,
    ]


def _odd(plane: GroovePlane, side: Side, grooves: Grooves) -> list[FloatArray]:
    # On the side the ray leans to, spoke k or the perhaps shorter k - 1 decides, against spoke 0.
    length1, length2 = _lengths(grooves)
    sum_of_lengths = length1 + length2
    difference = (grooves.relative_second - grooves.relative_first) / 2.0 / sum_of_lengths
    kappa1, kappa2 = np.arctan2(1.0, grooves.first), np.arctan2(1.0, grooves.second)
    off_axis, opening = np.abs(plane.half_difference), kappa1 + kappa2
    middle, whole, last = (
        opening / 2.0 - off_axis,
        side.total + (kappa2 - kappa1) / 2.0,
        kappa1 + side.signed - off_axis,
    )
    return [
        length1 * np.sin(last),
        length2 * np.sin(last + opening),
        sum_of_lengths * np.sin(middle) * np.sin(whole) + difference * np.cos(middle) * np.cos(whole),
        2.0 * length2 * np.sin(opening - off_axis) * np.sin(side.total - kappa1),
    ]


def _lengths(grooves: Grooves) -> tuple[FloatArray, FloatArray]:
    return (
        grooves.relative_second * np.hypot(1.0, grooves.first) / 2.0,
        grooves.relative_first * np.hypot(1.0, grooves.second) / 2.0,
    )


def _is_flat(bounces: int, side: Side) -> bool:
    return bounces == 2 and not side.steep
