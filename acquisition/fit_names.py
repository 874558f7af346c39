"""What a fit section may name: lobes, their parameters and the instrument's, and the values that make sense."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from model.fit.quantities import quantity

Lobe = Literal["specular", "diffuse", "directional"]
SharedName = Literal["sigma", "n", "k", "asymmetry"]
OwnName = Literal[
    "specular.sigma",
    "specular.n",
    "specular.k",
    "specular.asymmetry",
    "diffuse.sigma",
    "directional.sigma",
    "directional.n",
    "directional.k",
]
WeightName = Literal["rho_s", "rho_d", "rho_dd"]
InstrumentName = Literal["incidence_offset_deg", "exit_offset_deg", "analyzer_offset_deg", "gain", "background_per_sr"]
SurfaceName = Literal[SharedName, OwnName, WeightName]
ParameterName = Literal[SurfaceName, InstrumentName]

TAKES: Mapping[Lobe, tuple[SharedName, ...]] = {
    "specular": ("sigma", "n", "k", "asymmetry"),
    "diffuse": ("sigma",),
    "directional": ("sigma", "n", "k"),
}
"""What shapes each lobe."""
WEIGHT: Mapping[Lobe, WeightName] = {"specular": "rho_s", "diffuse": "rho_d", "directional": "rho_dd"}
"""The weight of each lobe."""
_SENSIBLE = {"sigma": (1e-5, 10.0), "n": (0.05, 20.0), "k": (0.0, 100.0), "asymmetry": (0.0, 0.99)}
"""What samples have, where the model would take more: what lies beyond was mistyped."""


@dataclass(frozen=True)
class Domain:
    """The values of a parameter that make sense: from `low` to `high`."""

    meaning: str
    low: float
    high: float

    def holds(self, value: float) -> bool:
        """Whether a value is among them."""
        return self.low <= value <= self.high

    def __str__(self) -> str:
        return f"from {self.low:g} to {self.high:g}" if math.isfinite(self.high) else f"{self.low:g} or above"


def domain(name: str) -> Domain:
    """The values of a parameter that make sense, by the name that people use."""
    lobe, _, plain = name.rpartition(".")
    if plain.endswith("_deg"):
        kind = quantity(f"{plain.removesuffix('_deg')}_rad")
        return Domain(f"{kind.meaning}, in degrees", math.degrees(kind.lowest), math.degrees(kind.highest))
    kind = quantity(plain)
    low, high = _SENSIBLE.get(plain, (kind.lowest, kind.highest))
    return Domain(f"{kind.meaning}, for the {lobe} lobe alone" if lobe else kind.meaning, low, high)
