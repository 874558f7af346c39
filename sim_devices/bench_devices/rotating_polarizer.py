"""A polarizer on one of the bench's rotators, as analyzer."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Literal

from pydantic import Field

from sim_devices.analyzer import RotatingPolarizer
from sim_devices.bench_devices.entry import SimulatedDevice

if TYPE_CHECKING:
    from sim_devices.world import World


class RotatingPolarizerDevice(SimulatedDevice):
    """A polarizer that the device with the axis `polarizer` turns; it has no port of its own."""

    part: ClassVar[str] = "analyzer"

    type: Literal["rotating_polarizer"] = Field(description="the device's family")

    def install(self, world: World) -> None:
        """Put the polarizer into the beam."""
        world.analyzer = RotatingPolarizer(world.axes["polarizer"])
