"""A lamp whose light is polarized."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Literal

import numpy as np
from pydantic import Field, model_validator

from sim_devices.effects.entry import Effect

if TYPE_CHECKING:
    from sim_devices.world import World

_ROUNDING = 1e-9


class PolarizedLamp(Effect):
    """The lamp's light has the Stokes vector power · (1, `s1`, `s2`, `s3`) in the frame of the incoming ray."""

    effect: Literal["polarized_lamp"] = Field(description="the effect's name")
    s1: float = Field(default=0.0, ge=-1, le=1, description="S1/S0 of the lamp, positive for s-polarized light")
    s2: float = Field(default=0.0, ge=-1, le=1, description="S2/S0, positive at +45 deg from s towards p")
    s3: float = Field(default=0.0, ge=-1, le=1, description="S3/S0, positive for light that turns clockwise")

    @model_validator(mode="after")
    def _is_light(self) -> PolarizedLamp:
        degree = math.hypot(self.s1, self.s2, self.s3)
        if not 0.0 < degree <= 1.0 + _ROUNDING:
            raise ValueError(
                f"polarized_lamp: s1, s2 and s3 have a degree of polarization of {degree:.4g}; allowed: 0 to 1"
            )
        return self

    def install(self, world: World) -> None:
        """Let the lamp shine so."""
        world.lamp_stokes = np.array([1.0, self.s1, self.s2, self.s3])
