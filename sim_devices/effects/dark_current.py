"""What a detector reports in the dark."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from pydantic import Field

from sim_devices.effects.entry import Effect
from sim_devices.effects.measurement import Measurement

if TYPE_CHECKING:
    from sim_devices.world import World


class DarkCurrent(Effect):
    """Power that the detector reports in the dark."""

    effect: Literal["dark_current"] = Field(description="the effect's name")
    power_w: float = Field(gt=0, le=1e-3, description="power reported in the dark, in W")

    def install(self, world: World) -> None:
        """Add it to the signal."""
        signal_w, dark_w = world.signal_w, self.power_w

        def with_dark_current_w(measurement: Measurement) -> float:
            return signal_w(measurement) + dark_w

        world.signal_w = with_dark_current_w
