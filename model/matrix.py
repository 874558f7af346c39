"""Mueller matrices as sixteen expressions: what an element does not hold is the number 0 and costs nothing."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from model.geometry import Rotation
from model.kernel.expression import Value

Vector = tuple[Value, Value, Value, Value]
Matrix = tuple[Vector, Vector, Vector, Vector]

ZERO: Matrix = ((0.0,) * 4,) * 4
DEPOLARIZER: Matrix = ((1.0, 0.0, 0.0, 0.0), (0.0,) * 4, (0.0,) * 4, (0.0,) * 4)


def scaled(matrix: Matrix, factor: Value) -> Matrix:
    """The matrix times a number."""
    return mapped(matrix, lambda element: factor * element)


def mapped(matrix: Matrix, function: Callable[[Value], Value]) -> Matrix:
    """A function of every element."""
    return _matrix([function(element) for element in row] for row in matrix)


def total(matrices: Iterable[Matrix]) -> Matrix:
    """Sum of matrices."""
    result = ZERO
    for matrix in matrices:
        result = _matrix(
            [a + b for a, b in zip(first, second, strict=True)] for first, second in zip(result, matrix, strict=True)
        )
    return result


def between_frames(matrix: Matrix, incoming: Rotation[Value], outgoing: Rotation[Value]) -> Matrix:
    """The matrix of an element in frames of its own, referred to the macro frames of both rays.

    Parameters
    ----------
    matrix : Matrix
        From the element's own frame of the incoming to that of the outgoing ray.
    incoming, outgoing : Rotation
        From the macro frames of the two rays to those of the element.
    """
    cos2, sin2 = incoming.cos2, incoming.sin2
    rows = [(m0, cos2 * m1 - sin2 * m2, sin2 * m1 + cos2 * m2, m3) for m0, m1, m2, m3 in matrix]
    cos2, sin2 = outgoing.cos2, outgoing.sin2
    first, second = rows[1], rows[2]
    return _matrix(
        [
            rows[0],
            [cos2 * a - sin2 * b for a, b in zip(first, second, strict=True)],
            [sin2 * a + cos2 * b for a, b in zip(first, second, strict=True)],
            rows[3],
        ]
    )


def applied(matrix: Matrix, stokes: Vector) -> Vector:
    """What the matrix makes of a Stokes vector."""
    s0, s1, s2, s3 = stokes
    i, q, u, v = (m0 * s0 + m1 * s1 + m2 * s2 + m3 * s3 for m0, m1, m2, m3 in matrix)
    return i, q, u, v


def _matrix(rows: Iterable[Iterable[Value]]) -> Matrix:
    first, second, third, fourth = ((a, b, c, d) for a, b, c, d in rows)
    return first, second, third, fourth
