"""An Oriental Motor AZ drive on the bench."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Literal

from pydantic import Field

from sim_devices.bench_devices.entry import AxisRole, ModbusDevice
from sim_devices.oriental_az.drive import OrientalAz

if TYPE_CHECKING:
    from sim_devices.world import World


class OrientalAzDevice(ModbusDevice):
    """An Oriental Motor AZ drive; `unit` is its Modbus address and `step_deg` one step of its motor at the table."""

    part: ClassVar[str] = "axes"

    type: Literal["oriental_az"] = Field(description="the device's family")
    axis: AxisRole = Field(description="what the drive turns")
    step_deg: float = Field(ge=1e-4, le=1, description="one motor step at the table, in degrees")

    baudrate: Literal[9600, 19200, 38400, 57600, 115200, 230400] = Field(
        default=115200, description="of its serial line"
    )

    def roles(self) -> tuple[AxisRole, ...]:
        """The axis that it turns."""
        return (self.axis,)

    def controller(self, world: World) -> OrientalAz:
        """Put its axis into the world."""
        return OrientalAz(self.unit, world.add_axis(self.axis, self.step_deg), baudrate=self.baudrate)
