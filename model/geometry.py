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

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]

# Below this |i × r| its components lose digits, because they are among the smallest numbers there are.
_RETRO = np.finfo(np.float64).tiny / np.finfo(np.float64).eps


@dataclass(frozen=True)
class Rotation:
    """Cosine and sine of twice the angle from a ray's x-axis to the facet's s-direction, counted about the ray."""

    cos2: FloatArray
    sin2: FloatArray


@dataclass(frozen=True)
class Directions:
    """A pair of directions and the facet that mirrors one into the other; all arrays of one broadcast shape.

    Attributes
    ----------
    incidence_rad, exit_rad : ndarray
        The macro angles.
    cos_incidence, cos_exit : ndarray
        Their cosines.
    horizontal_product : ndarray
        Product of the horizontal parts of i and r: sin ti sin tr cos phi.
    slope : ndarray
        Slope of the facet against the macro surface: tan theta_h.
    cos_facet, sin2_facet : ndarray
        Cosine and squared sine of the angle of incidence on the facet.
    incoming, outgoing : Rotation
        From the macro frames of the two rays to the facet's s-direction.
    """

    incidence_rad: FloatArray
    exit_rad: FloatArray
    cos_incidence: FloatArray
    cos_exit: FloatArray
    horizontal_product: FloatArray
    slope: FloatArray
    cos_facet: FloatArray
    sin2_facet: FloatArray
    incoming: Rotation
    outgoing: Rotation


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


def horizontal_sum(
    incidence_rad: ArrayLike, exit_rad: ArrayLike, azimuth_rad: ArrayLike
) -> tuple[FloatArray, FloatArray]:
    """Horizontal part of i + r, without cancellation near the mirror direction.

    Parameters
    ----------
    incidence_rad, exit_rad, azimuth_rad : array_like
        Angles in radians.

    Returns
    -------
    x, y : ndarray
        Its components along and across the plane of incidence; their hypotenuse is rho.
    """
    incidence, exit_, azimuth = (np.asarray(angle, np.float64) for angle in (incidence_rad, exit_rad, azimuth_rad))
    x = _difference_of_sines(incidence, exit_) + 2.0 * np.sin(exit_) * np.cos(azimuth / 2.0) ** 2
    return x, np.sin(exit_) * np.sin(azimuth)


def directions(incidence_rad: ArrayLike, exit_rad: ArrayLike, azimuth_rad: ArrayLike) -> Directions:
    """Describe the facet that mirrors the incoming into the outgoing ray.

    Parameters
    ----------
    incidence_rad, exit_rad : array_like
        Angles from the macro normal, 0 to pi/2.
    azimuth_rad : array_like
        phi = phi_r - phi_i; pi is the mirror side.
    """
    incidence, exit_, azimuth = np.broadcast_arrays(
        *(np.asarray(angle, np.float64) for angle in (incidence_rad, exit_rad, azimuth_rad))
    )
    sin_i, cos_i, sin_r, cos_r = np.sin(incidence), np.cos(incidence), np.sin(exit_), np.cos(exit_)
    sin_phi, versine_phi = np.sin(azimuth), 2.0 * np.sin(azimuth / 2.0) ** 2

    sum_x, sum_y = horizontal_sum(incidence, exit_, azimuth)
    sum_z = cos_i + cos_r
    rho = np.hypot(sum_x, sum_y)
    difference_x = _difference_of_sines(incidence, exit_) + sin_r * versine_phi
    difference_z = -2.0 * np.sin((incidence + exit_) / 2.0) * np.sin((incidence - exit_) / 2.0)

    # The facet's s-direction is i × r. Its components in the two frames, multiplied out by hand:
    sin_difference = np.sin(incidence - exit_)
    incoming_x, incoming_y = sin_difference + cos_i * sin_r * versine_phi, sin_r * sin_phi
    outgoing_x, outgoing_y = sin_i * cos_r * versine_phi - sin_difference, sin_i * sin_phi
    # At retro-reflection i × r vanishes, and any direction serves in its place; this is the incoming ray's own x-axis.
    retro = np.hypot(incoming_x, incoming_y) < _RETRO
    incoming_x = np.where(retro, 1.0, incoming_x)
    outgoing_x, outgoing_y = np.where(retro, -np.cos(azimuth), outgoing_x), np.where(retro, sin_phi, outgoing_y)

    return Directions(
        incidence_rad=incidence,
        exit_rad=exit_,
        cos_incidence=cos_i,
        cos_exit=cos_r,
        horizontal_product=sin_i * sin_r * np.cos(azimuth),
        slope=rho / sum_z,
        cos_facet=np.hypot(rho, sum_z) / 2.0,
        sin2_facet=(difference_x**2 + sum_y**2 + difference_z**2) / 4.0,
        incoming=_rotation(incoming_x, incoming_y),
        outgoing=_rotation(outgoing_x, outgoing_y),
    )


def _difference_of_sines(a: FloatArray, b: FloatArray) -> FloatArray:
    difference: FloatArray = 2.0 * np.cos((a + b) / 2.0) * np.sin((a - b) / 2.0)
    return difference


def _rotation(x: FloatArray, y: FloatArray) -> Rotation:
    length = np.hypot(x, y)
    cos, sin = x / length, y / length
    return Rotation(cos2=(cos - sin) * (cos + sin), sin2=2.0 * sin * cos)
