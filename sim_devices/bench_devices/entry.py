"""What a scene's devices have in common: a type, a part to play, and a place on the bench."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal, Protocol

from pydantic import Field

from sim_devices.device import Device
from sim_devices.modbus.functions import Unit
from sim_devices.modbus.tcp import ModbusTcp
from sim_devices.scene_part import ScenePart

if TYPE_CHECKING:
    from sim_devices.world import World


class ModbusController(Unit, Device, Protocol):
    """A unit that also answers on a serial line of its own."""


AxisRole = Literal[
    "source_arm",
    "detector_arm",
    "sample_azimuth",
    "detector_azimuth",
    "polarizer",
    "retarder",
    "generator_polarizer",
    "generator_retarder",
]
Slot = Literal["open", "blocked"] | Annotated[float, Field(ge=-180, le=180)]


class SimulatedDevice(ScenePart, ABC):
    """A device; a subclass names its family in `type`, a literal with one value."""

    part: ClassVar[str]
    """What it does on the bench: "axes", "analyzer", "generator" or "detector"."""

    type: str
    line: str | None = Field(
        default=None,
        min_length=1,
        description="name of the serial line, where several devices with addresses share one port",
    )

    def roles(self) -> tuple[AxisRole, ...]:
        """The axes of the bench that it turns."""
        return ()

    @property
    def scheme(self) -> str:
        """How its port is addressed over TCP."""
        return "socket"

    @property
    def place(self) -> tuple[str, str] | None:
        """What its line speaks, and its address there; None for a device that needs a port to itself."""
        return None

    @abstractmethod
    def install(self, world: World) -> Device | None:
        """Put its axes, its optics or its acceptance into the world, and return what answers at its port, if any."""


class ModbusDevice(SimulatedDevice):
    """A Modbus unit, on a serial line or behind a gateway for Modbus TCP."""

    unit: int = Field(ge=1, le=31, description="Modbus address")
    framing: Literal["rtu", "tcp"] = Field(default="rtu", description="rtu, as on a serial line, or tcp, by a gateway")

    @property
    def scheme(self) -> str:
        """How its port is addressed over TCP."""
        return "socket" if self.framing == "rtu" else "modbus-tcp"

    @property
    def place(self) -> tuple[str, str]:
        """Its framing and its unit number."""
        return f"Modbus {self.framing.upper()}", f"unit {self.unit}"

    @abstractmethod
    def controller(self, world: World) -> ModbusController:
        """Put its axis into the world, and return what turns it."""

    def install(self, world: World) -> Device:
        """Put its axis into the world; at its port answers the unit itself, or its gateway."""
        controller = self.controller(world)
        return controller if self.framing == "rtu" else ModbusTcp([controller])
