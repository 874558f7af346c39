"""A Thorlabs power meter on the bench."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Literal

from pydantic import Field

from sim_devices.bench_devices.entry import SimulatedDevice
from sim_devices.device import Device
from sim_devices.thorlabs_pm100.meter import ThorlabsPm100

if TYPE_CHECKING:
    from sim_devices.world import World


class ThorlabsPm100Device(SimulatedDevice):
    """A Thorlabs power meter that accepts light from the solid angle `acceptance_sr`."""

    part: ClassVar[str] = "detector"

    type: Literal["thorlabs_pm100"] = Field(description="the device's family")
    acceptance_sr: float = Field(gt=0, le=0.1, description="solid angle that the detector accepts, in sr")

    def install(self, world: World) -> Device:
        """Put the meter at the end of the beam."""
        world.acceptance_sr = self.acceptance_sr
        return ThorlabsPm100(world)
