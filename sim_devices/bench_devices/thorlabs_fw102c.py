"""A Thorlabs wheel of polarizers on the bench."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Literal

from pydantic import Field, model_validator

from sim_devices.analyzer import WheelAnalyzer
from sim_devices.bench_devices.entry import SimulatedDevice, Slot
from sim_devices.device import Device
from sim_devices.thorlabs_fw102c import ThorlabsFw102c

if TYPE_CHECKING:
    from sim_devices.world import World


class ThorlabsFw102cDevice(SimulatedDevice):
    """A Thorlabs wheel; `slots` gives the true angle of the polarizer in each slot, in degrees from s."""

    part: ClassVar[str] = "analyzer"

    type: Literal["thorlabs_fw102c"] = Field(description="the device's family")
    slots: dict[int, Slot] = Field(
        description="what each slot truly holds: a polarizer's angle from s in degrees, open, or blocked"
    )

    @model_validator(mode="after")
    def _fills_a_wheel(self) -> ThorlabsFw102cDevice:
        if sorted(self.slots) not in (list(range(1, 7)), list(range(1, 13))):
            given = ", ".join(str(slot) for slot in sorted(self.slots)) or "none"
            raise ValueError(f"a wheel has slots 1 to 6, or 1 to 12, and each must be given; here are {given}")
        return self

    def install(self, world: World) -> Device:
        """Put the wheel into the beam."""
        world.analyzer = analyzer = WheelAnalyzer(self.slots, world.past.turns)
        return ThorlabsFw102c(analyzer.wheel, self.slots)
