"""A detector that can take only so much."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Literal

from pydantic import Field

from sim_devices.effects.entry import Effect
from sim_devices.effects.measurement import Measurement

if TYPE_CHECKING:
    from sim_devices.world import World


class Saturation(Effect):
    """Beyond `power_w` the detector tells no power but that it is over its range."""

    effect: Literal["saturation"] = Field(description="the effect's name")
    power_w: float = Field(gt=0, le=10, description="largest signal that the detector can tell, in W")

    def install(self, world: World) -> None:
        """Let a larger signal be infinite, for which every detector has its own way to say it."""
        signal_w, largest_w = world.signal_w, self.power_w

        def limited_w(measurement: Measurement) -> float:
            power_w = signal_w(measurement)
            return power_w if power_w <= largest_w else math.inf

        world.signal_w = limited_w
