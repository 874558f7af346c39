"""Somebody at the bench."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Literal

from pydantic import Field

from sim_devices.faults.entry import DeviceFault, Random
from sim_devices.faults.hooks import HasButton

if TYPE_CHECKING:
    from sim_devices.faults.switchboard import Switchboard


class WheelByHand(DeviceFault):
    """A wheel or slider that somebody moves one slot on, by the button on it."""

    needs: ClassVar[tuple[type, ...]] = (HasButton,)

    fault: Literal["wheel_by_hand"] = Field(description="the fault's name")

    def strike(self, board: Switchboard, random: Random, time_s: float) -> None:
        """Press the button."""
        device = board.device(self.device)
        assert isinstance(device, HasButton)
        device.press(time_s)
