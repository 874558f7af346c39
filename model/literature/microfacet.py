"""Mirror-like facets with Gaussian slopes that reflect once, with or without masking one another."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Self

from model.evaluation import Form
from model.fresnel import require_index
from model.geometry import Angles, Facet, facet
from model.groove_passage import single_bounce
from model.groove_reflectance import facet_mueller
from model.kernel.expression import Value
from model.lobes.lobe import Lobe, format_index, index_numbers, require_weight
from model.matrix import Matrix, scaled
from model.slopes import normal_density, require_sigma


@dataclass(frozen=True)
class Microfacet(Lobe):
    """Light that Gaussian facets reflect once: D G M/(4 cos ti cos tr), with 1/cos⁴ of the facet's tilt in D.

    Without masking, G = 1, the lobe grows beyond all bounds towards grazing angles.

    Parameters
    ----------
    weight : float
        rho_s >= 0.
    sigma : float
        rms slope per axis, > 0.
    index : complex
        n + ik, n > 0, k >= 0.
    masked : bool
        Whether G is that of symmetric V-grooves, as in Torrance and Sparrow 1967, or 1.

    Raises
    ------
    ValueError
        If a value is outside its range.
    """

    weight: float
    sigma: float
    index: complex
    masked: bool

    def __post_init__(self) -> None:
        require_weight("rho_s", self.weight)
        require_sigma(self.sigma)
        require_index(self.index)

    @property
    def values(self) -> Mapping[str, float]:
        """The parameters that a fit may vary, by name."""
        return {"rho_s": self.weight, "sigma": self.sigma, **index_numbers(self.index)}

    def with_values(self, values: Mapping[str, float]) -> Self:
        """The same lobe with these values of all its parameters."""
        return replace(self, weight=values["rho_s"], sigma=values["sigma"], index=complex(values["n"], values["k"]))

    @property
    def width_rad(self) -> float:
        """Angle from its peak within which the lobe changes."""
        return self.sigma

    def form(self, varied: frozenset[str]) -> Form:
        """How the lobe follows from its numbers."""
        return Form(_masked if self.masked else _unmasked)

    def describe(self) -> str:
        """What the lobe is, and what it leaves out, for a person."""
        masking = {
            True: "masked as symmetric V-grooves",
            False: "without masking, so that it grows beyond all bounds towards grazing angles",
        }
        return (
            f"Specular lobe of Gaussian facets: rho_s = {self.weight:.6g}, sigma = {self.sigma:.6g} (rms slope per "
            f"axis), index {format_index(self.index)}, {masking[self.masked]}. Left out: light that meets more than "
            f"one facet."
        )


def _masked(at: Angles, numbers: Mapping[str, Value]) -> Matrix:
    wall = facet(at)
    return _reflected(wall, single_bounce(wall, numbers["sigma"], 0.0), numbers)


def _unmasked(at: Angles, numbers: Mapping[str, Value]) -> Matrix:
    wall = facet(at)
    reflectance = normal_density(wall.slope, numbers["sigma"]) / (4.0 * wall.cos_incidence * wall.cos_exit)
    return _reflected(wall, reflectance, numbers)


def _reflected(wall: Facet, reflectance: Value, numbers: Mapping[str, Value]) -> Matrix:
    return scaled(facet_mueller(wall, numbers["n"], numbers["k"]), numbers["rho_s"] * reflectance)
