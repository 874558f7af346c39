"""A detector whose response flattens."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from pydantic import Field

from sim_devices.effects.entry import Effect
from sim_devices.effects.measurement import Measurement

if TYPE_CHECKING:
    from sim_devices.world import World


class Nonlinearity(Effect):
    """The more power, the more of it the detector misses: the share `relative_loss` at `at_power_w`."""

    effect: Literal["nonlinearity"] = Field(description="the effect's name")
    relative_loss: float = Field(gt=0, le=0.5, description="share of the signal that is missing at at_power_w")
    at_power_w: float = Field(gt=0, le=10, description="power at which that share is missing, in W")

    def install(self, world: World) -> None:
        """Compress the signal P to P / (1 + P/c), with c so that the loss at the given power is the given one."""
        signal_w = world.signal_w
        half_w = self.at_power_w * (1 - self.relative_loss) / self.relative_loss

        def compressed_w(measurement: Measurement) -> float:
            linear_w = signal_w(measurement)
            return linear_w / (1 + linear_w / half_w)

        world.signal_w = compressed_w
