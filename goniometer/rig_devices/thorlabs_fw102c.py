"""Thorlabs FW102C and FW212C in a rig file."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from acquisition.section import SectionFault, refuse_all
from acquisition.timing import AnalyzerTiming, AxisTiming, WheelTiming
from drivers.thorlabs_fw102c import ThorlabsFw102c
from goniometer.rig_devices.connecting import Connecting
from goniometer.rig_devices.entry import AnalyzerEntry, Role, SettleTime, Slot, SlotTime, slot_faults
from sim_devices.bench_devices.entry import SimulatedDevice
from sim_devices.bench_devices.thorlabs_fw102c import ThorlabsFw102cDevice

WHEEL_SIZES = (6, 12)
"""Positions of the FW102C and of the FW212C."""


class ThorlabsFw102cEntry(AnalyzerEntry):
    """Thorlabs FW102C or FW212C filter wheel with polarizers in its slots."""

    driver: Literal["thorlabs_fw102c"] = Field(description="the device's family")
    baudrate: Literal[9600, 115200] = Field(
        default=115200, description="as set in the wheel; without effect on a socket"
    )
    slots: dict[Annotated[int, Field(ge=1, le=12)], Slot] = Field(
        description="what each of the 6 or 12 slots holds: a polarizer's angle in degrees, open, or blocked"
    )
    slot_s: SlotTime
    settle_s: SettleTime

    @model_validator(mode="after")
    def _check_slots(self) -> Self:
        refuse_all(slot_faults(self.slots, WHEEL_SIZES, "wheel"))
        return self

    def contents(self) -> Mapping[int, Slot]:
        """What each slot holds."""
        return self.slots

    def timing(self, axes: Mapping[Role, AxisTiming]) -> AnalyzerTiming:
        """The wheel goes the shorter way round."""
        return WheelTiming(len(self.slots), self.slot_s, self.settle_s)

    def connect(self, name: str, bench: Connecting) -> None:
        """Connect the wheel."""
        wheel = ThorlabsFw102c(
            bench.link(name, baudrate=self.baudrate),
            bench.clock,
            name=name,
            slots=len(self.slots),
            slot_s=self.slot_s,
            settle_s=self.settle_s,
        )
        bench.add(name, wheel)
        bench.analyzers[name] = wheel

    def unlike(self, simulated: SimulatedDevice) -> Iterator[SectionFault]:
        """Whether the wheels are of one size."""
        assert isinstance(simulated, ThorlabsFw102cDevice)
        if len(simulated.slots) != len(self.slots):
            yield ("slots",), f"hold {len(simulated.slots)} slots; allowed: {len(self.slots)}"
