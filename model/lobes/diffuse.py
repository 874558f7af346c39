"""Depolarizing Lambertian walls of the same grooves, eq. (8) of Hao et al. 2023."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal, Self

import numpy as np

from model.evaluation import Form
from model.geometry import Angles, facet
from model.kernel.expression import Value, maximum, minimum
from model.lobes.lobe import Lobe, require_weight
from model.matrix import DEPOLARIZER, Matrix, scaled
from model.slopes import require_sigma

Averages = Literal["printed", "exact"]

# Below this sigma the exact averages, differences of nearly equal numbers, are summed as series in sigma².
_SMALL_SIGMA = 0.1
_TERMS = 24


@dataclass(frozen=True)
class Diffuse(Lobe):
    """Light that Lambertian facets scatter, averaged over their slopes; eq. (8).

    The bracket C1 + C2 tan ti tan tr cos phi goes negative towards grazing exit on the mirror side, which no
    reflectance can; it is clamped at zero. The tangents are divided into G, so that the lobe is finite to the horizon.

    Parameters
    ----------
    weight : float
        rho_d >= 0.
    sigma : float
        rms slope per axis, > 0.
    averages : {"printed", "exact"}
        C1 and C2 by the printed power laws, 0.8532 sigma^-0.095 and 0.3595 sigma^1.785, or by what these approximate,
        the averages over Beckmann slopes with m = sigma: (√pi/m) erfcx(1/m) and ½ [1 + (m²/2 - 1) C1].

    Raises
    ------
    ValueError
        If a value is outside its range.
    """

    weight: float
    sigma: float
    averages: Averages = "printed"

    def __post_init__(self) -> None:
        require_weight("rho_d", self.weight)
        require_sigma(self.sigma)
        if self.averages not in ("printed", "exact"):
            raise ValueError(f"averages is {self.averages!r}; they are printed or exact.")

    @property
    def values(self) -> Mapping[str, float]:
        """The parameters that a fit may vary, by name."""
        return {"rho_d": self.weight, "sigma": self.sigma}

    def with_values(self, values: Mapping[str, float]) -> Self:
        """The same lobe with these values of all its parameters."""
        return replace(self, weight=values["rho_d"], sigma=values["sigma"])

    def numbers_of(self, values: Mapping[str, float]) -> Mapping[str, float]:
        """What the form computes with for these values of the parameters."""
        (c1, c2), _ = self._averages(values["sigma"])
        return {"rho_d": values["rho_d"], "c1": c1, "c2": c2}

    def form(self, varied: frozenset[str]) -> Form:
        """How the lobe follows from its numbers."""
        return Form(_lambertian_facets)

    def rates(self, parameter: str, values: Mapping[str, float]) -> Mapping[str, float]:
        """How fast each of the numbers changes with a parameter."""
        if parameter == "sigma":
            _, (d_c1, d_c2) = self._averages(values["sigma"])
            return {"c1": d_c1, "c2": d_c2}
        return super().rates(parameter, values)

    def describe(self) -> str:
        """What the lobe is, and what it leaves out, for a person."""
        how = {
            "printed": "the printed power laws C1 = 0.8532 sigma^-0.095, C2 = 0.3595 sigma^1.785",
            "exact": "C1 and C2 averaged exactly over Beckmann slopes with m = sigma",
        }
        return (
            f"Diffuse lobe, eq. (8): rho_d = {self.weight:.6g}, sigma = {self.sigma:.6g}, unpolarized, with the "
            f"masking of single-bounce grooves and {how[self.averages]}. Set to zero where the printed expression is "
            f"negative (grazing exit on the mirror side)."
        )

    def _averages(self, sigma: float) -> tuple[tuple[float, float], tuple[float, float]]:
        if self.averages == "printed":
            return printed_averages(sigma)
        if not np.ndim(sigma):
            return exact_averages(sigma)
        many = np.array([exact_averages(float(one)) for one in np.ravel(sigma)])
        (c1, c2), (d_c1, d_c2) = np.moveaxis(many, 0, -1).reshape(2, 2, *np.shape(sigma))
        return (c1, c2), (d_c1, d_c2)


def printed_averages(sigma: float) -> tuple[tuple[float, float], tuple[float, float]]:
    """C1 and C2 as eq. (8) prints them, and their derivatives by sigma."""
    c1, c2 = 0.8532 * sigma**-0.095, 0.3595 * sigma**1.785
    return (c1, c2), (-0.095 * c1 / sigma, 1.785 * c2 / sigma)


def exact_averages(sigma: float) -> tuple[tuple[float, float], tuple[float, float]]:
    """C1 and C2 averaged over Beckmann slopes with m = sigma, and their derivatives by sigma.

    C1 = ⟨cos⟩ = (√pi/m) erfcx(1/m) is the mean cosine of the facets' tilts, C2 = ½ ⟨tan² cos⟩.
    """
    m, lost, d_lost = sigma, 0.0, 0.0  # 1 - C1 and its derivative
    if m < _SMALL_SIGMA:
        term = 1.0
        for order in range(1, _TERMS):
            term *= -(2 * order - 1) * m * m / 2.0
            lost -= term
            d_lost -= 2.0 * order * term / m
    else:
        from scipy.special import erfcx  # takes longer to load than all of the model

        x = 1.0 / m
        scaled_tail = float(erfcx(x))
        lost = 1.0 - math.sqrt(math.pi) * x * scaled_tail
        d_lost = x * x * (math.sqrt(math.pi) * scaled_tail * (1.0 + 2.0 * x * x) - 2.0 * x)
    half = m * m / 2.0
    c2 = 0.5 * (half + lost - half * lost)
    d_c2 = 0.5 * (m + d_lost - m * lost - half * d_lost)
    return (1.0 - lost, c2), (-d_lost, d_c2)


def _lambertian_facets(at: Angles, numbers: Mapping[str, Value]) -> Matrix:
    wall = facet(at)
    higher = maximum(wall.cos_incidence, wall.cos_exit)
    # G/(cos ti cos tr), which stays finite to the horizon where both G and the cosines vanish.
    masked = minimum(1.0 / wall.cos_lower, wall.sum_of_cosines / (wall.cos * wall.cos)) / higher
    bracket = numbers["c1"] * wall.cos_incidence * wall.cos_exit + numbers["c2"] * wall.horizontal_product
    return scaled(DEPOLARIZER, numbers["rho_d"] * (1.0 / math.pi) * masked * maximum(bracket, 0.0))
