"""Mirror-like walls of V-grooves, eq. (6) of Hao et al. 2023, in both readings of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from model.bounce_bound import Tolerance, light_beyond
from model.evaluation import Form
from model.fresnel import require_index
from model.geometry import Angles
from model.groove_reflectance import groove_mueller
from model.kernel.expression import Value
from model.lobes.lobe import format_index, require_weight
from model.matrix import Matrix, scaled
from model.single_fresnel import single_fresnel_mueller
from model.slopes import require_sigma
from model.vgroove import require_asymmetry, require_bounces, single_bounce_fraction

Reading = Literal["kaleidoscope", "single-fresnel"]


@dataclass(frozen=True)
class Specular:
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

    @property
    def followed(self) -> int:
        """How many reflections light is followed through."""
        if isinstance(self.bounces, Tolerance):
            return self.bounces.bounces(self.sigma, self.asymmetry)
        return self.bounces

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the numbers that a fit may vary."""
        shapes = ("rho_s", "sigma", "n", "k")
        return shapes if self.reading == "single-fresnel" else (*shapes, "asymmetry")

    @property
    def numbers(self) -> Mapping[str, float]:
        """What the form computes with, by name."""
        n, k = complex(self.index).real, complex(self.index).imag
        numbers = {"rho_s": self.weight, "sigma": self.sigma, "n": n, "k": k}
        return numbers if self.reading == "single-fresnel" else {**numbers, "asymmetry": self.asymmetry}

    @property
    def has_caustic(self) -> bool:
        """Whether the lobe is infinite in the mirror direction itself."""
        return self.reading == "kaleidoscope" and self.followed > 1

    def form(self, varied: frozenset[str]) -> Form:
        """How the lobe follows from its numbers."""
        if self.reading == "single-fresnel":
            return Form(_single_fresnel, (self.followed,))
        return Form(_kaleidoscope, (self.followed, self.asymmetry == 0.0 and "asymmetry" not in varied))

    def rates(self, parameter: str) -> Mapping[str, float]:
        """How fast each of the numbers changes with a parameter."""
        return {parameter: 1.0} if parameter in self.parameters else {}

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
        if self.followed == 1:
            lost_normal, lost_60 = (
                1.0 - single_bounce_fraction(np.radians(angle), self.sigma) for angle in (0.0, 60.0)
            )
            return (
                f"Left out: light that meets a groove's walls twice or more (on a perfect mirror of this roughness "
                f"{lost_normal:.2%} of the light at 0° incidence and {lost_60:.2%} at 60°), and with it the sharp "
                f"ridge, or caustic, that straight grooves show towards the mirror direction and a random rough "
                f"surface does not."
            )
        beyond = light_beyond(self.followed, self.sigma, self.asymmetry)
        text = f"Left out: bounce {self.followed + 1} and beyond, less than {beyond:.1g} of the light."
        if self.has_caustic:
            text += (
                " Straight grooves show a sharp ridge, or caustic, towards the mirror direction, which a random rough "
                "surface does not; bounces = 1 has none."
            )
        return text


def _kaleidoscope(at: Angles, numbers: Mapping[str, Value], followed: int, symmetric: bool) -> Matrix:
    asymmetry = 0.0 if symmetric else numbers["asymmetry"]
    matrix = groove_mueller(at, range(1, followed + 1), numbers["sigma"], asymmetry, numbers["n"], numbers["k"])
    return scaled(matrix, numbers["rho_s"])


def _single_fresnel(at: Angles, numbers: Mapping[str, Value], followed: int) -> Matrix:
    return scaled(single_fresnel_mueller(at, followed, numbers["sigma"], numbers["n"], numbers["k"]), numbers["rho_s"])
