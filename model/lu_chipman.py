"""A Mueller matrix taken apart: light meets a diattenuator, then a retarder, then a depolarizer.

Source: Lu and Chipman, J. Opt. Soc. Am. A 13, 1106 (1996).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from model.geometry import FloatArray
from model.mueller import homogeneous_element

# 1 - D² below which a diattenuator is taken for a perfect polarizer, and singular values that are taken for 0.
_PERFECT = 1e-12
_SINGULAR = 1e-12
_ROUNDING = 1e-9


@dataclass(frozen=True)
class LuChipman:
    """The factors of M = depolarizer · retarder · diattenuator, each (..., 4, 4).

    The diattenuator carries the transmittance M00, the depolarizer a polarizance of its own in its first column.
    """

    diattenuator: FloatArray
    retarder: FloatArray
    depolarizer: FloatArray

    @property
    def diattenuation(self) -> FloatArray:
        """Diattenuation vectors (..., 3) in (S1, S2, S3), of length 0 to 1; 0 where M is 0."""
        return _ratio(self.diattenuator[..., 0, 1:], self.diattenuator[..., 0, :1])

    @property
    def retardance_vector(self) -> FloatArray:
        """Fast state's axis (..., 3) in (S1, S2, S3) times the retardance in radians, 0 to pi; either sign at pi."""
        m = self.retarder[..., 1:, 1:]
        # The antisymmetric part, sin R times the axis, fades at R = pi; there the axis is the eigenvector of the rest.
        odd = m - np.swapaxes(m, -1, -2)
        sine = np.stack([odd[..., 1, 2], odd[..., 2, 0], odd[..., 0, 1]], axis=-1) / 2.0
        length = np.linalg.norm(sine, axis=-1)
        cosine = (np.trace(m, axis1=-2, axis2=-1) - 1.0) / 2.0
        principal = np.linalg.eigh(m + np.swapaxes(m, -1, -2))[1][..., -1]
        against = np.einsum("...i,...i->...", principal, sine) < 0.0
        principal = np.where(against[..., None], -principal, principal)
        axis = np.where(cosine[..., None] > 0.0, _ratio(sine, length[..., None]), principal)
        vector: FloatArray = np.arctan2(length, cosine)[..., None] * axis
        return vector

    @property
    def retardance_rad(self) -> FloatArray:
        """Retardance, 0 to pi."""
        retardance: FloatArray = np.linalg.norm(self.retardance_vector, axis=-1)
        return retardance

    @property
    def depolarization(self) -> FloatArray:
        """Depolarization power 1 - |tr m|/3 of the depolarizer's inner 3x3 block m: 0 none, 1 ideal."""
        power: FloatArray = 1.0 - np.abs(np.trace(self.depolarizer[..., 1:, 1:], axis1=-2, axis2=-1)) / 3.0
        return power


def lu_chipman(mueller: ArrayLike) -> LuChipman:
    """Decompose Mueller matrices.

    Where the factors are not unique, the retarder with the least retardance is chosen. Behind a perfect polarizer the
    retarder turns the polarizer's state towards the one that leaves, and the depolarizer is isotropic. The zero matrix
    is a zero diattenuator, a retarder and a depolarizer that do nothing. Where the inner determinant is negative so are
    the depolarizer's three principal factors, as in the paper.

    Parameters
    ----------
    mueller : array_like
        Physical Mueller matrices (..., 4, 4).

    Returns
    -------
    LuChipman
        Their product is M to rounding; beside a perfect polarizer, 1 - D² below 1e-12, to 1e-6 M00.

    Raises
    ------
    ValueError
        If the diattenuation is above 1, or M00 is negative, or 0 while another element is not.
    """
    matrix = np.asarray(mueller, dtype=np.float64)
    transmittance = matrix[..., 0, 0]
    row = np.linalg.norm(matrix[..., 0, 1:], axis=-1)
    dark = transmittance == 0.0
    impossible = ~(row <= transmittance * (1.0 + _ROUNDING)) | (dark & matrix.any(axis=(-2, -1)))
    if impossible.any():
        first = tuple(np.argwhere(impossible)[0])
        raise ValueError(
            f"A Mueller matrix begins with {matrix[first][0].tolist()}; the first element must be at least as large "
            f"as the length of the other three, and all be 0 where it is 0: no element has another matrix."
        )
    normalized = np.where(dark[..., None, None], np.eye(4), _ratio(matrix, transmittance[..., None, None]))
    diattenuation = np.minimum(_ratio(row, transmittance), 1.0)
    axis = _direction(normalized[..., 0, 1:], np.array([1.0, 0.0, 0.0]))
    diattenuator = homogeneous_element(
        axis, transmittance * (1.0 + diattenuation), transmittance * (1.0 - diattenuation), 0.0
    )

    perfect = (1.0 - diattenuation) * (1.0 + diattenuation) < _PERFECT
    d = np.where(perfect, 0.0, diattenuation)
    rest = normalized @ homogeneous_element(axis, 1.0 / (1.0 + d), 1.0 / (1.0 - d), 0.0)
    rotation, shrinking = _polar(rest[..., 1:, 1:])

    leaving = normalized[..., 1:, 0]
    isotropic = np.linalg.norm(leaving, axis=-1)[..., None, None] * np.eye(3)
    retarder, depolarizer = (np.broadcast_to(np.eye(4), matrix.shape).copy() for _ in range(2))
    at_polarizer = perfect[..., None, None]
    retarder[..., 1:, 1:] = np.where(at_polarizer, _least_rotation(axis, _direction(leaving, axis)), rotation)
    depolarizer[..., 1:, 1:] = np.where(at_polarizer, isotropic, shrinking)
    depolarizer[..., 1:, 0] = np.where(perfect[..., None], 0.0, rest[..., 1:, 0])
    return LuChipman(diattenuator, retarder, depolarizer)


def _polar(matrix: FloatArray) -> tuple[FloatArray, FloatArray]:
    """A rotation and a symmetric matrix whose product, symmetric · rotation, is the matrix (..., 3, 3)."""
    u, singular, vt = np.linalg.svd(matrix)
    handed = np.where(np.linalg.det(u @ vt) < 0.0, -1.0, 1.0)
    # Signs that make the product a rotation: all three, or only that of a direction that no light is left in.
    others = np.where(singular[..., 2] <= _SINGULAR, 1.0, handed)
    signs = np.stack([others, others, handed], axis=-1)
    rotation = (u * signs[..., None, :]) @ vt
    only_one = singular[..., 1] <= _SINGULAR
    rotation = np.where(only_one[..., None, None], _least_rotation(vt[..., 0, :], u[..., :, 0]), rotation)
    nothing = singular[..., 0] <= _SINGULAR
    rotation = np.where(nothing[..., None, None], np.eye(3), rotation)
    return rotation, (u * (signs * singular)[..., None, :]) @ np.swapaxes(u, -1, -2)


def _least_rotation(start: FloatArray, end: FloatArray) -> FloatArray:
    """The smallest rotation (..., 3, 3) that takes one unit vector to another, as two mirrors."""
    across = np.cross(end, np.eye(3)[np.argmin(np.abs(end), axis=-1)])
    between = _direction(start + end, across / np.linalg.norm(across, axis=-1, keepdims=True))
    rotation: FloatArray = _mirror(end) @ _mirror(between)
    return rotation


def _mirror(normal: FloatArray) -> FloatArray:
    mirror: FloatArray = np.eye(3) - 2.0 * normal[..., :, None] * normal[..., None, :]
    return mirror


def _direction(vectors: FloatArray, where_zero: FloatArray) -> FloatArray:
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.where(length > _SINGULAR, _ratio(vectors, length), where_zero)


def _ratio(part: FloatArray, whole: FloatArray) -> FloatArray:
    """Their quotient, 0 where the whole is 0."""
    part, whole = np.broadcast_arrays(part, whole)
    ratio: FloatArray = np.divide(part, whole, out=np.zeros(part.shape), where=whole != 0.0)
    return ratio
