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

from model.fresnel import amplitudes
from model.groove_passage import Passage
from model.groove_plane import GroovePlane
from model.kernel.expression import Value, sqrt
from model.matrix import Matrix

Complex = tuple[Value, Value]


@dataclass(frozen=True)
class Jones:
    """A Jones matrix, sqrt(scale)·(n0 + n1 σ_z + n2 σ_x + w σ_zσ_x) up to a phase; components as (real, imaginary)."""

    scale: Value
    n0: Complex
    n1: Complex
    n2: Complex
    w: Complex

    def mueller(self) -> Matrix:
        """The Mueller matrix."""
        n0, n1, n2, w, s = self.n0, self.n1, self.n2, self.w, self.scale
        size0, size1, size2, size3 = (_re(component, component) for component in (n0, n1, n2, w))
        twice = 2.0 * s
        m01, m10 = _sum_and_difference(twice, _re(n0, n1), -_re(n2, w))
        m02, m20 = _sum_and_difference(twice, _re(n0, n2), _re(n1, w))
        m03, m30 = _sum_and_difference(-twice, _im(n0, w), _im(n1, n2))
        m12, m21 = _sum_and_difference(twice, _re(n1, n2), _re(n0, w))
        m13, m31 = _sum_and_difference(-twice, _im(n1, w), _im(n0, n2))
        m23, m32 = _sum_and_difference(twice, -_im(n2, w), _im(n0, n1))
        plus, minus = size0 + size1, size0 - size1
        sum_, difference = size2 + size3, size2 - size3
        return (
            (s * (plus + sum_), m01, m02, m03),
            (m10, s * (plus - sum_), m12, m13),
            (m20, m21, s * (minus + difference), m23),
            (m30, m31, m32, s * (minus - difference)),
        )


def reflect_in_groove(bounces: int, plane: GroovePlane, passage: Passage, n: Value, k: Value) -> Jones:
    """Chain of reflections off the walls +α1, -α2, +α1, …, from the groove frame of the incoming ray to the outgoing.

    Parameters
    ----------
    bounces : int
        Number of reflections.
    plane : GroovePlane
        Where the light comes from and goes to.
    passage : Passage
        Walls and facing.
    n, k : Value
        Refractive index n + ik of the walls.
    """
    walls, facing = passage.grooves, passage.facing
    cosine1 = 1.0 / sqrt(1.0 + walls.first * walls.first)
    cosine2 = 1.0 / sqrt(1.0 + walls.second * walls.second)
    sine1, sine2 = walls.first * cosine1, walls.second * cosine2
    turn_cos, turn_sin = sine1 * sine2 - cosine1 * cosine2, facing * (sine1 * cosine2 + cosine1 * sine2)
    cos = plane.cos_first * cosine1 + facing * plane.sin_first * sine1
    sin = plane.sin_first * cosine1 - facing * plane.cos_first * sine1

    jones = Jones(1.0, (1.0, 0.0), (0.0, 0.0), (0.0, 0.0), (0.0, 0.0))
    for _ in range(bounces):
        across = plane.axial * cos
        at = amplitudes(plane.length * cos, across * across + sin * sin, n, k)
        v1, v2 = (across - sin) * (across + sin) * at.unit, -2.0 * across * sin * at.unit
        jones = _then(jones, at.scale, (at.z_re, at.z_im), v1, v2)
        cos, sin = cos * turn_cos - sin * turn_sin, sin * turn_cos + cos * turn_sin
    return jones


def _then(jones: Jones, scale: Value, z: Complex, v1: Value, v2: Value) -> Jones:
    n0, n1, n2, w = jones.n0, jones.n1, jones.n2, jones.w
    return Jones(
        jones.scale * scale,
        _sum(_product(z, n0), _times(v1, n1), _times(v2, n2)),
        _sum(_product(z, n1), _times(v1, n0), _times(-v2, w)),
        _sum(_product(z, n2), _times(v2, n0), _times(v1, w)),
        _sum(_product(z, w), _times(v1, n2), _times(-v2, n1)),
    )


def _sum(a: Complex, b: Complex, c: Complex) -> Complex:
    return a[0] + b[0] + c[0], a[1] + b[1] + c[1]


def _product(a: Complex, b: Complex) -> Complex:
    return a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]


def _times(factor: Value, a: Complex) -> Complex:
    return factor * a[0], factor * a[1]


def _re(a: Complex, b: Complex) -> Value:
    return a[0] * b[0] + a[1] * b[1]


def _im(a: Complex, b: Complex) -> Value:
    return a[1] * b[0] - a[0] * b[1]


def _sum_and_difference(factor: Value, a: Value, b: Value) -> tuple[Value, Value]:
    return factor * (a + b), factor * (a - b)
