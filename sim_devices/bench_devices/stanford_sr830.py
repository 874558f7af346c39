"""A Stanford Research SR830 lock-in with a photodiode behind a chopper on the bench."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Literal

from pydantic import Field

from sim_devices.bench_devices.entry import SimulatedDevice
from sim_devices.chopper import Chopper
from sim_devices.device import Device
from sim_devices.stanford_sr830.instrument import StanfordSr830

if TYPE_CHECKING:
    from sim_devices.world import World


class StanfordSr830Device(SimulatedDevice):
    """A lock-in whose photodiode accepts light from the solid angle `acceptance_sr`; the lamp is chopped."""

    part: ClassVar[str] = "detector"

    type: Literal["stanford_sr830"] = Field(description="the device's family")
    acceptance_sr: float = Field(gt=0, le=0.1, description="solid angle that the photodiode accepts, in sr")
    volts_per_watt: float = Field(
        gt=0,
        le=1e12,
        description="rms voltage at the chopper's frequency for each watt that reaches the photodiode through it",
    )
    phase_deg: float = Field(default=0.0, ge=-180, le=180, description="phase against the chopper, in degrees")
    chopper_hz: float = Field(default=173.0, ge=0.001, le=102000, description="frequency of the chopper, in Hz")

    baudrate: Literal[300, 600, 1200, 2400, 4800, 9600, 19200] = Field(default=9600, description="of its serial line")

    def install(self, world: World) -> Device:
        """Put the photodiode at the end of the beam."""
        world.acceptance_sr = self.acceptance_sr
        return StanfordSr830(
            Chopper(world),
            volts_per_watt=self.volts_per_watt,
            phase_deg=self.phase_deg,
            chopper_hz=self.chopper_hz,
            baudrate=self.baudrate,
        )
