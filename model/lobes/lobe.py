"""What a surface asks of its lobes."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Literal, Self

import numpy as np

from model.evaluation import Form

Peak = Literal["mirror", "normal"]


class Lobe(ABC):
    """One addend of a surface's polarimetric reflectance."""

    @property
    @abstractmethod
    def values(self) -> Mapping[str, float]:
        """The parameters that a fit may vary, by name."""

    @abstractmethod
    def with_values(self, values: Mapping[str, float]) -> Self:
        """The same lobe with these values of all its parameters."""

    @abstractmethod
    def form(self, varied: frozenset[str]) -> Form:
        """How the lobe follows from its numbers; an effect that its numbers switch off is in it only if varied."""

    @abstractmethod
    def describe(self) -> str:
        """What the lobe is, and what it leaves out, for a person."""

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the parameters that a fit may vary."""
        return tuple(self.values)

    @property
    def numbers(self) -> Mapping[str, float]:
        """What the form computes with, by name."""
        return self.numbers_of(self.values)

    def numbers_of(self, values: Mapping[str, float]) -> Mapping[str, float]:
        """What the form computes with for these values of the parameters; arrays stand for many lobes at once."""
        return values

    def rates(self, parameter: str, values: Mapping[str, float]) -> Mapping[str, float]:
        """How fast each of the numbers changes with a parameter where they have these values; others stay."""
        return {parameter: 1.0} if parameter in values else {}

    @property
    def has_caustic(self) -> bool:
        """Whether the lobe is infinite in the mirror direction itself."""
        return False

    @property
    def peak(self) -> Peak:
        """About which direction the lobe stands, if it is narrow."""
        return "mirror"

    @property
    def width_rad(self) -> float:
        """Angle from its peak within which the lobe changes."""
        return np.inf


def require_weight(name: str, weight: float) -> None:
    """Raise ValueError unless a lobe can have this weight."""
    if not 0.0 <= weight < np.inf:
        raise ValueError(f"{name} is {weight}; a lobe's weight must be a finite number of at least 0.")


def format_index(index: complex) -> str:
    """A refractive index for a person."""
    return f"{index.real:.6g} + {index.imag:.6g}i" if index.imag else f"{index.real:.6g}"


def index_numbers(index: complex) -> dict[str, float]:
    """A refractive index n + ik as the numbers n and k."""
    return {"n": complex(index).real, "k": complex(index).imag}
