"""Directions of light, the facet that mirrors one into the other, and the frames that Stokes vectors refer to.

The macro surface is z = 0 with normal n = +z. Unit vectors point away from it: i to the source, r to the detector,

    i = (sin ti, 0, cos ti),    r = (sin tr cos phi, sin tr sin phi, cos tr),

so phi = pi is the mirror (forward) side. A ray that travels along q carries the right-handed frame (x, y, q) with
x along z × q, the s-direction; where q is vertical the limit along the ray's azimuth is taken. Stokes vectors of the
incoming ray (q = -i) and of the outgoing ray (q = r) refer to these frames. S1 > 0 is s-polarized light.

Everything is computed from differences of angles. Adding i and r as vectors loses, near the mirror direction, every
digit of their horizontal sum.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from model.kernel.expression import Value, cos, minimum, sin, sqrt, where

FloatArray = NDArray[np.float64]

# Squared sine of the angle between i and r below which they are one direction.
_RETRO = 1e-290


Number = TypeVar("Number")


@dataclass(frozen=True)
class Rotation(Generic[Number]):
    """Cosine and sine of twice the angle from a ray's x-axis to another one, counted about the ray."""

    cos2: Number
    sin2: Number


@dataclass(frozen=True)
class Angles:
    """Sines and cosines of a pair of directions, and differences of them to full relative precision.

    Attributes
    ----------
    sin_incidence, cos_incidence, sin_exit, cos_exit : Value
        Of the macro angles.
    sin_azimuth, cos_azimuth, versine, coversine : Value
        Of phi, with 1 - cos phi and 1 + cos phi.
    sin_difference : Value
        sin(ti - tr).
    difference_of_sines, difference_of_cosines : Value
        sin ti - sin tr, cos ti - cos tr.
    sum_of_cosines : Value
        Vertical part of i + r.
    """

    sin_incidence: Value
    cos_incidence: Value
    sin_exit: Value
    cos_exit: Value
    sin_azimuth: Value
    cos_azimuth: Value
    versine: Value
    coversine: Value
    sin_difference: Value
    difference_of_sines: Value
    difference_of_cosines: Value
    sum_of_cosines: Value


@dataclass(frozen=True)
class Facet:
    """The facet that mirrors one direction into the other.

    Attributes
    ----------
    slope : Value
        Slope of the facet against the macro surface: tan theta_h.
    cos, sin2 : Value
        Cosine and squared sine of the angle of incidence on the facet.
    cos_incidence, cos_exit, sum_of_cosines : Value
        Of the macro angles.
    horizontal_product : Value
        Product of the horizontal parts of i and r: sin ti sin tr cos phi.
    incoming, outgoing : Rotation
        From the macro frames of the two rays to the facet's s-direction.
    """

    slope: Value
    cos: Value
    sin2: Value
    cos_incidence: Value
    cos_exit: Value
    sum_of_cosines: Value
    horizontal_product: Value
    incoming: Rotation[Value]
    outgoing: Rotation[Value]

    @property
    def cos_lower(self) -> Value:
        """The smaller of the cosines of the macro angles."""
        return minimum(self.cos_incidence, self.cos_exit)


def in_plane(signed_exit_rad: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Exit angle and azimuth of a signed exit angle of an in-plane scan.

    Parameters
    ----------
    signed_exit_rad : array_like
        Positive (and zero) on the mirror side, negative on the source side.

    Returns
    -------
    exit_rad, azimuth_rad : ndarray
        Exit angle >= 0, and azimuth pi (mirror side) or 0 (source side).
    """
    signed = np.asarray(signed_exit_rad, dtype=np.float64)
    return np.abs(signed), np.where(signed >= 0.0, np.pi, 0.0)


def angles(incidence_rad: Value, exit_rad: Value, azimuth_rad: Value) -> Angles:
    """Sines and cosines of a pair of directions.

    Parameters
    ----------
    incidence_rad, exit_rad : Value
        Angles from the macro normal, 0 to pi/2.
    azimuth_rad : Value
        phi = phi_r - phi_i.
    """
    sin_i, cos_i, sin_r, cos_r = sin(incidence_rad), cos(incidence_rad), sin(exit_rad), cos(exit_rad)
    half_difference, half_azimuth = (incidence_rad - exit_rad) * 0.5, azimuth_rad * 0.5
    sin_half, cos_half = sin(half_difference), cos(half_difference)
    sin_side, cos_side = sin(half_azimuth), cos(half_azimuth)
    versine = 2.0 * sin_side * sin_side
    # sin a - sin b = (cos a + cos b) tan((a - b)/2), and the like with cosines: sums of one sign alone.
    tangent, sum_z = sin_half / cos_half, cos_i + cos_r
    return Angles(
        sin_incidence=sin_i,
        cos_incidence=cos_i,
        sin_exit=sin_r,
        cos_exit=cos_r,
        sin_azimuth=2.0 * sin_side * cos_side,
        cos_azimuth=1.0 - versine,
        versine=versine,
        coversine=2.0 * cos_side * cos_side,
        sin_difference=2.0 * sin_half * cos_half,
        difference_of_sines=sum_z * tangent,
        difference_of_cosines=-(sin_i + sin_r) * tangent,
        sum_of_cosines=sum_z,
    )


def horizontal_sum(at: Angles) -> tuple[Value, Value]:
    """Horizontal part of i + r along and across the plane of incidence, without cancellation near the mirror."""
    return at.difference_of_sines + at.sin_exit * at.coversine, at.sin_exit * at.sin_azimuth


def facet(at: Angles) -> Facet:
    """Describe the facet that mirrors the incoming into the outgoing ray."""
    sum_z, twice_sines = at.sum_of_cosines, 2.0 * at.sin_incidence * at.sin_exit
    # Squares of the horizontal parts of i + r and i - r as sums of one sign, the same with i and r exchanged.
    horizontal2 = at.difference_of_sines * at.difference_of_sines
    rho2 = horizontal2 + twice_sines * at.coversine
    apart2 = horizontal2 + twice_sines * at.versine + at.difference_of_cosines * at.difference_of_cosines

    # The facet's s-direction is i × r. Its components in the two frames, multiplied out by hand:
    incoming_x = at.sin_difference + at.cos_incidence * at.sin_exit * at.versine
    incoming_y = at.sin_exit * at.sin_azimuth
    outgoing_x = at.sin_incidence * at.cos_exit * at.versine - at.sin_difference
    outgoing_y = at.sin_incidence * at.sin_azimuth
    # In both frames i × r is equally long. Where it vanishes, in retro-reflection, any direction serves in its place;
    # this is the incoming ray's own x-axis.
    length2 = incoming_x * incoming_x + incoming_y * incoming_y
    retro = length2 < _RETRO
    inverse = 1.0 / where(retro, 1.0, length2)
    return Facet(
        slope=sqrt(rho2) / sum_z,
        cos=sqrt(rho2 + sum_z * sum_z) * 0.5,
        sin2=apart2 * 0.25,
        cos_incidence=at.cos_incidence,
        cos_exit=at.cos_exit,
        sum_of_cosines=sum_z,
        horizontal_product=at.sin_incidence * at.sin_exit * at.cos_azimuth,
        incoming=rotation(where(retro, 1.0, incoming_x), where(retro, 0.0, incoming_y), inverse),
        outgoing=rotation(where(retro, -at.cos_azimuth, outgoing_x), where(retro, at.sin_azimuth, outgoing_y), inverse),
    )


def rotation(x: Value, y: Value, inverse_length2: Value) -> Rotation[Value]:
    """The rotation onto an axis with components (x, y), given 1/(x² + y²)."""
    return Rotation(cos2=(x - y) * (x + y) * inverse_length2, sin2=2.0 * x * y * inverse_length2)
