"""The digits of a reading."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from pydantic import Field

from sim_devices.effects.entry import Effect
from sim_devices.effects.measurement import Measurement

if TYPE_CHECKING:
    from sim_devices.world import World


class Quantisation(Effect):
    """Significant digits of a reading."""

    effect: Literal["quantisation"] = Field(description="the effect's name")
    digits: int = Field(ge=1, le=15, description="significant digits of a printed reading")

    def install(self, world: World) -> None:
        """Round the signal to its digits."""
        signal_w, decimals = world.signal_w, self.digits - 1

        def rounded_w(measurement: Measurement) -> float:
            return float(f"{signal_w(measurement):.{decimals}e}")

        world.signal_w = rounded_w
