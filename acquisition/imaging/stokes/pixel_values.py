"""What can be asked of a pixel: Stokes parameters, what is made of them, and how well all that is known.

Everything is to first order in the errors of the light behind the analyzer's states, which are independent of each
other: a value's variance is the sum, over states, of the squares of its slopes times their variances. Light that is
not polarized at all has DoLP 0, whose slopes there are none of: its variance is NaN, and so is all of AoLP.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from goniometer.errors import ReductionError
from model.kernel.expression import Symbol, Value, atan2, fma, sqrt, where


def outputs_of(stokes: int) -> tuple[str, ...]:
    """The names of all that can be asked where 3 or 4 Stokes parameters are known, in an order of their own."""
    names = [f"S{place}" for place in range(stokes)]
    pairs = [f"{one}_{other}_covariance" for at, one in enumerate(names) for other in names[at + 1 :]]
    alone = [*names, "DoLP", "AoLP_rad"]
    return (*alone, *(f"{name}_variance" for name in alone), *pairs)


def check_outputs(inverse: NDArray[np.float64], outputs: Sequence[str]) -> None:
    """Refuse what cannot be asked.

    Raises
    ------
    ReductionError
        When an output is none of `outputs_of`.
    """
    there = outputs_of(len(inverse))
    if unknown := [name for name in outputs if name not in there]:
        raise ReductionError(
            f"{', '.join(unknown)} cannot be computed of a pixel with {len(inverse)} Stokes parameters. There are "
            f"{', '.join(there)}"
        )


def needs_variances(outputs: Sequence[str]) -> bool:
    """Whether any output is about errors."""
    return any(name.endswith("variance") for name in outputs)


def weights_of(inverse: NDArray[np.float64]) -> dict[str, float]:
    """The elements of an inverse by name: the same formula serves every analyzer of so many states."""
    return {f"inverse{row}_{column}": float(weight) for (row, column), weight in np.ndenumerate(inverse)}


class PixelValues:
    """All values of one pixel; each is computed if it is asked for.

    Parameters
    ----------
    inverse : ndarray
        (3 or 4, N): only its shape is read; its elements come as symbols.
    at : mapping of str to Symbol
        Those, by the names of `weights_of`.
    signals, variances : sequence of Value
        Light behind each of the N states, and its variance; their squares within the range of single precision. No
        variances where none are asked.
    """

    def __init__(
        self,
        inverse: NDArray[np.float64],
        at: Mapping[str, Symbol],
        signals: Sequence[Value],
        variances: Sequence[Value],
    ) -> None:
        rows, columns = inverse.shape
        self._inverse = [[at[f"inverse{row}_{column}"] for column in range(columns)] for row in range(rows)]
        self._variances = variances
        self._stokes = [_dot(row, signals) for row in self._inverse]

    def value(self, name: str) -> Value:
        """One of `outputs_of`."""
        *of, last = name.removesuffix("_rad").replace("_rad_", "_").split("_")
        match of, last:
            case [], "DoLP":
                return self._linear * self._per_s0
            case [], "AoLP":
                return _half_angle(self._stokes[2], self._stokes[1])
            case [], stokes:
                return self._stokes[int(stokes[1:])]
            case ["DoLP"], "variance":
                return self._spread(self._dolp_slopes, self._dolp_slopes) * (self._per_s0 * self._per_s0)
            case ["AoLP"], "variance":
                return self._spread(self._aolp_slopes, self._aolp_slopes)
            case _:
                one, other = (self._inverse[int(stokes[1:])] for stokes in (of[0], of[-1]))
                return self._spread(one, other)

    def _spread(self, one: Sequence[Value], other: Sequence[Value]) -> Value:
        return _dot([a * b for a, b in zip(one, other, strict=True)], self._variances)

    @cached_property
    def _square(self) -> Value:
        return _dot(self._stokes[1:3], self._stokes[1:3])

    @cached_property
    def _linear(self) -> Value:
        return sqrt(self._square)

    # Divisions are what costs: one each, shared.

    @cached_property
    def _per_s0(self) -> Value:
        return 1.0 / self._stokes[0]

    @cached_property
    def _per_square(self) -> Value:
        return 1.0 / self._square

    @property
    def _dolp_slopes(self) -> list[Value]:
        """Times S0: by how much DoLP grows with the light behind each state."""
        per_linear = self._linear * self._per_square
        share = -(self._linear * self._per_s0)
        slopes = share, self._stokes[1] * per_linear, self._stokes[2] * per_linear
        return [_dot(of_state, slopes) for of_state in zip(*self._inverse[:3], strict=True)]

    @property
    def _aolp_slopes(self) -> list[Value]:
        """By how much AoLP grows with the light behind each state."""
        half = 0.5 * self._per_square
        slopes = -self._stokes[2] * half, self._stokes[1] * half
        return [_dot(of_state, slopes) for of_state in zip(*self._inverse[1:3], strict=True)]


def _half_angle(s2: Value, s1: Value) -> Value:
    """½ atan2(s2, s1), in [-pi/2, pi/2]; to 2e-7."""
    half = 0.5 * atan2(s2, abs(s1))
    return where(s1 < 0.0, where(s2 < 0.0, -0.5 * math.pi, 0.5 * math.pi) - half, half)


def _dot(one: Sequence[Value], other: Sequence[Value]) -> Value:
    (a, b), *further = zip(one, other, strict=True)
    total = a * b
    for a, b in further:
        total = fma(a, b, total)
    return total
