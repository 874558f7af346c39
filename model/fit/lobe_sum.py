"""The sum of some lobes of a family with its derivatives: one compiled program, and what that takes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache, cached_property

import numpy as np
from numpy.typing import NDArray

from model.evaluation import DIRECTIONS, Light, Program
from model.fit.family import SurfaceFamily
from model.fit.instrument import ANGLES
from model.fit.wiring import Wiring, named
from model.geometry import FloatArray
from model.kernel.kernel import Kernel
from model.lobes import Lobe
from model.surface import rate_input


class LobeSum:
    """Light of some lobes of a family, and its derivatives: the program of it, and what that takes.

    Parameters
    ----------
    family : SurfaceFamily
        What is free.
    lobes : sequence of Lobe
        Some of the family's.
    light : Light
        What to make of the sum.
    varied : tuple of str
        Free parameters of the surface to derive by.
    angles : tuple of str
        Offsets of angles to derive by, after those.
    one_incidence : bool
        Whether all directions of a problem have the same incidence.
    """

    def __init__(
        self,
        family: SurfaceFamily,
        lobes: Sequence[Lobe],
        light: Light,
        varied: tuple[str, ...],
        angles: tuple[str, ...],
        one_incidence: bool,
    ) -> None:
        self.varied = varied
        self._wiring = Wiring(
            family, [i for i, known in enumerate(family.lobes) if any(known is lobe for lobe in lobes)]
        )
        example = {name: 0.5 * (low + min(high, low + 1.0)) for name, (low, high) in family.free.items()}
        numbers, rates = self._wiring.inputs({name: np.array([value]) for name, value in example.items()})
        changes = tuple(
            tuple((source, rate_input(source, name, rate)) for (source, by), rate in rates.items() if by == name)
            for name in varied
        )
        changes += tuple(((ANGLES[name], 1.0),) for name in angles)
        inputs = (*numbers, *named(rates))
        addends = tuple(self._wiring.addends(family.surface_of(example)))
        self.program = Program(addends, inputs, light, changes, with_light=True)
        self._one_incidence = one_incidence

    @property
    def uniform(self) -> frozenset[str]:
        """Inputs that are one number for all directions of a problem."""
        return frozenset(self.program.inputs) | frozenset(["incidence"] if self._one_incidence else [])

    def inputs(self, values: Mapping[str, FloatArray], at: Sequence[FloatArray]) -> list[NDArray[np.float64]]:
        """What the program takes for these values (b,) of the free parameters and directions (b or 1, N), in order."""
        numbers, rates = self._wiring.inputs(values)
        given = {**numbers, **named(rates)}
        incidence = at[0][:, :1] if self._one_incidence else at[0]
        return [
            incidence,
            *at[1:],
            *(np.asarray(given[name], np.float64).reshape(-1, 1) for name in self.program.inputs),
        ]

    def __call__(
        self, values: Mapping[str, FloatArray], at: Sequence[FloatArray], times: int, elements: int
    ) -> tuple[FloatArray, FloatArray]:
        """Light (times, elements, N) and derivatives (times, names, elements, N)."""
        rows = self._kernel.repeated(self.inputs(values, at), times, at[1].shape[1])
        split = np.asarray(rows, np.float64).reshape(times, -1, elements, rows.shape[-1])
        return split[:, 0], split[:, 1:]

    @cached_property
    def _kernel(self) -> Kernel:
        return _compiled(self.program, self.uniform)


@cache
def _compiled(program: Program, uniform: frozenset[str]) -> Kernel:
    return Kernel(program.record, [*DIRECTIONS, *program.inputs], uniform, "float64")
