"""What a chain of reflections off the walls of one groove does to polarization.

Unfolded about the groove's bottom edge the ray is straight and its frame fixed, so that every reflection is the same
symmetric matrix in it, with (a, b) = (-ζ cos B, sin B) the facet's s-direction, B the angle in the (s, n) plane from
the facet's normal to the ray, ζ the ray's component along the groove, and z of `fresnel.Amplitudes`:

    J = z + (a² - b²) σ_z + 2 a b σ_x,      |(a, b)|² = sin² of the local angle of incidence.

At local normal incidence (a, b) vanishes and J = z: no plane of incidence is needed, and none is divided by. The chain
is multiplied as Jones matrices, because where two reflections nearly extinguish the light a product of Mueller
matrices loses twice the digits.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from model.fresnel import amplitudes
from model.geometry import FloatArray
from model.groove_passage import Passage
from model.groove_plane import GroovePlane

# An azimuth of pi in double precision leaves an axial part this small outside the caustic; so small is its effect.
_IN_PLANE = 1e-14

ComplexArray = NDArray[np.complex128]


@dataclass(frozen=True)
class Jones:
    """Jones matrices, each sqrt(scale)·(n0 + n1 σ_z + n2 σ_x + w σ_zσ_x) up to a phase.

    n2 and w are None where all reflections share one plane, which is that of the groove.
    """

    scale: FloatArray
    n0: ComplexArray
    n1: ComplexArray
    n2: ComplexArray | None = None
    w: ComplexArray | None = None

    def first_column(self) -> FloatArray:
        """What becomes of unpolarized light of unit power: Stokes vectors (4, ...)."""
        n0, n1, n2, w = self.n0, self.n1, self.n2, self.w
        column = np.zeros((4, *np.shape(n0)))
        column[0], column[1] = _size2(n0) + _size2(n1), 2.0 * _re(n0, n1)
        if n2 is not None and w is not None:
            column[0] += _size2(n2) + _size2(w)
            column[1] += 2.0 * _re(n2, w)
            column[2] = 2.0 * (_re(n0, n2) - _re(n1, w))
            column[3] = 2.0 * (_im(n1, n2) - _im(n0, w))
        return self.scale * column

    def mueller(self) -> FloatArray:
        """Mueller matrices, shape (4, 4, ...)."""
        n0, n1, n2, w = self.n0, self.n1, self.n2, self.w
        matrix = np.zeros((4, 4, *np.shape(n0)))
        plus, minus, even, odd = _size2(n0) + _size2(n1), _size2(n0) - _size2(n1), 2.0 * _re(n0, n1), 2.0 * _im(n0, n1)
        matrix[0, 0] = matrix[1, 1] = plus
        matrix[0, 1] = matrix[1, 0] = even
        matrix[2, 2] = matrix[3, 3] = minus
        matrix[2, 3], matrix[3, 2] = odd, -odd
        if n2 is not None and w is not None:
            sum_, difference = _size2(n2) + _size2(w), _size2(n2) - _size2(w)
            matrix[0, 0] += sum_
            matrix[1, 1] -= sum_
            matrix[2, 2] += difference
            matrix[3, 3] -= difference
            # Pairs of elements are a sum and a difference of two products.
            for (row, column), first, second in (
                ((0, 1), 0.0, -2.0 * _re(n2, w)),
                ((0, 2), 2.0 * _re(n0, n2), 2.0 * _re(n1, w)),
                ((0, 3), -2.0 * _im(n0, w), -2.0 * _im(n1, n2)),
                ((1, 2), 2.0 * _re(n1, n2), 2.0 * _re(n0, w)),
                ((1, 3), -2.0 * _im(n1, w), -2.0 * _im(n0, n2)),
                ((2, 3), -2.0 * _im(n2, w), 0.0),
            ):
                matrix[row, column] += first + second
                matrix[column, row] += first - second
        return self.scale * matrix


def reflect_in_groove(bounces: int, plane: GroovePlane, passage: Passage, index: complex) -> Jones:
    """Chain of reflections off the walls +α1, -α2, +α1, …, from the groove frame of the incoming ray to the outgoing.

    Computed where the passage is lit, and there only: its arrays have one dimension, the lit pairs of directions.

    Parameters
    ----------
    bounces : int
        Number of reflections.
    plane : GroovePlane
        Where the light comes from and goes to.
    passage : Passage
        Walls and facing.
    index : complex
        n + ik of the walls.
    """
    lit, walls = passage.lit, passage.grooves
    facing, first, second = passage.facing[lit], walls.first[lit], walls.second[lit]
    axial, length, cos_first, sin_first = (
        part[lit] for part in (plane.axial, plane.length, plane.cos_first, plane.sin_first)
    )
    cosine1, cosine2 = 1.0 / np.hypot(1.0, first), 1.0 / np.hypot(1.0, second)
    sine1, sine2 = first * cosine1, second * cosine2
    turn_cos, turn_sin = sine1 * sine2 - cosine1 * cosine2, facing * (sine1 * cosine2 + cosine1 * sine2)
    cos = cos_first * cosine1 + facing * sin_first * sine1
    sin = sin_first * cosine1 - facing * cos_first * sine1
    in_plane = bool(np.all(np.abs(axial) <= _IN_PLANE))

    one = np.ones(np.shape(cos), np.complex128)
    jones = Jones(one.real, one, 0.0 * one) if in_plane else Jones(one.real, one, 0.0 * one, 0.0 * one, 0.0 * one)
    for _ in range(bounces):
        across = axial * cos
        at = amplitudes(length * cos, across**2 + sin**2, index)
        z, v1 = at.z_re + 1j * at.z_im, (across - sin) * (across + sin)
        v2 = None if in_plane else -2.0 * across * sin
        jones = _then(jones, at.scale, z, v1, v2)
        cos, sin = cos * turn_cos - sin * turn_sin, sin * turn_cos + cos * turn_sin
    return jones


def _then(jones: Jones, scale: FloatArray, z: ComplexArray, v1: FloatArray, v2: FloatArray | None) -> Jones:
    n0, n1, n2, w = jones.n0, jones.n1, jones.n2, jones.w
    if n2 is None or w is None or v2 is None:
        return Jones(jones.scale * scale, z * n0 + v1 * n1, z * n1 + v1 * n0)
    return Jones(
        jones.scale * scale,
        z * n0 + v1 * n1 + v2 * n2,
        z * n1 + v1 * n0 - v2 * w,
        z * n2 + v2 * n0 + v1 * w,
        z * w + v1 * n2 - v2 * n1,
    )


def _size2(n: ComplexArray) -> FloatArray:
    size: FloatArray = n.real**2 + n.imag**2
    return size


def _re(a: ComplexArray, b: ComplexArray) -> FloatArray:
    product: FloatArray = a.real * b.real + a.imag * b.imag
    return product


def _im(a: ComplexArray, b: ComplexArray) -> FloatArray:
    product: FloatArray = a.imag * b.real - a.real * b.imag
    return product
