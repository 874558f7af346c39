"""Light that does not come from the sample."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from pydantic import Field

from model.mueller import UNPOLARIZED
from sim_devices.effects.entry import Effect
from sim_devices.effects.measurement import Moment, Stokes

if TYPE_CHECKING:
    from sim_devices.world import World


class StrayLight(Effect):
    """Unpolarized light of the room falls on the analyzer, wherever the arms are; a lid keeps it out."""

    effect: Literal["stray_light"] = Field(description="the effect's name")
    power_w: float = Field(gt=0, le=1e-3, description="power that falls on the analyzer, in W; a polarizer passes half")

    def install(self, world: World) -> None:
        """Add it to what arrives."""
        arriving_w, stray_w = world.arriving_w, self.power_w * UNPOLARIZED

        def with_stray_light_w(moment: Moment) -> Stokes:
            return arriving_w(moment) + stray_w

        world.arriving_w = with_stray_light_w
