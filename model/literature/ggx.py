"""Mirror-like facets with GGX slopes and Smith's masking."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Self

from model.evaluation import Form
from model.fresnel import require_index
from model.geometry import Angles, Facet, facet
from model.groove_reflectance import facet_mueller
from model.kernel.expression import Value, sqrt
from model.lobes.lobe import Lobe, format_index, require_weight
from model.matrix import Matrix, scaled


@dataclass(frozen=True)
class Ggx(Lobe):
    """Light that GGX facets reflect once: D G M/(4 cos ti cos tr); Walter et al. 2007, eqs. (33), (34).

    Parameters
    ----------
    weight : float
        rho_s >= 0.
    alpha : float
        Width of the slopes, > 0: their median. There is no rms slope; Gaussian slopes of sigma = alpha/√2 have the
        same density at slope 0, those of sigma = alpha/2 the same curvature of its logarithm.
    index : float
        Real refractive index, > 0.

    Raises
    ------
    ValueError
        If a value is outside its range.
    """

    weight: float
    alpha: float
    index: float

    def __post_init__(self) -> None:
        require_weight("rho_s", self.weight)
        require_index(complex(self.index))
        if not 0.0 < self.alpha < math.inf:
            raise ValueError(f"alpha is {self.alpha}; the width of GGX slopes must be a finite number above 0.")

    @property
    def values(self) -> Mapping[str, float]:
        """The parameters that a fit may vary, by name."""
        return {"rho_s": self.weight, "alpha": self.alpha, "n": self.index}

    def with_values(self, values: Mapping[str, float]) -> Self:
        """The same lobe with these values of all its parameters."""
        return replace(self, weight=values["rho_s"], alpha=values["alpha"], index=values["n"])

    @property
    def width_rad(self) -> float:
        """Angle from its peak within which the lobe changes."""
        return self.alpha

    def form(self, varied: frozenset[str]) -> Form:
        """How the lobe follows from its numbers."""
        return Form(_ggx)

    def describe(self) -> str:
        """What the lobe is, and what it leaves out, for a person."""
        return (
            f"Specular lobe of GGX facets with Smith's masking: rho_s = {self.weight:.6g}, alpha = {self.alpha:.6g} "
            f"(the median slope; there is no rms slope), index {format_index(complex(self.index))}. Left out: light "
            f"that meets more than one facet."
        )


def _ggx(at: Angles, numbers: Mapping[str, Value]) -> Matrix:
    wall, alpha = facet(at), numbers["alpha"]
    # G1 = 2 cos/(cos + sqrt(cos² + α² sin²)): its cosines cancel those that D G is divided by.
    masked_incidence = _spread(at.cos_incidence, at.sin_incidence, alpha)
    masked_exit = _spread(at.cos_exit, at.sin_exit, alpha)
    reflectance = _density(wall, alpha) / masked_incidence / masked_exit
    return scaled(facet_mueller(wall, numbers["n"], 0.0), numbers["rho_s"] * reflectance)


def _density(wall: Facet, alpha: Value) -> Value:
    steep = wall.slope / alpha
    ratio = (1.0 + wall.slope * wall.slope) / (1.0 + steep * steep) / alpha
    return ratio * ratio * (1.0 / math.pi)


def _spread(cosine: Value, sine: Value, alpha: Value) -> Value:
    widened = alpha * sine
    return cosine + sqrt(cosine * cosine + widened * widened)
