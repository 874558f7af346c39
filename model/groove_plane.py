"""A pair of directions seen in the plane across the grooves that can join them.

Walls are parallel to a groove's axis, so that reflections keep the component of a ray along it. For given i and r the
grooves that can send one into the other therefore lie across s, the direction of the horizontal part of i + r, for any
number of bounces; physics of V-grooves, with T_i and T_r the angles of i and r from the normal in the (s, n) plane.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from model.geometry import FloatArray, Rotation, horizontal_sum

# Below this length the horizontal part of i + r has no direction left, because its components lose their digits.
_MIRROR = np.finfo(np.float64).tiny / np.finfo(np.float64).eps


@dataclass(frozen=True)
class GroovePlane:
    """Directions in the (s, n) plane; all arrays of one broadcast shape.

    Attributes
    ----------
    cos_incidence, cos_exit : ndarray
        Cosines of the macro angles.
    rho : ndarray
        Length of the horizontal part of i + r; 0 in the mirror direction.
    half_sum, half_difference : ndarray
        (T_i + T_r)/2, from 0 to pi/2, and (T_i - T_r)/2, from -pi/2 to pi/2, in radians.
    half_sum_complement, half_difference_complement : ndarray
        pi/2 less the size of each, to full relative precision.
    length, axial : ndarray
        Length of i in the plane, the same as that of r, and its component along the grooves.
    cos_first, sin_first : ndarray
        Cosine and sine of T_i.
    cos_lower : ndarray
        The smaller of cos T_i and cos T_r.
    incoming, outgoing : Rotation
        From the macro frames of the two rays to the groove's: for the incoming ray its first axis is s turned from
        the normal by T_i, for the outgoing ray it is n turned by T_r.
    """

    cos_incidence: FloatArray
    cos_exit: FloatArray
    rho: FloatArray
    half_sum: FloatArray
    half_sum_complement: FloatArray
    half_difference: FloatArray
    half_difference_complement: FloatArray
    length: FloatArray
    axial: FloatArray
    cos_first: FloatArray
    sin_first: FloatArray
    cos_lower: FloatArray
    incoming: Rotation
    outgoing: Rotation

    @property
    def at_mirror(self) -> NDArray[np.bool_]:
        """Whether r is the mirror direction of i itself, where s has no direction."""
        mirror: NDArray[np.bool_] = self.rho < _MIRROR
        return mirror


def groove_plane(incidence_rad: ArrayLike, exit_rad: ArrayLike, azimuth_rad: ArrayLike) -> GroovePlane:
    """Describe a pair of directions in the plane across the grooves that join them.

    Parameters
    ----------
    incidence_rad, exit_rad : array_like
        Angles from the macro normal, 0 to pi/2; they broadcast.
    azimuth_rad : array_like
        phi = phi_r - phi_i; pi is the mirror side.
    """
    incidence, exit_, azimuth = np.broadcast_arrays(
        *(np.asarray(angle, np.float64) for angle in (incidence_rad, exit_rad, azimuth_rad))
    )
    sin_i, cos_i, sin_r, cos_r = np.sin(incidence), np.cos(incidence), np.sin(exit_), np.cos(exit_)
    cos_phi, sin_phi = np.cos(azimuth), np.sin(azimuth)
    sum_x, sum_y = horizontal_sum(incidence, exit_, azimuth)
    # A sum of squares, and the same to the last bit with i and r exchanged: so is then what each way reflects.
    difference = 2.0 * np.cos((incidence + exit_) / 2.0) * np.sin((incidence - exit_) / 2.0)
    rho = np.hypot(difference, 2.0 * np.cos(azimuth / 2.0) * (np.sqrt(sin_i) * np.sqrt(sin_r)))
    sum_z = cos_i + cos_r
    # In the mirror direction itself any s serves, and a single bounce does not care.
    mirror = rho < _MIRROR
    sum_x, sum_y, scale = np.where(mirror, 1.0, sum_x), np.where(mirror, 0.0, sum_y), np.where(mirror, 1.0, rho)
    size = np.hypot(sum_x, sum_y)
    s_x, s_y = sum_x / size, sum_y / size

    # In the plane i + r and i - r are 2 l cos D and 2 l sin D long and at right angles, so that
    # tan H = rho/(cos ti + cos tr), and (i - r)·(i + r) = 0 gives tan D without subtracting two vectors.
    cross = np.sin(incidence - exit_) * np.sin(incidence + exit_)
    along = scale * sum_z
    half_difference = np.arctan2(cross, along)
    length = np.hypot(rho, sum_z) * np.hypot(along, cross) / (2.0 * along)

    # x-axes are across the macro planes of incidence, s_r and k_r are s seen from the exit azimuth.
    s_r, k_r = cos_phi * s_x + sin_phi * s_y, cos_phi * s_y - sin_phi * s_x
    in_plane = np.hypot(s_x, cos_i * s_y)
    return GroovePlane(
        cos_incidence=cos_i,
        cos_exit=cos_r,
        rho=rho,
        half_sum=np.arctan2(rho, sum_z),
        half_sum_complement=np.arctan2(sum_z, rho),
        half_difference=half_difference,
        half_difference_complement=np.arctan2(along, np.abs(cross)),
        length=length,
        axial=sin_i * s_y,
        cos_first=cos_i / in_plane,
        sin_first=sin_i * s_x / in_plane,
        cos_lower=np.minimum(cos_i, cos_r) / length,
        incoming=_rotation(cos_i * s_y, s_x),
        outgoing=_rotation(-cos_r * k_r, s_r),
    )


def _rotation(x: FloatArray, y: FloatArray) -> Rotation:
    length = np.hypot(x, y)
    cos, sin = x / length, y / length
    return Rotation(cos2=(cos - sin) * (cos + sin), sin2=2.0 * sin * cos)
