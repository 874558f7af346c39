"""SMC LEC with a LER table in a rig file."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal

from pydantic import Field

from acquisition.section import SectionFault
from drivers.modbus.unit import ModbusUnit
from drivers.smc_lec.registers import LecRegisters
from drivers.smc_lec.stage import SmcLec
from goniometer.rig_devices.connecting import Connecting
from goniometer.rig_devices.entry import AxesEntry, AxisEntry, Role
from sim_devices.bench_devices.entry import SimulatedDevice
from sim_devices.bench_devices.smc_lec import SmcLecDevice


class SmcLecEntry(AxesEntry):
    """SMC LEC controller of a LER rotary table, on Modbus RTU or, by a gateway, Modbus TCP."""

    driver: Literal["smc_lec"] = Field(description="the device's family")
    unit: int = Field(ge=1, le=247, description="Modbus address, as set in the controller")
    baudrate: Literal[9600, 19200, 38400, 57600, 115200] = Field(
        default=38400, description="as set in the controller; without effect on a socket"
    )
    alarm_is_one: bool = Field(default=True, description="whether the ALARM input is 1, or 0, while there is an alarm")
    mode_in_high_byte: bool = Field(
        default=False, description="whether the firmware expects the movement mode in the upper half of its register"
    )
    axes: dict[Role, AxisEntry] = Field(min_length=1, max_length=1, description="the table's axis, by role")

    @property
    def place(self) -> str | None:
        """Its address on the line."""
        return f"unit {self.unit}"

    @property
    def line(self) -> str:
        """Modbus, of whatever make, at one speed and parity."""
        return f"Modbus at {self.baudrate} baud, parity none"

    exchange_s = 0.011
    start_s = 0.065

    def connect(self, name: str, bench: Connecting) -> None:
        """Connect the controller and switch its servo on."""
        port = bench.modbus(name, baudrate=self.baudrate, parity="N")
        for role, axis in self.axes.items():
            stage = SmcLec(
                ModbusUnit(port, self.unit, device=name),
                bench.clock,
                name=role,
                velocity_deg_s=axis.velocity_deg_s,
                acceleration_deg_s2=axis.acceleration_deg_s2,
                registers=LecRegisters(
                    alarm_level=self.alarm_is_one, absolute_word=0x0100 if self.mode_in_high_byte else 0x0001
                ),
                may_reset_alarm=role in bench.to_home,
            )
            bench.add_axis(name, role, stage, axis.travel)

    def unlike(self, simulated: SimulatedDevice) -> Iterator[SectionFault]:
        """Whether the unit, the axis and the sense of its alarm are the same."""
        assert isinstance(simulated, SmcLecDevice)
        if simulated.unit != self.unit:
            yield ("unit",), f"got {simulated.unit}; allowed: {self.unit}"
        if simulated.axis not in self.axes:
            yield ("axis",), f"got {simulated.axis}; allowed: {', '.join(self.axes)}"
        if simulated.alarm_is_one != self.alarm_is_one:
            yield ("alarm_is_one",), f"got {simulated.alarm_is_one}; allowed: {self.alarm_is_one}"
