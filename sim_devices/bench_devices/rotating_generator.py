"""A polarizer, and perhaps a retarder behind it, in the source arm, as generator of polarization states."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Literal

from pydantic import Field

from sim_devices.bench_devices.rotating_polarizer import RotatingPolarizerDevice, where
from sim_devices.generator import RotatingGenerator

if TYPE_CHECKING:
    from sim_devices.world import World


class RotatingGeneratorDevice(RotatingPolarizerDevice):
    """As the analyzer of that kind, on rotators of its own; the light passes the polarizer first."""

    part: ClassVar[str] = "generator"

    type: Literal["rotating_generator"] = Field(description="the device's family")  # type: ignore[assignment]

    def install(self, world: World) -> None:
        """Put polarizer and retarder between lamp and sample."""
        polarizer_deg = where(world, "generator_polarizer", self.polarizer_deg)
        if self.retardance_deg is None:
            world.generator = RotatingGenerator(polarizer_deg)
        else:
            retarder_deg = where(world, "generator_retarder", self.retarder_deg)
            world.generator = RotatingGenerator(polarizer_deg, retarder_deg, self.retardance_deg)
