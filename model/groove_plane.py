"""A pair of directions seen in the plane across the grooves that can join them.

Walls are parallel to a groove's axis, so that reflections keep the component of a ray along it. For given i and r the
grooves that can send one into the other therefore lie across s, the direction of the horizontal part of i + r, for any
number of bounces. T_i and T_r are the angles of i and r from the normal in the (s, n) plane.
"""

from __future__ import annotations

from dataclasses import dataclass

from model.geometry import Angles, Rotation, horizontal_sum, rotation
from model.kernel.expression import Value, atan2, minimum, sqrt, where

# Below this length the horizontal part of i + r has no direction left, because its components lose their digits.
_MIRROR = 1e-150


@dataclass(frozen=True)
class Angle:
    """An angle from 0 to pi/2, its complement to pi/2, and its sine and cosine, all to full relative precision."""

    radians: Value
    complement: Value
    sin: Value
    cos: Value


@dataclass(frozen=True)
class GroovePlane:
    """Directions in the (s, n) plane.

    Attributes
    ----------
    cos_incidence, cos_exit : Value
        Cosines of the macro angles.
    inverse_rho : Value
        1/ρ, ρ the length of the horizontal part of i + r; 1 in the mirror direction, where ρ is 0.
    half_sum, half_difference : Angle
        H = (T_i + T_r)/2 and |D| = |T_i - T_r|/2, both from 0 to pi/2.
    leaning : Value
        -1 where T_i is the smaller of the two angles, otherwise +1: the sign of D.
    length, axial : Value
        Length of i in the plane, the same as that of r, and its component along the grooves.
    cos_first, sin_first : Value
        Cosine and sine of T_i.
    cos_lower : Value
        The smaller of cos T_i and cos T_r.
    at_mirror : Value
        Whether r is the mirror direction of i itself, where s has no direction.
    incoming, outgoing : Rotation
        From the macro frames of the two rays to the groove's: for the incoming ray its first axis is s turned from
        the normal by T_i, for the outgoing ray it is n turned by T_r.
    """

    cos_incidence: Value
    cos_exit: Value
    inverse_rho: Value
    half_sum: Angle
    half_difference: Angle
    leaning: Value
    length: Value
    axial: Value
    cos_first: Value
    sin_first: Value
    cos_lower: Value
    at_mirror: Value
    incoming: Rotation[Value]
    outgoing: Rotation[Value]


def groove_plane(at: Angles) -> GroovePlane:
    """Describe a pair of directions in the plane across the grooves that join them."""
    sin_i, cos_i, sin_r, cos_r = at.sin_incidence, at.cos_incidence, at.sin_exit, at.cos_exit
    sum_x, sum_y = horizontal_sum(at)
    # A sum of squares, and the same to the last bit with i and r exchanged: so is then what each way reflects.
    rho = sqrt(at.difference_of_sines * at.difference_of_sines + 2.0 * sin_i * sin_r * at.coversine)
    sum_z = at.sum_of_cosines
    # In the mirror direction itself any s serves.
    mirror = rho < _MIRROR
    inverse_rho = 1.0 / where(mirror, 1.0, rho)
    s_x, s_y = where(mirror, 1.0, sum_x * inverse_rho), where(mirror, 0.0, sum_y * inverse_rho)

    # In the plane i + r and i - r are 2 l cos D and 2 l sin D long and at right angles, so that
    # tan H = rho/(cos ti + cos tr), and (i - r)·(i + r) = 0 gives tan D without subtracting two vectors.
    cross = at.sin_difference * (sin_i * cos_r + cos_i * sin_r) * inverse_rho
    half_sum, half_difference = _angle(rho, sum_z), _angle(abs(cross), sum_z)
    length = sum_z / (2.0 * half_sum.cos * half_difference.cos)

    # x-axes are across the macro planes of incidence, s_r and k_r are s seen from the exit azimuth.
    s_r, k_r = at.cos_azimuth * s_x + at.sin_azimuth * s_y, at.cos_azimuth * s_y - at.sin_azimuth * s_x
    across, outgoing = cos_i * s_y, -cos_r * k_r
    inverse2 = 1.0 / (s_x * s_x + across * across)
    in_plane = sqrt(inverse2)
    return GroovePlane(
        cos_incidence=cos_i,
        cos_exit=cos_r,
        inverse_rho=inverse_rho,
        half_sum=half_sum,
        half_difference=half_difference,
        leaning=where(cross < 0.0, -1.0, 1.0),
        length=length,
        axial=sin_i * s_y,
        cos_first=cos_i * in_plane,
        sin_first=sin_i * s_x * in_plane,
        cos_lower=minimum(cos_i, cos_r) / length,
        at_mirror=mirror,
        incoming=rotation(across, s_x, inverse2),
        outgoing=rotation(outgoing, s_r, 1.0 / (outgoing * outgoing + s_r * s_r)),
    )


def _angle(opposite: Value, adjacent: Value) -> Angle:
    inverse = 1.0 / sqrt(opposite * opposite + adjacent * adjacent)
    return Angle(atan2(opposite, adjacent), atan2(adjacent, opposite), opposite * inverse, adjacent * inverse)
