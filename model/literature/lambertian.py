"""Light of the same radiance in every direction, without polarization."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Self

from model.evaluation import Form
from model.geometry import Angles
from model.kernel.expression import Value
from model.lobes.lobe import Lobe, require_weight
from model.matrix import DEPOLARIZER, Matrix, scaled


@dataclass(frozen=True)
class Lambertian(Lobe):
    """Ideal diffuse light, rho_d/π times the depolarizer.

    Parameters
    ----------
    weight : float
        rho_d >= 0, the albedo.

    Raises
    ------
    ValueError
        If the weight is outside its range.
    """

    weight: float

    def __post_init__(self) -> None:
        require_weight("rho_d", self.weight)

    @property
    def values(self) -> Mapping[str, float]:
        """The parameters that a fit may vary, by name."""
        return {"rho_d": self.weight}

    def with_values(self, values: Mapping[str, float]) -> Self:
        """The same lobe with these values of all its parameters."""
        return replace(self, weight=values["rho_d"])

    def form(self, varied: frozenset[str]) -> Form:
        """How the lobe follows from its numbers."""
        return Form(_even)

    def describe(self) -> str:
        """What the lobe is, and what it leaves out, for a person."""
        return f"Ideal diffuse lobe: rho_d = {self.weight:.6g}, unpolarized, of the same radiance in every direction."


def _even(at: Angles, numbers: Mapping[str, Value]) -> Matrix:
    return scaled(DEPOLARIZER, numbers["rho_d"] * (1.0 / math.pi))
