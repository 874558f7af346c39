"""Mirror-like walls of V-grooves, eq. (6) of Hao et al. 2023, in both readings of it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, Self

import numpy as np

from model.bounce_bound import Tolerance, light_beyond
from model.domain import require_asymmetry, require_bounces
from model.evaluation import Form
from model.fresnel import require_index
from model.geometry import Angles
from model.groove_reflectance import groove_mueller
from model.kernel.expression import Value
from model.lobes.lobe import Lobe, format_index, index_numbers, require_weight
from model.matrix import Matrix, scaled
from model.single_fresnel import single_fresnel_mueller
from model.slopes import require_sigma
from model.vgroove import single_bounce_fraction

Reading = Literal["kaleidoscope", "single-fresnel"]


@dataclass(frozen=True)
class Specular(Lobe):
    """Light that the walls of V-grooves reflect, once or more often; eq. (6).

    Parameters
    ----------
    weight : float
        rho_s >= 0.
    sigma : float
        rms slope per axis, > 0.
    index : complex
        n + ik, n > 0, k >= 0.
    asymmetry : float
        a of grooves with walls of slopes t(1 + a) and t(1 - a); at least 0, below 1.
    bounces : int or Tolerance
        Light is followed through so many reflections, or through as many as leave no more than the tolerance.
    reading : {"kaleidoscope", "single-fresnel"}
        Every bounce with its own facet angle, Jacobian and Fresnel matrix; or, as the paper prints it, one facet with
        one Fresnel matrix whose masking factor is summed over bounces. The latter knows symmetric grooves only, and for
        more than one bounce it is not reciprocal.

    Raises
    ------
    ValueError
        If a value is outside its range.
    """

    weight: float
    sigma: float
    index: complex
    asymmetry: float = 0.0
    bounces: int | Tolerance = 1
    reading: Reading = "kaleidoscope"

    def __post_init__(self) -> None:
        require_weight("rho_s", self.weight)
        require_sigma(self.sigma)
        require_index(self.index)
        require_asymmetry(self.asymmetry)
        if self.reading not in ("kaleidoscope", "single-fresnel"):
            raise ValueError(f"reading is {self.reading!r}; it is kaleidoscope or single-fresnel.")
        if self.reading == "single-fresnel" and self.asymmetry:
            raise ValueError(
                f"asymmetry is {self.asymmetry:g}; the single-fresnel reading is of symmetric grooves, asymmetry 0."
            )
        require_bounces(self.followed)

    @cached_property
    def followed(self) -> int:
        """How many reflections light is followed through."""
        if isinstance(self.bounces, Tolerance):
            return self.bounces.bounces(self.sigma, self.asymmetry)
        return self.bounces

    @property
    def values(self) -> Mapping[str, float]:
        """The parameters that a fit may vary, by name."""
        values = {"rho_s": self.weight, "sigma": self.sigma, **index_numbers(self.index)}
        return values if self.reading == "single-fresnel" else {**values, "asymmetry": self.asymmetry}

    def with_values(self, values: Mapping[str, float]) -> Self:
        """The same lobe with these values of all its parameters."""
        return replace(
            self,
            weight=values["rho_s"],
            sigma=values["sigma"],
            index=complex(values["n"], values["k"]),
            asymmetry=values.get("asymmetry", 0.0),
        )

    @property
    def has_caustic(self) -> bool:
        """Whether the lobe is infinite in the mirror direction itself."""
        return self.reading == "kaleidoscope" and self.followed > 1

    @property
    def width_rad(self) -> float:
        """Angle from its peak within which the lobe changes."""
        return self.sigma

    def form(self, varied: frozenset[str]) -> Form:
        """How the lobe follows from its numbers."""
        if self.reading == "single-fresnel":
            return Form(_single_fresnel, (self.followed,))
        return Form(_kaleidoscope, (self.followed, self.asymmetry == 0.0 and "asymmetry" not in varied))

    def describe(self) -> str:
        """What the lobe is, and what it leaves out, for a person."""
        grooves = f"asymmetric V-grooves (a = {self.asymmetry:.6g})" if self.asymmetry else "symmetric V-grooves"
        head = (
            f"Specular lobe, eq. (6): rho_s = {self.weight:.6g}, sigma = {self.sigma:.6g} (rms slope per axis), index "
            f"{format_index(self.index)}. {self._reflections()} in {grooves}. {self._left_out()}"
        )
        if self.reading == "single-fresnel":
            return f"{head} Read as single-fresnel: one facet and one Fresnel matrix; not reciprocal beyond one bounce."
        return head

    def _reflections(self) -> str:
        if self.followed == 1:
            return "One reflection (k = 1)"
        return f"Up to {self.followed} reflections (k = 1 … {self.followed})"

    def _left_out(self) -> str:
        ridge = (
            "the sharp ridge, or caustic, that straight grooves show towards the mirror direction and a random rough "
            "surface does not"
        )
        if self.followed == 1:
            return f"Left out: light that meets a groove's walls twice or more{self._share()}, and with it {ridge}."
        beyond = light_beyond(self.followed, self.sigma, self.asymmetry)
        share = f"at most {_rounded_up(beyond)} of the light" if beyond else "nothing that a number could tell from 0"
        text = f"Left out: bounce {self.followed + 1} and beyond, {share}."
        return f"{text} It has {ridge}; bounces = 1 has none." if self.has_caustic else text

    def _share(self) -> str:
        if self.asymmetry:
            return ""
        normal, at_60 = (1.0 - single_bounce_fraction(np.radians(angle), self.sigma) for angle in (0.0, 60.0))
        return (
            f" (on a perfect mirror of this roughness {normal:.2%} of the light at 0° incidence and {at_60:.2%} at 60°)"
        )


def _rounded_up(share: float) -> str:
    digit = 10.0 ** math.floor(math.log10(share))
    return f"{math.ceil(share / digit * (1.0 - 1e-12)) * digit:.1g}"


def _kaleidoscope(at: Angles, numbers: Mapping[str, Value], followed: int, symmetric: bool) -> Matrix:
    asymmetry = 0.0 if symmetric else numbers["asymmetry"]
    matrix = groove_mueller(at, range(1, followed + 1), numbers["sigma"], asymmetry, numbers["n"], numbers["k"])
    return scaled(matrix, numbers["rho_s"])


def _single_fresnel(at: Angles, numbers: Mapping[str, Value], followed: int) -> Matrix:
    return scaled(single_fresnel_mueller(at, followed, numbers["sigma"], numbers["n"], numbers["k"]), numbers["rho_s"])
