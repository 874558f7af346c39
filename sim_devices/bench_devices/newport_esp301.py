"""A Newport ESP301 on the bench."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

from pydantic import Field

from sim_devices.bench_devices.entry import AxisRole, SimulatedDevice
from sim_devices.device import Device
from sim_devices.newport_esp301.controller import NewportEsp301
from sim_devices.newport_esp301.stages import STAGES

if TYPE_CHECKING:
    from sim_devices.world import World


class NewportEsp301Device(SimulatedDevice):
    """A Newport ESP301 controller; `axes` says which arm each of its axes turns."""

    part: ClassVar[str] = "axes"

    type: Literal["newport_esp301"] = Field(description="the device's family")
    axes: dict[Annotated[int, Field(ge=1, le=3)], AxisRole] = Field(
        min_length=1, description="which arm each of the controller's axes turns, by the axis' number"
    )

    stage: Literal["URS75CC", "URS100CC", "URS150CC", "PR50CC", "SR50CC"] = Field(
        default="URS150CC", description="model of its stages"
    )
    limit_switches_deg: float | None = Field(
        default=175.0, gt=0, le=3600, description="where each stage has a limit switch on either side; null: nowhere"
    )
    baudrate: Literal[19200, 921600] = Field(default=921600, description="of its port: USB has 921600, RS-232 19200")

    def roles(self) -> tuple[AxisRole, ...]:
        """The axes that it turns."""
        return tuple(self.axes.values())

    def install(self, world: World) -> Device:
        """Put its axes into the world."""
        stage = STAGES[self.stage]
        return NewportEsp301(
            {number: world.add_axis(role, stage.step_deg) for number, role in self.axes.items()},
            stage=stage,
            switches_deg=math.inf if self.limit_switches_deg is None else self.limit_switches_deg,
            baudrate=self.baudrate,
        )
