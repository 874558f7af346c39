"""Cones of directions that the detector accepts and the source fills: the sample's mean over them is what is seen."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Literal

from pydantic import Field

from model.acceptance import half_angle_rad
from sim_devices.effects.entry import Effect

if TYPE_CHECKING:
    from sim_devices.world import World


class AcceptanceCone(Effect):
    """The detector takes the mean over its cone of directions; needed where light is followed for several bounces."""

    effect: Literal["acceptance_cone"] = Field(description="the effect's name")

    def install(self, world: World) -> None:
        """Open the cone as wide as the detector's acceptance."""
        world.detector_half_angle_rad = half_angle_rad(world.acceptance_sr)


class SourceCone(Effect):
    """The source is not collimated: the sample is lit by a circular cone, uniformly."""

    effect: Literal["source_cone"] = Field(description="the effect's name")
    half_angle_deg: float = Field(ge=1e-3, le=30, description="half-angle of the source's cone, in deg")

    def install(self, world: World) -> None:
        """Open the source's cone."""
        world.source_half_angle_rad = math.radians(self.half_angle_deg)
