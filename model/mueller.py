"""Mueller matrices of elements that turn, depolarize and analyze light, and the ratios read off a Stokes vector."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from model.geometry import FloatArray, Rotation

UNPOLARIZED: FloatArray = np.array([1.0, 0.0, 0.0, 0.0])
UNPOLARIZED.setflags(write=False)


def rotate(stokes: FloatArray, rotation: Rotation) -> FloatArray:
    """Stokes vectors (..., 4) referred to axes that are turned by the rotation, counted about the ray."""
    cos2, sin2 = rotation.cos2, rotation.sin2
    s0, s1, s2, s3 = np.moveaxis(stokes, -1, 0)
    return np.stack(np.broadcast_arrays(s0, cos2 * s1 + sin2 * s2, cos2 * s2 - sin2 * s1, s3), axis=-1)


def rotator(rotation: Rotation) -> FloatArray:
    """Mueller matrices (..., 4, 4) that refer Stokes vectors to axes turned by the rotation, counted about the ray.

    The transpose turns back.
    """
    matrix = np.zeros((*np.shape(rotation.cos2), 4, 4))
    matrix[..., 0, 0] = matrix[..., 3, 3] = 1.0
    matrix[..., 1, 1] = matrix[..., 2, 2] = rotation.cos2
    matrix[..., 1, 2], matrix[..., 2, 1] = rotation.sin2, -rotation.sin2
    return matrix


def depolarizer() -> FloatArray:
    """Mueller matrix of the ideal depolarizer, diag(1, 0, 0, 0), eq. (9) of Hao et al. 2023."""
    return np.diag(UNPOLARIZED)


def polarizer_row(angle_rad: ArrayLike) -> FloatArray:
    """First row (..., 4) of an ideal linear polarizer: its product with a Stokes vector is what passes.

    Parameters
    ----------
    angle_rad : array_like
        Angle psi of the transmission axis from the s-direction: ½ [1, cos 2psi, sin 2psi, 0].
    """
    angle = np.asarray(angle_rad, dtype=np.float64)
    one = np.ones_like(angle)
    return 0.5 * np.stack([one, np.cos(2.0 * angle), np.sin(2.0 * angle), 0.0 * one], axis=-1)


def dolp(stokes: ArrayLike) -> FloatArray:
    """Degree of linear polarization sqrt(S1² + S2²)/S0 of Stokes vectors (..., 3 or 4); nan where S0 is 0.

    Computed from the summed Stokes vector: the square printed in eq. (13) of Hao et al. 2023 loses a cross term.
    """
    s = np.asarray(stokes, dtype=np.float64)
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio: FloatArray = np.hypot(s[..., 1], s[..., 2]) / s[..., 0]
    return ratio


def aolp(stokes: ArrayLike) -> FloatArray:
    """Angle of linear polarization ½ atan2(S2, S1) in (-pi/2, pi/2], counted from the s-direction x towards y."""
    s = np.asarray(stokes, dtype=np.float64)
    angle = np.arctan2(s[..., 2], s[..., 1]) / 2.0
    # p-polarized light is at +pi/2, also when its S2 is a rounding error below zero.
    return np.where(angle <= -np.pi / 2.0, np.pi / 2.0, angle)
