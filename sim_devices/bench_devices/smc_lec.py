"""An SMC LEC controller with a LER table on the bench."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

from pydantic import Field

from sim_devices.bench_devices.entry import AxisRole, ModbusDevice
from sim_devices.smc_lec.controller import SmcLec

if TYPE_CHECKING:
    from sim_devices.world import World

# the controller counts hundredths of a degree
_STEP_DEG = 0.01


class SmcLecDevice(ModbusDevice):
    """An SMC LEC controller; `unit` is its Modbus address."""

    part: ClassVar[str] = "axes"

    type: Literal["smc_lec"] = Field(description="the device's family")
    axis: AxisRole = Field(description="what the table turns")
    travel_deg: Annotated[tuple[float, float], Field(strict=False)] = Field(
        default=(-180.0, 180.0), description="least and greatest position of the table, in degrees"
    )
    top_speed_deg_s: float = Field(default=420.0, gt=0, le=1000, description="greatest speed, in degrees per second")
    alarm_is_one: bool = Field(default=True, description="whether the ALARM input is 1, or 0, while there is an alarm")

    def roles(self) -> tuple[AxisRole, ...]:
        """The axis that it turns."""
        return (self.axis,)

    def controller(self, world: World) -> SmcLec:
        """Put its axis into the world."""
        return SmcLec(
            self.unit,
            world.add_axis(self.axis, _STEP_DEG),
            travel_deg=self.travel_deg,
            top_speed_deg_s=self.top_speed_deg_s,
            alarm_is_one=self.alarm_is_one,
        )
