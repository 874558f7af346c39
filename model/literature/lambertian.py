"""Light of the same radiance in every direction, without polarization."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

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
    def parameters(self) -> tuple[str, ...]:
        """Names of the numbers that a fit may vary."""
        return ("rho_d",)

    @property
    def numbers(self) -> Mapping[str, float]:
        """What the form computes with, by name."""
        return {"rho_d": self.weight}

    def form(self, varied: frozenset[str]) -> Form:
        """How the lobe follows from its numbers."""
        return Form(_even)

    def rates(self, parameter: str) -> Mapping[str, float]:
        """How fast each of the numbers changes with a parameter."""
        return {"rho_d": 1.0} if parameter == "rho_d" else {}

    def describe(self) -> str:
        """What the lobe is, and what it leaves out, for a person."""
        return f"Ideal diffuse lobe: rho_d = {self.weight:.6g}, unpolarized, of the same radiance in every direction."


def _even(at: Angles, numbers: Mapping[str, Value]) -> Matrix:
    return scaled(DEPOLARIZER, numbers["rho_d"] * (1.0 / math.pi))
