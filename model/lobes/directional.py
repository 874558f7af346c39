"""Directional diffuse light near the normal, eq. (10) of Hao et al. 2023."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Self

from model.evaluation import Form
from model.fresnel import require_index
from model.geometry import Angles, facet
from model.groove_reflectance import facet_mueller
from model.kernel.expression import Value, damped
from model.lobes.lobe import Lobe, Peak, format_index, index_numbers, require_weight
from model.matrix import Matrix, scaled
from model.slopes import require_sigma


@dataclass(frozen=True)
class Directional(Lobe):
    """Directional diffuse light near the normal, polarized like the half-vector facet; eq. (10).

    Its size exp(-2 tan(tr)^p/sigma²)/(sqrt(2 pi) sigma) depends on the exit angle alone, so that it is not reciprocal.

    Parameters
    ----------
    weight : float
        rho_dd >= 0.
    sigma : float
        rms slope per axis, > 0.
    index : complex
        n + ik, n > 0, k >= 0.
    exponent : {1, 2}
        p: 1 as printed, with a cusp at the normal and a 1/e half-width of atan(sigma²/2); 2 is smooth, as the prefactor
        suggests, with a 1/e half-width of atan(sigma/√2).

    Raises
    ------
    ValueError
        If a value is outside its range.
    """

    weight: float
    sigma: float
    index: complex
    exponent: int = 1

    def __post_init__(self) -> None:
        require_weight("rho_dd", self.weight)
        require_sigma(self.sigma)
        require_index(self.index)
        if self.exponent not in (1, 2):
            raise ValueError(f"exponent is {self.exponent!r}; it is 1 (printed) or 2 (smooth).")

    @property
    def values(self) -> Mapping[str, float]:
        """The parameters that a fit may vary, by name."""
        return {"rho_dd": self.weight, "sigma": self.sigma, **index_numbers(self.index)}

    def with_values(self, values: Mapping[str, float]) -> Self:
        """The same lobe with these values of all its parameters."""
        return replace(self, weight=values["rho_dd"], sigma=values["sigma"], index=complex(values["n"], values["k"]))

    @property
    def peak(self) -> Peak:
        """About which direction the lobe stands, if it is narrow."""
        return "normal"

    @property
    def width_rad(self) -> float:
        """Angle from its peak within which the lobe changes."""
        return math.atan(self.sigma**2 / 2.0 if self.exponent == 1 else self.sigma / math.sqrt(2.0))

    def form(self, varied: frozenset[str]) -> Form:
        """How the lobe follows from its numbers."""
        return Form(_towards_the_normal, (self.exponent,))

    def describe(self) -> str:
        """What the lobe is, and what it leaves out, for a person."""
        shape = {
            1: "printed exponent tan(exit): a cusp at the normal that falls",
            2: "exponent tan²(exit) in place of the printed tan(exit): a smooth top at the normal that falls",
        }
        return (
            f"Directional diffuse lobe, eq. (10): rho_dd = {self.weight:.6g}, sigma = {self.sigma:.6g}, "
            f"index {format_index(self.index)}, {shape[self.exponent]} to 1/e within "
            f"{math.degrees(self.width_rad):.2g}°. Its size follows from the exit angle alone, so it is not reciprocal."
        )


def _towards_the_normal(at: Angles, numbers: Mapping[str, Value], exponent: int) -> Matrix:
    sigma, slope = numbers["sigma"], at.sin_exit / at.cos_exit
    power = slope * slope if exponent == 2 else slope
    size = damped(1.0 / (math.sqrt(2.0 * math.pi) * sigma), -power * (1.0 / (sigma * sigma)))
    return scaled(facet_mueller(facet(at), numbers["n"], numbers["k"]), numbers["rho_dd"] * size)
