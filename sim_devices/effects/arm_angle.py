"""Errors of an arm's angle that depend on the angle alone: a zero that is off, and an arm that bends."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Literal

from pydantic import Field

from sim_devices.effects.entry import ArmEffect

if TYPE_CHECKING:
    from sim_devices.world import World


class ZeroOffset(ArmEffect):
    """The arm stands at `offset_deg` from the sample's normal where its controller says 0."""

    effect: Literal["zero_offset"] = Field(description="the effect's name")
    offset_deg: float = Field(ge=-10, le=10, description="true angle at the controller's zero, in deg")

    def install(self, world: World) -> None:
        """Shift the angle that the light sees."""
        angle_deg, offset_deg = world.angle_deg[self.axis], self.offset_deg

        def shifted_deg(time_s: float) -> float:
            return angle_deg(time_s) + offset_deg

        world.angle_deg[self.axis] = shifted_deg


class Flexure(ArmEffect):
    """The arm bends under its weight: by `amplitude_deg` times the sine of its angle."""

    effect: Literal["flexure"] = Field(description="the effect's name")
    amplitude_deg: float = Field(ge=-5, le=5, description="what is added to the angle at 90 deg, in deg")

    def install(self, world: World) -> None:
        """Bend the angle that the light sees."""
        angle_deg, amplitude_deg = world.angle_deg[self.axis], self.amplitude_deg

        def bent_deg(time_s: float) -> float:
            straight_deg = angle_deg(time_s)
            return straight_deg + amplitude_deg * math.sin(math.radians(straight_deg))

        world.angle_deg[self.axis] = bent_deg
