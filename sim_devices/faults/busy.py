"""A device that has no time for its clients."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from pydantic import Field

from sim_devices.faults.entry import DeviceFault, Random

if TYPE_CHECKING:
    from sim_devices.faults.switchboard import Switchboard


class Busy(DeviceFault):
    """A device that takes nothing for a while, as in the menu of its front panel, and then all that was sent."""

    fault: Literal["busy"] = Field(description="the fault's name")
    for_s: float = Field(gt=0, le=1e6, description="how long it lasts, in s")

    def strike(self, board: Switchboard, random: Random, time_s: float) -> None:
        """Keep what is sent."""
        board.port(self.device).busy_until_s = time_s + self.for_s
