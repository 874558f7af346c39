"""A simulated SMC LEC controller with an LER rotary table: coils, inputs and registers on Modbus."""

from __future__ import annotations

import struct
from collections.abc import Callable

from sim_devices.axis import Axis
from sim_devices.modbus import functions as modbus
from sim_devices.modbus.rtu import RtuSession
from sim_devices.smc_lec import registers as lec
from sim_devices.smc_lec.registers import Coil, InputBit, Register
from sim_devices.smc_lec.table import LecTable

_TAKE_S = 0.01


class SmcLec:
    """A controller after power-on, on one unit of a bus.

    Its coils do nothing until serial mode is on. No step data are stored, so that DRIVE raises an alarm; a push force
    is taken, and the table moves as without.

    Parameters
    ----------
    unit : int
        Its Modbus address.
    axis : Axis
        The table that it turns; 0 deg of the axis is the table's origin.
    travel_deg : (float, float)
        Least and greatest position of the table; one that turns 320 deg has for example -160 and 160.
    top_speed_deg_s : float
        Greatest speed of the table: 420 for the basic type, 280 for the one with high torque.
    alarm_is_one : bool
        Whether the ALARM input is 1, or 0, while there is an alarm.
    """

    latency_s = 0.004
    # 38400 baud, eight bits with start and stop
    character_s = 10 / 38_400

    def __init__(
        self,
        unit: int,
        axis: Axis,
        *,
        travel_deg: tuple[float, float] = (-180.0, 180.0),
        top_speed_deg_s: float = 420.0,
        alarm_is_one: bool = True,
    ) -> None:
        self.unit = unit
        self._alarm_is_one = alarm_is_one
        self._table = table = LecTable(axis, travel_deg, top_speed_deg_s)
        self._forget()
        self._functions = {
            0x01: modbus.read_bits(self._read_coils),
            0x02: modbus.read_bits(self._read_inputs),
            0x03: modbus.read_registers(self._read_registers),
            0x05: modbus.write_bit(self._write_coils),
            0x08: modbus.loop_back,
            0x0F: modbus.write_bits(self._write_coils),
            0x10: modbus.write_registers(self._write_registers),
        }
        # what a coil does when it changes, in the order in which coils that change together do it
        self._actions: dict[Coil, Callable[[bool, float], None]] = {
            Coil.RESET: table.reset,
            Coil.SVON: table.servo,
            Coil.HOLD: table.hold,
            Coil.SETUP: table.home,
            Coil.DRIVE: self._drive_step,
            Coil.JOG_MINUS: lambda is_on, now_s: table.jog(-is_on, now_s),
            Coil.JOG_PLUS: table.jog,
        }

    def _forget(self) -> None:
        self._coils = dict.fromkeys(lec.NAMED_COILS, 0)
        self._numbers = {int(register): 0 for register in Register if register in lec.WRITABLE_REGISTERS}
        self._taken_s = float("inf")

    def session(self) -> RtuSession:
        """A new client on the serial line."""
        return RtuSession(self)

    def answer(self, request: bytes, now_s: float) -> bytes:
        """Run a request, from its function on, and return its answer."""
        return modbus.answer(self._functions, request, now_s)

    def note_bad_frame(self) -> None:
        """Bytes came that are no frame; the controller keeps no record."""

    def power_cycle(self, now_s: float) -> None:
        """Lose the torque, the origin, every coil and every register."""
        self._table.power_cycle(now_s)
        self._forget()

    def trip(self, now_s: float) -> None:
        """Let a protection raise an alarm and take the torque."""
        self._table.trip(now_s)

    def emergency(self, is_on: bool, now_s: float) -> None:
        """Press or release the emergency stop."""
        self._table.emergency(is_on, now_s)

    def _read_coils(self, address: int, count: int, now_s: float) -> list[int]:
        coils = _inside(lec.COILS, address, count)
        return [self._coils.get(coil, 0) for coil in coils]

    def _read_inputs(self, address: int, count: int, now_s: float) -> list[int]:
        table = self._table
        states: dict[int, bool] = {
            InputBit.BUSY: table.is_busy(now_s),
            InputBit.SVRE: table.is_ready(now_s),
            InputBit.SETON: table.is_homed(now_s),
            InputBit.INP: table.is_in_position(now_s),
            InputBit.AREA: table.is_in_area(now_s),
            InputBit.ESTOP: table.is_emergency,
            InputBit.ALARM: table.has_alarm == self._alarm_is_one,
        }
        return [int(states.get(place, False)) for place in _inside(lec.INPUTS, address, count)]

    def _write_coils(self, address: int, values: list[int], now_s: float) -> None:
        written = dict(zip(_inside(lec.COILS, address, len(values)), values, strict=True))
        self._coils[Coil.SERIAL_MODE] = written.get(Coil.SERIAL_MODE, self._coils[Coil.SERIAL_MODE])
        if not self._coils[Coil.SERIAL_MODE]:
            return
        before = dict(self._coils)
        self._coils |= {coil: value for coil, value in written.items() if coil in lec.NAMED_COILS}
        for coil, act in self._actions.items():
            if self._coils[coil] != before[coil]:
                act(bool(self._coils[coil]), now_s)

    def _drive_step(self, is_on: bool, now_s: float) -> None:
        if is_on:
            self._table.start(None, now_s)

    def _read_registers(self, address: int, count: int, now_s: float) -> list[int]:
        _whole(_inside(lec.REGISTERS, address, count))
        words = {
            register + place: word
            for register, number in (self._numbers | self._present(now_s)).items()
            for place, word in enumerate(lec.words(register, number))
        }
        return [words.get(register, 0) for register in range(address, address + count)]

    def _present(self, now_s: float) -> dict[int, int]:
        """The state, and the start, which goes back to 0 when it has been taken."""
        return {
            Register.START: 0 if now_s >= self._taken_s else self._numbers[Register.START],
            Register.POSITION: round(100 * self._table.position_deg(now_s)),
            Register.SPEED: round(self._table.speed_deg_s(now_s)),
            Register.TARGET: round(100 * self._table.target_deg),
        }

    def _write_registers(self, address: int, values: list[int], now_s: float) -> None:
        registers = _whole(_inside(lec.WRITABLE_REGISTERS, address, len(values)))
        written = dict(zip(registers, values, strict=True))
        for register in self._numbers:
            if register in written and register in lec.LONG:
                (self._numbers[register],) = struct.unpack(
                    ">i", struct.pack(">HH", written[register], written[register + 1])
                )
            elif register in written:
                self._numbers[register] = written[register]
        if Register.START in written:
            self._start(now_s)

    def _start(self, now_s: float) -> None:
        """Begin what the registers say. A start that the controller does not take stays in its register."""
        self._taken_s = float("inf")
        if self._coils[Coil.SERIAL_MODE] and self._numbers[Register.START] in lec.STARTS:
            operation = lec.operation(self._numbers)
            if self._table.start(operation, now_s):
                self._taken_s = now_s + _TAKE_S


def _inside(block: range, address: int, count: int) -> range:
    """The addresses of a request; all of them must be in the block."""
    if address not in block or address + count - 1 not in block:
        raise modbus.ModbusError(2)
    return range(address, address + count)


def _whole(registers: range) -> range:
    """The same registers; refused when they hold one half only of a number that fills two."""
    if registers[0] - 1 in lec.LONG or registers[-1] in lec.LONG:
        raise modbus.ModbusError(2)
    return registers
