"""Light that enters a body, loses its polarization inside, and is polarized anew on its way out: T·D·T."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Self

from model.evaluation import Form
from model.fresnel import require_index
from model.geometry import Angles
from model.kernel.expression import Value
from model.literature.transmittance import transmittance
from model.lobes.lobe import Lobe, format_index, require_weight
from model.matrix import Matrix, scaled


@dataclass(frozen=True)
class BodyDiffuse(Lobe):
    """Polarized diffuse light through a smooth macro surface: rho_d/π · T(tr) · depolarizer · T(ti).

    T are the Mueller matrices of Fresnel transmission; p passes better than s, so that the light is p-polarized.

    Parameters
    ----------
    weight : float
        rho_d >= 0, the albedo between the two transmissions.
    index : float
        Real refractive index, > 0.

    Raises
    ------
    ValueError
        If a value is outside its range.
    """

    weight: float
    index: float

    def __post_init__(self) -> None:
        require_weight("rho_d", self.weight)
        require_index(complex(self.index))

    @property
    def values(self) -> Mapping[str, float]:
        """The parameters that a fit may vary, by name."""
        return {"rho_d": self.weight, "n": self.index}

    def with_values(self, values: Mapping[str, float]) -> Self:
        """The same lobe with these values of all its parameters."""
        return replace(self, weight=values["rho_d"], index=values["n"])

    def form(self, varied: frozenset[str]) -> Form:
        """How the lobe follows from its numbers."""
        return Form(_in_and_out)

    def describe(self) -> str:
        """What the lobe is, and what it leaves out, for a person."""
        return (
            f"Polarized diffuse lobe, transmission · depolarizer · transmission: rho_d = {self.weight:.6g}, index "
            f"{format_index(complex(self.index))}. Left out: roughness, and light that the surface reflects back into "
            f"the body."
        )


def _in_and_out(at: Angles, numbers: Mapping[str, Value]) -> Matrix:
    into = transmittance(at.cos_incidence, at.sin_incidence, numbers["n"])
    out = transmittance(at.cos_exit, at.sin_exit, numbers["n"])
    # The frames of both rays are those of the smooth surface: there is nothing to turn.
    total, polarized = (
        (half * into.mean, half * into.half_difference, 0.0, 0.0) for half in (out.mean, out.half_difference)
    )
    return scaled((total, polarized, (0.0,) * 4, (0.0,) * 4), numbers["rho_d"] * (1.0 / math.pi))
