"""A polarizer, and perhaps a retarder before it, on one or two of the bench's rotators, as analyzer."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Literal

from pydantic import Field

from sim_devices.analyzer import RotatingPolarizer
from sim_devices.axis import AngleOfTime
from sim_devices.bench_devices.entry import SimulatedDevice
from sim_devices.turning import TurningRow

if TYPE_CHECKING:
    from sim_devices.world import World

_FIXED = "is fixed, in degrees from s; without it, the device with the axis of that name turns it"


class RotatingPolarizerDevice(SimulatedDevice):
    """A polarizer, perhaps behind a retarder; it has no port of its own."""

    part: ClassVar[str] = "analyzer"

    type: Literal["rotating_polarizer"] = Field(description="the device's family")
    polarizer_deg: float | None = Field(default=None, ge=-360, le=360, description=f"where the polarizer {_FIXED}")
    retardance_deg: float | None = Field(
        default=None,
        gt=0,
        lt=360,
        description="true retardance of the retarder before the polarizer, in degrees; without it there is none",
    )
    retarder_deg: float | None = Field(
        default=None, ge=-360, le=360, description=f"where the retarder's fast axis {_FIXED}"
    )

    def turns(self) -> set[str]:
        """What turns."""
        has_retarder = self.retardance_deg is not None and self.retarder_deg is None
        return {*(["polarizer"] if self.polarizer_deg is None else []), *(["retarder"] if has_retarder else [])}

    def install(self, world: World) -> None:
        """Put polarizer and retarder into the beam."""
        polarizer_deg = where(world, "polarizer", self.polarizer_deg)
        world.turning = TurningRow([world.axes[role].motor_deg for role in sorted(self.turns())])
        if self.retardance_deg is None:
            world.analyzer = RotatingPolarizer(polarizer_deg)
        else:
            retarder_deg = where(world, "retarder", self.retarder_deg)
            world.analyzer = RotatingPolarizer(polarizer_deg, retarder_deg, self.retardance_deg)


def where(world: World, role: str, fixed_deg: float | None) -> AngleOfTime:
    """Where an element stands at a time, in degrees: fixed, or turned by the axis of that role."""
    if fixed_deg is None:
        return world.axes[role].motor_deg
    return lambda time_s: fixed_deg
