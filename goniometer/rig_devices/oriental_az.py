"""Oriental Motor AZ in a rig file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

from pydantic import Field

from drivers.oriental_az import OrientalAz
from goniometer.rig_devices.connecting import Connecting
from goniometer.rig_devices.entry import AxesEntry, AxisEntry, Role


class OrientalAzAxis(AxisEntry):
    """The axis of an Oriental Motor AZ drive."""

    steps_per_deg: float = Field(gt=0, le=1_000_000, description="motor steps in one degree of the stage")


class OrientalAzEntry(AxesEntry):
    """Oriental Motor AZ stepper drive on Modbus RTU."""

    driver: Literal["oriental_az"] = Field(description="the device's family")
    unit: int = Field(ge=1, le=31, description="Modbus address, as set by the drive's switch")
    baudrate: Literal[9600, 19200, 38400, 57600, 115200, 230400] = Field(
        default=115200, description="as set in the drive; without effect on a socket"
    )
    parity: Literal["even", "odd", "none"] = Field(
        default="even", description="as set in the drive; without effect on a socket"
    )
    axes: dict[Role, OrientalAzAxis] = Field(min_length=1, max_length=1, description="the drive's axis, by role")

    def axes_by_role(self) -> Mapping[Role, AxisEntry]:
        """Its axis."""
        return self.axes

    def connect(self, name: str, bench: Connecting) -> None:
        """Connect the drive."""
        for role, axis in self.axes.items():
            stage = bench.opened(
                OrientalAz(
                    bench.ports[name],
                    bench.clock,
                    name=role,
                    unit=self.unit,
                    steps_per_deg=axis.steps_per_deg,
                    limits_deg=axis.limits_deg,
                    settle_s=axis.settle_s,
                    tolerance_deg=axis.tolerance_deg,
                    velocity_deg_s=axis.velocity_deg_s,
                    acceleration_deg_s2=axis.acceleration_deg_s2,
                    baudrate=self.baudrate,
                    parity=self.parity[0].upper(),
                )
            )
            stage.connect()
            bench.axes[role] = stage
