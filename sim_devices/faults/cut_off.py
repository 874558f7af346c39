"""A device that its clients cannot reach: its cable was pulled, or its power is gone."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Literal

from pydantic import Field

from sim_devices.faults.entry import DeviceFault, Random
from sim_devices.faults.hooks import LosesPower

if TYPE_CHECKING:
    from sim_devices.faults.switchboard import Switchboard


class CablePulled(DeviceFault):
    """A cable that is pulled, and plugged in again: connections end and are refused; at a terminal bytes are lost."""

    fault: Literal["cable_pulled"] = Field(description="the fault's name")
    for_s: float = Field(default=5.0, gt=0, le=1e9, description="time until it is plugged in again, in s")

    def strike(self, board: Switchboard, random: Random, time_s: float) -> None:
        """Hang up."""
        port = board.port(self.device)
        port.deaf_until_s = port.refuses_until_s = time_s + self.for_s
        board.cut(self.device, hangs_up=True)


class PowerCycle(DeviceFault):
    """A device that loses its power, and gets it back."""

    needs: ClassVar[tuple[type, ...]] = (LosesPower,)

    fault: Literal["power_cycle"] = Field(description="the fault's name")
    off_s: float = Field(default=2.0, gt=0, le=1e6, description="time until it listens again, in s")

    def strike(self, board: Switchboard, random: Random, time_s: float) -> None:
        """Lose what the device does not keep, and all that is said meanwhile."""
        device = board.device(self.device)
        assert isinstance(device, LosesPower)
        device.power_cycle(time_s)
        board.turn_off(self.device, time_s + self.off_s)
