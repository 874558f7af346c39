"""A detector's own noise."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from pydantic import Field

from sim_devices.effects.entry import Effect
from sim_devices.effects.measurement import SAMPLE_S, Measurement

if TYPE_CHECKING:
    from sim_devices.world import World


class ReadNoise(Effect):
    """The detector's own noise: standard deviation of one 3 ms sample."""

    effect: Literal["read_noise"] = Field(description="the effect's name")
    power_w: float = Field(gt=0, le=1e-3, description="standard deviation of one 3 ms sample, in W")

    def install(self, world: World) -> None:
        """Add Gaussian noise, less by the root of the number of samples in the exposure."""
        signal_w, sample_w = world.signal_w, self.power_w

        def noisy_w(measurement: Measurement) -> float:
            # shot noise draws first
            power_w = signal_w(measurement)
            spread_w = sample_w * (SAMPLE_S / measurement.exposure_s) ** 0.5
            return power_w + float(measurement.random.normal(0.0, spread_w))

        world.signal_w = noisy_w
