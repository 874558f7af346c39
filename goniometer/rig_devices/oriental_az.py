"""Oriental Motor AZ in a rig file."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Literal

from pydantic import Field

from acquisition.section import SectionFault
from drivers.modbus.unit import ModbusUnit
from drivers.oriental_az.stage import OrientalAz
from goniometer.rig_devices.connecting import Connecting
from goniometer.rig_devices.entry import AxesEntry, AxisEntry, Role
from sim_devices.bench_devices.entry import SimulatedDevice
from sim_devices.bench_devices.oriental_az import OrientalAzDevice


class OrientalAzAxis(AxisEntry):
    """The axis of an Oriental Motor AZ drive."""

    steps_per_deg: float = Field(gt=0, le=1_000_000, description="motor steps in one degree of the stage")


class OrientalAzEntry(AxesEntry):
    """Oriental Motor AZ stepper drive on Modbus RTU, or Modbus TCP by a gateway."""

    driver: Literal["oriental_az"] = Field(description="the device's family")
    unit: int = Field(ge=1, le=31, description="Modbus address, as set by the drive's switch")
    baudrate: Literal[9600, 19200, 38400, 57600, 115200, 230400] = Field(
        default=115200, description="as set in the drive; without effect on a socket"
    )
    parity: Literal["even", "odd", "none"] = Field(
        default="even", description="as set in the drive; without effect on a socket"
    )
    axes: dict[Role, OrientalAzAxis] = Field(min_length=1, max_length=1, description="the drive's axis, by role")

    exchange_s = 0.003
    start_s = 0.016

    @property
    def place(self) -> str | None:
        """Its address on the line."""
        return f"unit {self.unit}"

    @property
    def line(self) -> str:
        """Modbus, of whatever make, at one speed and parity."""
        return f"Modbus at {self.baudrate} baud, parity {self.parity}"

    def connect(self, name: str, bench: Connecting) -> None:
        """Connect the drive."""
        port = bench.modbus(name, baudrate=self.baudrate, parity=self.parity[0].upper())
        for role, axis in self.axes.items():
            stage = OrientalAz(
                ModbusUnit(port, self.unit, device=name),
                bench.clock,
                name=role,
                steps_per_deg=axis.steps_per_deg,
                velocity_deg_s=axis.velocity_deg_s,
                acceleration_deg_s2=axis.acceleration_deg_s2,
                may_reset_home_alarm=role in bench.to_home,
            )
            bench.add_axis(name, role, stage, axis.travel)

    def unlike(self, simulated: SimulatedDevice) -> Iterator[SectionFault]:
        """Whether the unit, the axis and its step are the same."""
        assert isinstance(simulated, OrientalAzDevice)
        if simulated.unit != self.unit:
            yield ("unit",), f"got {simulated.unit}; allowed: {self.unit}"
        if simulated.axis not in self.axes:
            yield ("axis",), f"got {simulated.axis}; allowed: {', '.join(self.axes)}"
        for axis in self.axes.values():
            if not math.isclose(simulated.step_deg * axis.steps_per_deg, 1.0, rel_tol=1e-6):
                step_deg = 1 / axis.steps_per_deg
                yield ("step_deg",), f"got {simulated.step_deg:g}; allowed: {step_deg:g}, which is 1 / steps_per_deg"
