"""A lamp that flickers, averaged over the exposure in closed form."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Literal

from pydantic import Field

from sim_devices.effects.entry import Effect
from sim_devices.effects.measurement import Moment, Stokes

if TYPE_CHECKING:
    from sim_devices.world import World


class Flicker(Effect):
    """The lamp's power is 1 + `relative_amplitude` · sin(2 pi `frequency_hz` t) times that of the scene."""

    effect: Literal["flicker"] = Field(description="the effect's name")
    relative_amplitude: float = Field(gt=0, le=1, description="amplitude, relative to the lamp's power")
    frequency_hz: float = Field(gt=0, le=1e6, description="frequency, in Hz")

    def install(self, world: World) -> None:
        """Scale what arrives by the mean over the exposure T: amplitude sin(pi f T)/(pi f T) about its middle."""
        steady_w, amplitude, frequency_hz = world.arriving_w, self.relative_amplitude, self.frequency_hz

        def flickering_w(moment: Moment) -> Stokes:
            half_phase = math.pi * frequency_hz * moment.exposure_s
            seen = amplitude * math.sin(half_phase) / half_phase if half_phase else amplitude
            return steady_w(moment) * (1 + seen * math.sin(2 * math.pi * frequency_hz * moment.middle_s))

        world.arriving_w = flickering_w
