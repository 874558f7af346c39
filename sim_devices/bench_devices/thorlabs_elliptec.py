"""Thorlabs Elliptec modules on the bench: rotators, and sliders of polarizers."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

from pydantic import Field, model_validator

from sim_devices.analyzer import WheelAnalyzer
from sim_devices.bench_devices.entry import AxisRole, SimulatedDevice, Slot
from sim_devices.device import Device
from sim_devices.thorlabs_elliptec.bus import ThorlabsElliptec
from sim_devices.thorlabs_elliptec.rotator import ELL8, ELL14, ELL18, PULSES_PER_TURN, ElliptecRotator
from sim_devices.thorlabs_elliptec.slider import ELL6, ELL9, ElliptecSlider

if TYPE_CHECKING:
    from sim_devices.world import World

Address = Annotated[str, Field(pattern="^[0-9A-F]$", description="the module's address, one hexadecimal digit")]


class ThorlabsElliptecDevice(SimulatedDevice):
    """An ELL14, ELL18 or ELL8 rotator."""

    part: ClassVar[str] = "axes"

    type: Literal["thorlabs_elliptec"] = Field(description="the device's family")
    model: Literal["ELL14", "ELL18", "ELL8"] = Field(default="ELL14", description="model of the rotator")
    address: Address = "0"
    axis: AxisRole = Field(description="what the rotator turns")

    def roles(self) -> tuple[AxisRole, ...]:
        """The axis that it turns."""
        return (self.axis,)

    @property
    def place(self) -> tuple[str, str]:
        """Its address on the bus."""
        return "Elliptec", f"address {self.address}"

    def install(self, world: World) -> Device:
        """Put its axis into the world."""
        type_code = {"ELL14": ELL14, "ELL18": ELL18, "ELL8": ELL8}[self.model]
        axis = world.add_axis(self.axis, 360 / PULSES_PER_TURN[type_code])
        rotator = ElliptecRotator(axis, type_code, seed=world.scene.seed, turns=world.past.turns)
        return ThorlabsElliptec(rotator, self.address)


class ThorlabsElliptecSliderDevice(SimulatedDevice):
    """An ELL9 or ELL6 slider; `slots` gives the true angle of the polarizer in each slot, in degrees from s."""

    part: ClassVar[str] = "analyzer"

    type: Literal["thorlabs_elliptec_slider"] = Field(description="the device's family")
    address: Address = "0"
    slots: dict[int, Slot] = Field(
        description="what each of the four slots (ELL9) or two (ELL6) truly holds: an angle in degrees, open or blocked"
    )

    @model_validator(mode="after")
    def _fills_a_slider(self) -> ThorlabsElliptecSliderDevice:
        if sorted(self.slots) not in ([1, 2], [1, 2, 3, 4]):
            raise ValueError("a slider has slots 1 and 2, or 1 to 4, and each must be given")
        return self

    @property
    def place(self) -> tuple[str, str]:
        """Its address on the bus."""
        return "Elliptec", f"address {self.address}"

    def install(self, world: World) -> Device:
        """Put the slider into the beam."""
        world.analyzer = analyzer = WheelAnalyzer(self.slots, world.past.turns)
        type_code = ELL9 if len(self.slots) == 4 else ELL6
        return ThorlabsElliptec(ElliptecSlider(analyzer.wheel, type_code), self.address)
