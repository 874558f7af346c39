"""Evaluate a sum of forms of light for arrays of directions, by a kernel that holds these forms and nothing else."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from model.domain import require_polar, within_a_few_turns
from model.geometry import Angles, FloatArray, angles
from model.kernel.derivative import derivatives
from model.kernel.elementary import Precision
from model.kernel.expression import Symbol, Value, both, where
from model.kernel.kernel import Kernel
from model.matrix import Matrix, applied, total

# What is asked for: all of the Mueller matrix, its product with a Stokes vector, or with that of unpolarized light.
Light = Literal["mueller", "stokes", "unpolarized"]
DIRECTIONS = ("incidence", "exit", "azimuth")
_STATE = ("s0", "s1", "s2", "s3")


class Form(NamedTuple):
    """How one addend of a surface's reflectance follows from directions and numbers.

    Attributes
    ----------
    function : callable
        From angles, numbers by name, and the options to a Mueller matrix in 1/sr.
    options : tuple
        What decides which operations there are; numbers that only enter them are not options.
    """

    function: Callable[..., Matrix]
    options: tuple[object, ...] = ()


class Addend(NamedTuple):
    """A form and the inputs, by the names it knows them under, that its numbers come from."""

    form: Form
    wiring: tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Program:
    """What a kernel computes.

    Attributes
    ----------
    addends : tuple of Addend
        What to sum.
    inputs : tuple of str
        Numbers that the addends take.
    light : Light
        What to make of the sum.
    changes : tuple of tuple of (str, str or float)
        For each derivative wanted, the inputs that change, each with how fast it does: a number, or the input that
        holds it. If no derivative is, the light itself is computed.
    with_light : bool
        Whether the light comes before its derivatives.
    """

    addends: tuple[Addend, ...]
    inputs: tuple[str, ...]
    light: Light
    changes: tuple[tuple[tuple[str, str | float], ...], ...] = ()
    with_light: bool = False

    def record(self, symbols: Mapping[str, Symbol]) -> list[Value]:
        """The outputs, made of the inputs' symbols."""
        incidence, exit_, azimuth = (symbols[name] for name in DIRECTIONS)
        outputs = light = list(self._light(angles(incidence, exit_, azimuth), symbols))
        if self.changes:
            seeds = [
                {name: symbols[rate] if isinstance(rate, str) else rate for name, rate in changing}
                for changing in self.changes
            ]
            slopes = [slope for seed in seeds for slope in derivatives(light, seed)]
            outputs = [*light, *slopes] if self.with_light else slopes
        above = both(incidence < math.pi / 2.0, exit_ < math.pi / 2.0)
        return [where(above, output, 0.0) for output in outputs]

    def _light(self, at: Angles, symbols: Mapping[str, Symbol]) -> Iterator[Value]:
        matrix = total(
            form.function(at, {name: symbols[source] for name, source in wiring}, *form.options)
            for form, wiring in self.addends
        )
        if self.light == "mueller":
            for row in matrix:
                yield from row
        elif self.light == "stokes":
            s0, s1, s2, s3 = (symbols[name] for name in _STATE)
            is_finite = matrix[0][0] < math.inf
            yield from (where(is_finite, element, math.inf) for element in applied(matrix, (s0, s1, s2, s3)))
        else:
            yield from (row[0] for row in matrix)


def evaluate(
    program: Program,
    numbers: Mapping[str, float],
    incidence_rad: ArrayLike,
    exit_rad: ArrayLike,
    azimuth_rad: ArrayLike,
    incoming: FloatArray | None = None,
) -> NDArray[np.floating]:
    """Run a program.

    Parameters
    ----------
    program : Program
        What to compute.
    numbers : mapping of str to float
        The program's inputs.
    incidence_rad, exit_rad, azimuth_rad : array_like
        Directions, which broadcast. If those that are arrays are all of single precision, so is the computation.
    incoming : ndarray, optional
        Stokes vectors (..., 4) where the program takes them.

    Returns
    -------
    ndarray
        Shape (outputs, ...).

    Raises
    ------
    ValueError
        If an angle is outside its range.
    """
    require_polar(incidence_rad, exit_rad)
    precision = _precision(incidence_rad, exit_rad, azimuth_rad)
    streams = [np.asarray(angle, precision) for angle in (incidence_rad, exit_rad, azimuth_rad)]
    streams[2] = within_a_few_turns(streams[2])
    names = list(DIRECTIONS)
    if incoming is not None:
        streams += list(np.moveaxis(np.asarray(incoming, precision), -1, 0))
        names += _STATE
    shape = np.broadcast_shapes(*(stream.shape for stream in streams))
    # One incidence for many exits is what a scan has.
    fixed = frozenset(["incidence"] if streams[0].size == 1 else [])
    arrays = [
        stream.reshape(1) if name in fixed else np.broadcast_to(stream, shape).reshape(-1)
        for name, stream in zip(names, streams, strict=True)
    ]
    arrays += [_rounded(numbers[name], precision) for name in program.inputs]
    kernel = _kernel(program, tuple(names), fixed, precision)
    rows = kernel(arrays, math.prod(shape))
    return rows.reshape(len(rows), *shape)


@cache
def _kernel(program: Program, names: tuple[str, ...], fixed: frozenset[str], precision: Precision) -> Kernel:
    return Kernel(program.record, [*names, *program.inputs], fixed | frozenset(program.inputs), precision)


def _precision(*values: ArrayLike) -> Precision:
    # As in NumPy a number beside an array takes the array's precision.
    given = [value for value in values if isinstance(value, np.ndarray | np.generic)]
    kinds = [value.dtype for value in given if value.ndim] or [value.dtype for value in given]
    return "float32" if kinds and all(kind == np.float32 for kind in kinds) else "float64"


def _rounded(number: float, precision: Precision) -> NDArray[np.floating]:
    rounded = np.array([number], precision)
    # An asymmetry below 1 must stay below it.
    return np.nextafter(rounded, rounded.dtype.type(0.0)) if number < 1.0 <= rounded[0] else rounded
