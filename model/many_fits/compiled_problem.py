"""Least-squares problems whose normal equations come out of one compiled call, without the Jacobian."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from model.evaluation import DIRECTIONS, Light, Program
from model.fit.family import SurfaceFamily
from model.fit.lobe_sum import LobeSum
from model.fit.observable import MUELLER, Elements
from model.fit.problem import NormalEquations, Places, Problem
from model.fit.quantities import INSTRUMENT
from model.geometry import FloatArray
from model.kernel.expression import Symbol, Value
from model.kernel.kernel import Kernel

# What so many put out fits the caches, and is not worth a second thread of the kernel's own.
_DIRECTIONS_AT_ONCE = 15_000


class CompiledProblem(Problem):
    """Many fits of elements of the light, seen in single directions by a perfect instrument.

    Parameters
    ----------
    family, directions, values, whitener
        As for `Problem`.
    observable : Elements
        What was measured.
    """

    def __init__(
        self,
        family: SurfaceFamily,
        observable: Elements,
        directions: tuple[FloatArray, FloatArray, FloatArray],
        values: FloatArray,
        whitener: FloatArray,
    ) -> None:
        super().__init__(family, observable, directions, values, whitener)
        self._directions = [np.atleast_2d(angle) for angle in directions]
        light: Light = "mueller" if observable.elements == MUELLER else "unpolarized"
        one_incidence = bool((np.ptp(self._directions[0], axis=1) == 0.0).all())
        self._sum = LobeSum(family, family.lobes, light, family.names, (), one_incidence)
        width = values.shape[1]
        whitening = tuple((i, j) for i in range(width) for j in range(i + 1) if whitener[:, i, j].any())
        self._sums = _Sums(self._sum.program, observable.elements, observable.picked, whitening)
        self._kernel = _compiled(self._sums, self._sum.uniform)
        self._measured = [np.ascontiguousarray(values[:, i]) for i in range(width)]
        self._measured += [np.ascontiguousarray(whitener[:, i, j]) for i, j in whitening]
        self._ones = np.ones(values.shape[2])

    @staticmethod
    def is_possible(family: SurfaceFamily) -> bool:
        """Whether the family's surfaces are seen so."""
        perfect = not any(name in INSTRUMENT for name in (*family.names, *family.fixed))
        return perfect and family.detector_half_angle_rad == 0.0

    def normal_equations(self, x: FloatArray, which: Places) -> NormalEquations:
        """The normal equations; see `Problem.normal_equations`."""
        size = max(1, _DIRECTIONS_AT_ONCE // len(self._ones))
        sums = np.concatenate(
            [self._summed(x[at : at + size], which[at : at + size]) for at in range(0, max(len(x), 1), size)]
        )
        count = x.shape[1]
        cost, gradient, normal = sums[:, 0], sums[:, 1 : 1 + count], sums[:, 1 + count :][:, _places(count)]
        if self._known:
            off, stddev = self._off_priors(x, which), self._prior_stddev
            cost = cost + (off * off).sum(axis=1)
            gradient[:, self._known] += off / stddev
            normal[:, self._known, self._known] += stddev**-2
        return NormalEquations(cost, gradient, normal)

    def _summed(self, x: FloatArray, which: Places) -> FloatArray:
        values = dict(zip(self.family.names, x.T, strict=True))
        # As long as all of them move, nothing needs to be copied.
        neighbours = len(which) > 0 and bool((np.diff(which) == 1).all())
        some = slice(which[0], which[-1] + 1) if neighbours else which
        shared_or_own = [array if len(array) == 1 else array[some] for array in (*self._directions, *self._measured)]
        inputs = self._sum.inputs(values, shared_or_own[:3])
        arrays = [*inputs[:3], *shared_or_own[3:], *inputs[3:]]
        summed: FloatArray = self._kernel.repeated(arrays, len(x), len(self._ones)) @ self._ones
        return summed


@dataclass(frozen=True)
class _Sums:
    """The formula of what each direction adds: to the cost, the gradient, and the upper triangle of the normal matrix.

    Attributes
    ----------
    program : Program
        Light and its derivatives.
    elements : int
        How many elements light has.
    picked : tuple of int
        Which of them were measured.
    whitening : tuple of (int, int)
        Which entries of the whitening matrices are not 0 everywhere.
    """

    program: Program
    elements: int
    picked: tuple[int, ...]
    whitening: tuple[tuple[int, int], ...]

    @property
    def inputs(self) -> tuple[str, ...]:
        measured = [f"value {i}" for i in range(len(self.picked))]
        return (*DIRECTIONS, *measured, *(f"whitener {i} {j}" for i, j in self.whitening), *self.program.inputs)

    def record(self, symbols: Mapping[str, Symbol]) -> list[Value]:
        rows = self.program.record(symbols)
        light, *slopes = [
            [rows[start + element] for element in self.picked] for start in range(0, len(rows), self.elements)
        ]
        left = self._whitened([value - symbols[f"value {i}"] for i, value in enumerate(light)], symbols)
        jacobian = [self._whitened(slope, symbols) for slope in slopes]
        gradient = [_product(row, left) for row in jacobian]
        normal = [_product(row, other) for place, row in enumerate(jacobian) for other in jacobian[place:]]
        return [_product(left, left), *gradient, *normal]

    def _whitened(self, values: Sequence[Value], symbols: Mapping[str, Symbol]) -> list[Value]:
        whitened: list[Value] = [0.0] * len(values)
        for i, j in self.whitening:
            whitened[i] = whitened[i] + symbols[f"whitener {i} {j}"] * values[j]
        return whitened


@cache
def _compiled(sums: _Sums, uniform: frozenset[str]) -> Kernel:
    return Kernel(sums.record, sums.inputs, uniform, "float64")


@cache
def _places(count: int) -> Places:
    """Where in the upper triangle, row by row, each entry (count, count) of a symmetric matrix stands."""
    row, column = np.indices((count, count))
    low, high = np.minimum(row, column), np.maximum(row, column)
    places: Places = low * count - low * (low - 1) // 2 + (high - low)
    return places


def _product(one: Sequence[Value], other: Sequence[Value]) -> Value:
    total: Value = 0.0
    for a, b in zip(one, other, strict=True):
        total = total + a * b
    return total
