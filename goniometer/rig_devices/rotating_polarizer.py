"""A polarizer on one of the rig's rotators in a rig file."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from acquisition.section import SectionFault, refuse_all
from acquisition.timing import AnalyzerTiming, AxisTiming, RotatorTiming
from drivers.rotating_analyzer import RotatingAnalyzer, SlotAngles
from goniometer.rig_devices.connecting import Connecting
from goniometer.rig_devices.entry import AnalyzerEntry, Angle, Role, Slot, angle_faults

_CARRIER: Role = "polarizer"


class RotatingPolarizerEntry(AnalyzerEntry):
    """A polarizer on the rotator that another device of the rig turns as its axis `polarizer`."""

    driver: Literal["rotating_polarizer"] = Field(description="the analyzer's kind")
    port: str = Field(default="", max_length=0, description="left out: the rotator has the port")
    slots: dict[Annotated[int, Field(ge=1, le=64)], Angle] = Field(
        min_length=3, description="the angles that are used, in degrees, each under a number of your choice"
    )

    @model_validator(mode="after")
    def _check_slots(self) -> Self:
        refuse_all(self._slot_faults())
        return self

    def _slot_faults(self) -> Iterator[SectionFault]:
        yield from angle_faults(self.slots)

    @property
    def carried_by(self) -> tuple[Role, ...]:
        """The rotator."""
        return (_CARRIER,)

    def contents(self) -> Mapping[int, Slot]:
        """The angles."""
        return self.slots

    def timing(self, axes: Mapping[Role, AxisTiming]) -> AnalyzerTiming:
        """The rotator goes from angle to angle."""
        return RotatorTiming(self.slots, axes[_CARRIER])

    def connect(self, name: str, bench: Connecting) -> None:
        """Take the rotator, which is connected already."""
        slots = {slot: SlotAngles(angle_deg) for slot, angle_deg in self.slots.items()}
        bench.analyzers[name] = RotatingAnalyzer(bench.axes[_CARRIER], name=name, slots=slots)
