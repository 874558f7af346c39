"""Mueller matrices of elements that turn, analyze, retard and depolarize light, and of Jones matrices."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from model.geometry import FloatArray, Rotation

ComplexArray = NDArray[np.complex128]

UNPOLARIZED: FloatArray = np.array([1.0, 0.0, 0.0, 0.0])
UNPOLARIZED.setflags(write=False)

# S_m = E† PAULI_m E of a field E = (Ex, Ey): hermitian, and tr(PAULI_m PAULI_n) = 2 where m = n, else 0.
PAULI: ComplexArray = np.array([[[1, 0], [0, 1]], [[1, 0], [0, -1]], [[0, 1], [1, 0]], [[0, 1j], [-1j, 0]]])
PAULI.setflags(write=False)

# The antisymmetric symbol with _CROSS[0, 1, 2] = 1.
_CROSS: FloatArray = np.zeros((3, 3, 3))
_CROSS[[0, 1, 2], [1, 2, 0], [2, 0, 1]] = 1.0
_CROSS[[1, 2, 0], [0, 1, 2], [2, 0, 1]] = -1.0


def rotate(stokes: NDArray[np.floating], rotation: Rotation[FloatArray]) -> FloatArray:
    """Stokes vectors (..., 4) referred to axes that are turned by the rotation, counted about the ray."""
    cos2, sin2 = rotation.cos2, rotation.sin2
    s0, s1, s2, s3 = np.moveaxis(stokes, -1, 0)
    return np.stack(np.broadcast_arrays(s0, cos2 * s1 + sin2 * s2, cos2 * s2 - sin2 * s1, s3), axis=-1)


def rotator(rotation: Rotation[FloatArray]) -> FloatArray:
    """Mueller matrices (..., 4, 4) that refer Stokes vectors to axes turned by the rotation, counted about the ray.

    The transpose turns back.
    """
    cos2, sin2 = np.asarray(rotation.cos2), np.asarray(rotation.sin2)
    matrix = np.zeros((*cos2.shape, 4, 4))
    matrix[..., 0, 0] = matrix[..., 3, 3] = 1.0
    matrix[..., 1, 1] = matrix[..., 2, 2] = cos2
    matrix[..., 1, 2], matrix[..., 2, 1] = sin2, -sin2
    return matrix


def jones_to_mueller(jones: ArrayLike) -> FloatArray:
    """Mueller matrices (..., 4, 4) of Jones matrices (..., 2, 2): M_mn = ½ tr(PAULI_m J PAULI_n J†)."""
    j = np.asarray(jones, dtype=np.complex128)
    through = np.einsum("...ab,nbc,...dc->...nad", j, PAULI, j.conj(), optimize=True)
    matrix: FloatArray = np.einsum("mda,...nad->...mn", PAULI, through).real / 2.0
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


def polarizer(angle_rad: ArrayLike, *, ellipticity_rad: ArrayLike = 0.0, leakage: ArrayLike = 0.0) -> FloatArray:
    """Mueller matrices (..., 4, 4) of polarizers that pass one state fully and leak the opposite one.

    Parameters
    ----------
    angle_rad, ellipticity_rad : array_like
        The state that passes: angle from the s-direction, and angle of ellipticity (0 linear, pi/4 clockwise circular).
    leakage : array_like
        Transmittance of the opposite state, 0 to 1: the inverse of the extinction ratio.

    Raises
    ------
    ValueError
        If the leakage is out of its range.
    """
    _require_transmittance("leakage", leakage)
    return homogeneous_element(poincare_axis(angle_rad, ellipticity_rad), 1.0, leakage, 0.0)


def retarder(
    retardance_rad: ArrayLike,
    angle_rad: ArrayLike,
    *,
    ellipticity_rad: ArrayLike = 0.0,
    slow_transmittance: ArrayLike = 1.0,
) -> FloatArray:
    """Mueller matrices (..., 4, 4) of retarders.

    Parameters
    ----------
    retardance_rad : array_like
        Phase by which the slow state comes behind the fast one.
    angle_rad, ellipticity_rad : array_like
        The fast state, as for `polarizer`.
    slow_transmittance : array_like
        Transmittance of the slow state, 0 to 1, beside 1 of the fast one.

    Raises
    ------
    ValueError
        If the transmittance is out of its range.
    """
    _require_transmittance("slow_transmittance", slow_transmittance)
    return homogeneous_element(poincare_axis(angle_rad, ellipticity_rad), 1.0, slow_transmittance, retardance_rad)


def poincare_axis(angle_rad: ArrayLike, ellipticity_rad: ArrayLike) -> FloatArray:
    """Unit vectors (..., 3) of (S1, S2, S3) of fully polarized light."""
    angle, ellipticity = np.broadcast_arrays(
        np.asarray(angle_rad, dtype=np.float64), np.asarray(ellipticity_rad, dtype=np.float64)
    )
    linear = np.cos(2.0 * ellipticity)
    return np.stack([linear * np.cos(2.0 * angle), linear * np.sin(2.0 * angle), np.sin(2.0 * ellipticity)], axis=-1)


def homogeneous_element(
    axis: ArrayLike, transmittance: ArrayLike, opposite_transmittance: ArrayLike, retardance_rad: ArrayLike
) -> FloatArray:
    """Mueller matrices (..., 4, 4) of elements with two opposite eigenstates.

    Parameters
    ----------
    axis : array_like
        Unit vectors (..., 3) of (S1, S2, S3) of the first eigenstate.
    transmittance, opposite_transmittance : array_like
        Of the first eigenstate and of the opposite one.
    retardance_rad : array_like
        Phase by which the opposite eigenstate comes behind the first.
    """
    a = np.asarray(axis, dtype=np.float64)
    passed, opposite, retardance = (
        np.asarray(value, dtype=np.float64)[..., None, None]
        for value in (transmittance, opposite_transmittance, retardance_rad)
    )
    mean, half_difference, geometric = (passed + opposite) / 2.0, (passed - opposite) / 2.0, np.sqrt(passed * opposite)
    along = a[..., :, None] * a[..., None, :]
    # Fields go as exp(-i omega t): falling behind turns the Poincaré sphere clockwise about the axis.
    turned = np.cos(retardance) * (np.eye(3) - along) + np.sin(retardance) * np.einsum("ijk,...k->...ij", _CROSS, a)
    inner = mean * along + geometric * turned
    matrix = np.zeros((*inner.shape[:-2], 4, 4))
    matrix[..., 0, 0] = mean[..., 0, 0]
    matrix[..., 0, 1:] = matrix[..., 1:, 0] = half_difference[..., 0] * a
    matrix[..., 1:, 1:] = inner
    return matrix


def _require_transmittance(name: str, value: ArrayLike) -> None:
    values = np.asarray(value, dtype=np.float64)
    outside = values[~((values >= 0.0) & (values <= 1.0))]
    if outside.size:
        raise ValueError(f"{name} is {outside.flat[0]:g}; allowed is 0 to 1.")
