"""A simulated Oriental Motor AZ drive: what it answers from its registers, and what written ones start."""

from __future__ import annotations

from collections.abc import Iterable

from sim_devices.axis import Axis
from sim_devices.modbus import functions as modbus
from sim_devices.modbus.rtu import RtuSession
from sim_devices.oriental_az.motor import AzMotor
from sim_devices.oriental_az.registers import (
    DEFAULT_OPERATION,
    DEFAULTS,
    WRITABLE,
    CommunicationError,
    Input,
    Item,
    Operation,
    Output,
    Type,
    operation_items,
    stored,
)

_STEPS_PER_MOTOR_TURN = 1000
_DATA_ALARM, _OVERTRAVEL_ALARM, _HOME_ALARM = 0x70, 0x66, 0x4A
_HOMING = Operation(Type.ABSOLUTE, 0, 5_000, 1_000_000, 1_000_000, 1_000)
_JOG = DEFAULT_OPERATION._replace(type=Type.RELATIVE_TO_COMMAND, position=1)


class OrientalAz:
    """A drive with an absolute encoder whose home is set, on one unit of a bus.

    Parameters
    ----------
    unit : int
        Its Modbus address.
    axis : Axis
        The table that it turns; one step of the drive is the axis' step.
    """

    latency_s = 0.001
    # 115200 baud, eight bits with start, parity and stop
    character_s = 11 / 115_200

    def __init__(self, unit: int, axis: Axis) -> None:
        self.unit = unit
        self._motor = AzMotor(axis)
        self._items = dict(DEFAULTS)
        self._alarm = 0
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
        self._alarm = alarm
        self._motor.stop(now_s)

    def power_cycle(self, now_s: float) -> None:
        """Lose every register and alarm, but not the position: the encoder is absolute."""
        self._motor.stop(now_s)
        self._items = dict(DEFAULTS)
        self._alarm = self._communication_error = 0

    def hit_limit(self, axis: Axis, now_s: float) -> None:
        """Let the table meet its limit switch."""
        self.trip(_OVERTRAVEL_ALARM, now_s)

    def lose_home(self, axis: Axis, now_s: float) -> None:
        """Let the encoder forget where home is."""
        self.trip(_HOME_ALARM, now_s)

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
        steps, speed_hz = self._motor.steps(now_s), self._motor.speed_hz(now_s)
        speed_rpm = round(60 * speed_hz / _STEPS_PER_MOTOR_TURN)
        return {
            Item.OUTPUT: self._output(now_s),
            Item.ALARM: self._alarm,
            Item.COMMUNICATION_ERROR: self._communication_error,
            **dict.fromkeys((Item.COMMAND_STEPS, Item.FEEDBACK_STEPS), steps),
            **dict.fromkeys((Item.COMMAND_RPM, Item.FEEDBACK_RPM), speed_rpm),
            **dict.fromkeys((Item.COMMAND_HZ, Item.FEEDBACK_HZ), speed_hz),
            Item.TORQUE: 0,
            Item.DRIVER_TEMPERATURE: 400,
            Item.MOTOR_TEMPERATURE: 350,
        }

    def _output(self, now_s: float) -> int:
        moving = self._motor.is_moving(now_s)
        output = Output.MOVE if moving else Output.IN_POS
        if not moving and self._motor.steps(now_s) == 0:
            output |= Output.HOME_END
        if self._is_ready(now_s):
            output |= Output.READY
        if self._alarm:
            output |= Output.ALM_A
        return output | self._items[Item.INPUT] & (Input.M | Input.START)

    def _is_ready(self, now_s: float) -> bool:
        held = self._items[Item.INPUT] & (Input.STOP | Input.FREE)
        return not (held or self._alarm or self._motor.is_moving(now_s))

    def _write_items(self, items: dict[int, int], now_s: float) -> None:
        for item, value in items.items():
            if item not in WRITABLE:
                raise self._refusal(2, CommunicationError.UNDEFINED)
            if value not in WRITABLE[item]:
                raise self._refusal(3, CommunicationError.OUT_OF_RANGE)
        if items.get(Item.PRESET_POSITION) and self._motor.is_moving(now_s):
            raise self._refusal(4, CommunicationError.NOT_EXECUTABLE)
        before = {item: self._items[item] for item in items}
        self._items |= items
        self._maintain({item for item, value in items.items() if value and not before[item]}, now_s)
        self._start_direct_data(items, now_s)
        if Item.INPUT in items:
            self._take_inputs(before[Item.INPUT], items[Item.INPUT], now_s)
        if Item.ONE_SHOT_INPUT in items:
            self._take_inputs(0, items[Item.ONE_SHOT_INPUT], now_s)
            self._take_inputs(items[Item.ONE_SHOT_INPUT], 0, now_s)
            self._items[Item.ONE_SHOT_INPUT] = 0

    def _maintain(self, risen: Iterable[int], now_s: float) -> None:
        """Maintenance commands run when their item goes from 0 to 1."""
        for item in risen:
            if item == Item.ALARM_RESET:
                self._alarm = 0
            elif item == Item.CLEAR_ERROR_HISTORY:
                self._communication_error = 0
            elif item == Item.PRESET_POSITION:
                self._motor.preset(now_s)

    def _start_direct_data(self, written: dict[int, int], now_s: float) -> None:
        trigger = self._items[Item.TRIGGER]
        if trigger == 1 and Item.TRIGGER in written:
            self._items[Item.TRIGGER] = 0
        # -1 to -7 stand for the items from the number to the current
        elif trigger >= 0 or list(written) != [Item.DIRECT_NUMBER + 2 * (-trigger - 1)]:
            return
        buffered = bool(self._items[Item.DESTINATION]) and self._motor.is_moving(now_s) and not self._alarm
        self._start(self._operation(Item.DIRECT_OPERATION), self._motor.end_s if buffered else now_s)

    def _take_inputs(self, before: int, after: int, now_s: float) -> None:
        risen, fallen = Input(after & ~before & 0xFFFF), Input(before & ~after & 0xFFFF)
        if risen & Input.ALM_RST:
            self._alarm = 0
        if after & (Input.STOP | Input.FREE) or fallen & (Input.FW_POS | Input.RV_POS):
            self._motor.stop(now_s)
        for bit, operation in self._operations_of_inputs(after).items():
            if risen & bit:
                self._start(operation, now_s)

    def _operations_of_inputs(self, levels: int) -> dict[Input, Operation]:
        """What each input starts when it rises."""
        chosen = self._operation(stored(levels & Input.M))
        return {
            Input.START: chosen,
            Input.SSTART: chosen,
            Input.D_SEL0: self._operation(stored(0)),
            Input.D_SEL1: self._operation(stored(1)),
            Input.D_SEL2: self._operation(stored(2)),
            Input.ZHOME: _HOMING,
            Input.FW_JOG_P: _JOG,
            Input.RV_JOG_P: _JOG._replace(position=-_JOG.position),
            Input.FW_POS: chosen._replace(type=Type.CONTINUOUS, speed=abs(chosen.speed)),
            Input.RV_POS: chosen._replace(type=Type.CONTINUOUS, speed=-abs(chosen.speed)),
        }

    def _operation(self, address: int) -> Operation:
        return Operation(*(self._items[item] for item in operation_items(address)))

    def _start(self, operation: Operation, start_s: float) -> None:
        if not self._is_ready(start_s):
            self._communication_error = CommunicationError.NOT_EXECUTABLE
        elif operation.speed == 0:
            self._alarm = _DATA_ALARM
        else:
            self._motor.run(operation, start_s)


def _signed(value: int) -> int:
    return value - (1 << 32) if value >= 1 << 31 else value
