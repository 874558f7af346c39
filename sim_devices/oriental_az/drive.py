"""A simulated Oriental Motor AZ drive: what it answers from its registers, and what written ones start."""

from __future__ import annotations

from collections.abc import Iterable

from sim_devices.axis import Axis
from sim_devices.modbus import functions as modbus
from sim_devices.modbus.rtu import RtuSession
from sim_devices.oriental_az.operations import OVERTRAVEL_ALARM, AzOperations
from sim_devices.oriental_az.registers import (
    DEFAULTS,
    WRITABLE,
    CommunicationError,
    Input,
    Item,
    Operation,
    operation_items,
)

_STEPS_PER_MOTOR_TURN = 1000
# eight bits with start, parity and stop
_BITS = 11


class OrientalAz:
    """A drive with an absolute encoder whose home is set, on one unit of a bus.

    Parameters
    ----------
    unit : int
        Its Modbus address.
    axis : Axis
        The table that it turns; one step of the drive is the axis' step.
    baudrate : int
        Of its serial line.
    """

    latency_s = 0.001

    def __init__(self, unit: int, axis: Axis, *, baudrate: int = 115_200) -> None:
        self.unit, self.character_s = unit, _BITS / baudrate
        self._operations = AzOperations(axis, self._operation)
        self._items = dict(DEFAULTS)
        self._communication_error = 0
        self._functions = {
            0x03: modbus.read_registers(self._read),
            0x06: modbus.write_register(self._write_one),
            0x08: modbus.loop_back,
            0x10: modbus.write_registers(self._write),
            0x17: modbus.read_and_write_registers(self._read, self._write),
        }

    def session(self) -> RtuSession:
        """A new client on the serial line."""
        return RtuSession(self)

    def answer(self, request: bytes, now_s: float) -> bytes:
        """Run a request, from its function on, and return its answer."""
        return modbus.answer(self._functions, request, now_s)

    def note_bad_frame(self) -> None:
        """Bytes came that are no frame."""
        self._communication_error = CommunicationError.BAD_FRAME

    def trip(self, alarm: int, now_s: float) -> None:
        """Let a protection stop the motor; nothing moves until the alarm is reset."""
        self._operations.trip(alarm, now_s)

    def power_cycle(self, now_s: float) -> None:
        """Lose every register and alarm, but not the position: the encoder is absolute."""
        self._operations.power_cycle(now_s)
        self._items = dict(DEFAULTS)
        self._communication_error = 0

    def hit_limit(self, axis: Axis, now_s: float) -> None:
        """Let the table meet its limit switch."""
        self.trip(OVERTRAVEL_ALARM, now_s)

    def lose_home(self, axis: Axis, now_s: float) -> None:
        """Let the encoder forget where home is, until a position is preset."""
        self._operations.lose_home(now_s)

    def _read(self, address: int, count: int, now_s: float) -> list[int]:
        """Contents of whole items, upper register first."""
        present = self._present(now_s)
        registers = []
        for item in self._whole_items(address, count):
            if item not in present and item not in self._items:
                raise self._refusal(2, CommunicationError.UNDEFINED)
            value = present[item] if item in present else self._items[item]
            registers += [value >> 16 & 0xFFFF, value & 0xFFFF]
        return registers

    def _write(self, address: int, values: list[int], now_s: float) -> None:
        """Write whole items, then do what they ask for; nothing is written when one of them is refused."""
        items = self._whole_items(address, len(values))
        numbers = (_signed(upper << 16 | lower) for upper, lower in zip(values[::2], values[1::2], strict=True))
        self._write_items(dict(zip(items, numbers, strict=True)), now_s)

    def _write_one(self, address: int, values: list[int], now_s: float) -> None:
        """Write one half of an item, then do what the item asks for."""
        item = address & ~1
        if item not in WRITABLE:
            raise self._refusal(2, CommunicationError.UNDEFINED)
        before = self._items[item]
        after = before & 0xFFFF | values[0] << 16 if address == item else before & ~0xFFFF | values[0]
        self._write_items({item: _signed(after & 0xFFFFFFFF)}, now_s)

    def _whole_items(self, address: int, count: int) -> range:
        if address % 2 or count % 2:
            raise self._refusal(2, CommunicationError.UNDEFINED)
        return range(address, address + count, 2)

    def _refusal(self, code: int, communication_error: CommunicationError) -> modbus.ModbusError:
        self._communication_error = communication_error
        return modbus.ModbusError(code)

    def _present(self, now_s: float) -> dict[int, int]:
        """Items that tell the state of the drive."""
        motor = self._operations.motor
        speed_hz = motor.speed_hz(now_s)
        speed_rpm = round(60 * speed_hz / _STEPS_PER_MOTOR_TURN)
        repeated = self._items[Item.INPUT] & (Input.M | Input.START)
        return {
            Item.OUTPUT: self._operations.output(now_s) | repeated,
            Item.ALARM: self._operations.alarm,
            Item.COMMUNICATION_ERROR: self._communication_error,
            Item.COMMAND_STEPS: motor.command_steps(now_s),
            Item.FEEDBACK_STEPS: motor.feedback_steps(now_s),
            **dict.fromkeys((Item.COMMAND_RPM, Item.FEEDBACK_RPM), speed_rpm),
            **dict.fromkeys((Item.COMMAND_HZ, Item.FEEDBACK_HZ), speed_hz),
            Item.TORQUE: 0,
            Item.DRIVER_TEMPERATURE: 400,
            Item.MOTOR_TEMPERATURE: 350,
        }

    def _write_items(self, items: dict[int, int], now_s: float) -> None:
        for item, value in items.items():
            if item not in WRITABLE:
                raise self._refusal(2, CommunicationError.UNDEFINED)
            if value not in WRITABLE[item]:
                raise self._refusal(3, CommunicationError.OUT_OF_RANGE)
        if items.get(Item.PRESET_POSITION) and self._operations.motor.is_moving(now_s):
            raise self._refusal(4, CommunicationError.NOT_EXECUTABLE)
        before = {item: self._items[item] for item in items}
        self._items |= items
        self._maintain({item for item, value in items.items() if value and not before[item]}, now_s)
        self._start_direct_data(items, now_s)
        if Item.INPUT in items:
            self._take_inputs(before[Item.INPUT], items[Item.INPUT], now_s)
        if Item.ONE_SHOT_INPUT in items:
            levels = self._items[Item.INPUT]
            self._take_inputs(levels, levels | items[Item.ONE_SHOT_INPUT], now_s)
            self._take_inputs(levels | items[Item.ONE_SHOT_INPUT], levels, now_s)
            self._items[Item.ONE_SHOT_INPUT] = 0

    def _maintain(self, risen: Iterable[int], now_s: float) -> None:
        """Maintenance commands run when their item goes from 0 to 1."""
        for item in risen:
            if item == Item.ALARM_RESET:
                self._operations.alarm = 0
            elif item == Item.CLEAR_ERROR_HISTORY:
                self._communication_error = 0
            elif item == Item.PRESET_POSITION:
                self._operations.preset(now_s)

    def _start_direct_data(self, written: dict[int, int], now_s: float) -> None:
        trigger = self._items[Item.TRIGGER]
        if trigger == 1 and Item.TRIGGER in written:
            self._items[Item.TRIGGER] = 0
        # -1 to -7 stand for the items from the number to the current
        elif trigger >= 0 or list(written) != [Item.DIRECT_NUMBER + 2 * (-trigger - 1)]:
            return
        operation = self._operation(Item.DIRECT_OPERATION)
        self._note_readiness(self._operations.start(operation, now_s, buffered=bool(self._items[Item.DESTINATION])))

    def _take_inputs(self, before: int, after: int, now_s: float) -> None:
        self._note_readiness(self._operations.take_inputs(before, after, now_s))

    def _note_readiness(self, was_ready: bool) -> None:
        if not was_ready:
            self._communication_error = CommunicationError.NOT_EXECUTABLE

    def _operation(self, address: int) -> Operation:
        return Operation(*(self._items[item] for item in operation_items(address)))


def _signed(value: int) -> int:
    return value - (1 << 32) if value >= 1 << 31 else value
