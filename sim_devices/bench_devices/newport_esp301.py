"""A Newport ESP301 on the bench."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

from pydantic import Field

from sim_devices.bench_devices.entry import AxisRole, SimulatedDevice
from sim_devices.device import Device
from sim_devices.newport_esp301.controller import NewportEsp301

if TYPE_CHECKING:
    from sim_devices.world import World

# Newport URS stages resolve 0.0005 deg
_STEP_DEG = 0.0005


class NewportEsp301Device(SimulatedDevice):
    """A Newport ESP301 controller; `axes` says which arm each of its axes turns."""

    part: ClassVar[str] = "axes"

    type: Literal["newport_esp301"] = Field(description="the device's family")
    axes: dict[Annotated[int, Field(ge=1, le=3)], AxisRole] = Field(
        min_length=1, description="which arm each of the controller's axes turns, by the axis' number"
    )

    def roles(self) -> tuple[AxisRole, ...]:
        """The axes that it turns."""
        return tuple(self.axes.values())

    def install(self, world: World) -> Device:
        """Put its axes into the world."""
        return NewportEsp301({number: world.add_axis(role, _STEP_DEG) for number, role in self.axes.items()})
