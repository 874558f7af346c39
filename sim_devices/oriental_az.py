"""A simulated Oriental Motor AZ drive: its registers, its inputs and outputs, and the motions they start."""

from __future__ import annotations

from collections.abc import Iterable
from enum import IntEnum, IntFlag
from typing import NamedTuple

from sim_devices.axis import Axis
from sim_devices.modbus_rtu import ModbusError, RtuSession

_STEPS_PER_MOTOR_TURN = 1000
_LARGEST = 2**31 - 1
_HOMING_HZ, _HOMING_RATE_HZ_S = 5_000, 1_000_000
_JOG_HZ, _JOG_STEPS = 1_000, 1
_DATA_ALARM = 0x70
_BAD_FRAME, _UNDEFINED, _OUT_OF_RANGE, _NOT_EXECUTABLE = 0x84, 0x88, 0x8C, 0x8D

_ONE_SHOT, _INPUT, _OUTPUT = 0x0074, 0x007C, 0x007E
_ALARM, _COMMUNICATION_ERROR = 0x0080, 0x00AC
_COMMAND_STEPS, _COMMAND_RPM, _COMMAND_HZ = 0x00C6, 0x00C8, 0x00CA
_FEEDBACK_STEPS, _FEEDBACK_RPM, _FEEDBACK_HZ = 0x00CC, 0x00CE, 0x00D0
_TORQUE, _DRIVER_TEMPERATURE, _MOTOR_TEMPERATURE = 0x00D6, 0x00F8, 0x00FA
_ALARM_RESET, _ALARM_HISTORY, _ERROR_HISTORY, _PRESET = 0x0180, 0x0184, 0x0188, 0x018A
_DIRECT, _TRIGGER, _DESTINATION = 0x0058, 0x0066, 0x0068
_STORED, _STORED_STRIDE, _STORED_COUNT = 0x1800, 64, 256


class Type(IntEnum):
    """Operation types."""

    ABSOLUTE = 1
    RELATIVE_TO_COMMAND = 2
    RELATIVE_TO_FEEDBACK = 3
    CONTINUOUS = 7
    WRAP_ABSOLUTE = 8
    WRAP_SHORTEST = 9
    WRAP_FORWARD = 10
    WRAP_REVERSE = 11


class Input(IntFlag):
    """Bits of the driver input command."""

    M = 0x7
    START = 1 << 3
    ZHOME = 1 << 4
    STOP = 1 << 5
    FREE = 1 << 6
    ALM_RST = 1 << 7
    D_SEL0 = 1 << 8
    D_SEL1 = 1 << 9
    D_SEL2 = 1 << 10
    SSTART = 1 << 11
    FW_JOG_P = 1 << 12
    RV_JOG_P = 1 << 13
    FW_POS = 1 << 14
    RV_POS = 1 << 15


class Output(IntFlag):
    """Bits of the driver output status that this drive uses."""

    HOME_END = 1 << 4
    READY = 1 << 5
    ALM_A = 1 << 7
    MOVE = 1 << 13
    IN_POS = 1 << 14


class Operation(NamedTuple):
    """One motion: rates in steps/s² (0.001 kHz/s), current in 0.1 %."""

    type: int
    position: int
    speed: int
    rate: int
    stop_rate: int
    current: int


_TYPES = tuple(int(kind) for kind in Type)
_RATES = range(1, 1_000_000_001)
# allowed values of an operation's items, in the order of their registers
_OPERATION_RANGES: tuple[range | tuple[int, ...], ...] = (
    _TYPES,
    range(-_LARGEST - 1, _LARGEST + 1),
    range(-4_000_000, 4_000_001),
    _RATES,
    _RATES,
    range(1001),
)
_DEFAULT_OPERATION = Operation(Type.ABSOLUTE, 0, 1_000, 1_000_000, 1_000_000, 1_000)


def _ranges() -> dict[int, range | tuple[int, ...]]:
    """Every item that can be written, with its allowed values."""
    word, switch = range(-_LARGEST - 1, _LARGEST + 1), range(2)
    ranges: dict[int, range | tuple[int, ...]] = {
        _DIRECT: range(_STORED_COUNT),
        _TRIGGER: range(-7, 2),
        _DESTINATION: switch,
        _ONE_SHOT: word,
        _INPUT: word,
        **dict.fromkeys((_ALARM_RESET, _ALARM_HISTORY, _ERROR_HISTORY, _PRESET), switch),
    }
    starts = (_DIRECT + 2, *(_STORED + _STORED_STRIDE * number for number in range(_STORED_COUNT)))
    for start in starts:
        ranges |= {start + 2 * place: allowed for place, allowed in enumerate(_OPERATION_RANGES)}
    return ranges


_WRITABLE = _ranges()


class OrientalAz:
    """A drive with an absolute encoder whose home is set, on one unit of a bus.

    Parameters
    ----------
    unit : int
        Its Modbus address.
    axis : Axis
        The table that it turns; one step of the drive is the axis' step.
    """

    latency_s = 0.003

    def __init__(self, unit: int, axis: Axis) -> None:
        self._unit, self._axis = unit, axis
        self._items = dict.fromkeys(_WRITABLE, 0)
        for start in (_DIRECT + 2, *range(_STORED, _STORED + _STORED_STRIDE * _STORED_COUNT, _STORED_STRIDE)):
            self._items |= {start + 2 * place: value for place, value in enumerate(_DEFAULT_OPERATION)}
        self._origin_steps = 0
        self._alarm = 0
        self._communication_error = 0
        self._stop_rate = _DEFAULT_OPERATION.stop_rate

    def session(self) -> RtuSession:
        """A new client."""
        return RtuSession(self._unit, self)

    def note_bad_frame(self) -> None:
        """Bytes came that are no frame."""
        self._communication_error = _BAD_FRAME

    def read(self, address: int, count: int, now_s: float) -> list[int]:
        """Contents of whole items, upper register first."""
        present = self._present(now_s)
        registers = []
        for item in self._whole_items(address, count):
            if item not in present and item not in self._items:
                raise self._refusal(2, _UNDEFINED)
            value = present[item] if item in present else self._items[item]
            registers += [value >> 16 & 0xFFFF, value & 0xFFFF]
        return registers

    def write(self, address: int, values: list[int], now_s: float) -> None:
        """Write whole items, then do what they ask for."""
        items = self._whole_items(address, len(values))
        numbers = (_signed(upper << 16 | lower) for upper, lower in zip(values[::2], values[1::2], strict=True))
        self._write_items(dict(zip(items, numbers, strict=True)), now_s)

    def write_one(self, address: int, value: int, now_s: float) -> None:
        """Write one half of an item, then do what the item asks for."""
        item = address & ~1
        if item not in _WRITABLE:
            raise self._refusal(2, _UNDEFINED)
        before = self._items[item]
        after = before & 0xFFFF | value << 16 if address == item else before & ~0xFFFF | value
        self._write_items({item: _signed(after & 0xFFFFFFFF)}, now_s)

    def _whole_items(self, address: int, count: int) -> range:
        if address % 2 or count % 2:
            raise self._refusal(2, _UNDEFINED)
        return range(address, address + count, 2)

    def _refusal(self, code: int, communication_error: int) -> ModbusError:
        self._communication_error = communication_error
        return ModbusError(code)

    def _present(self, now_s: float) -> dict[int, int]:
        """Items that tell the state of the drive."""
        steps = self._steps(now_s)
        speed_hz = round(self._axis.velocity_deg_s(now_s) / self._axis.step_deg)
        speed_rpm = round(60 * speed_hz / _STEPS_PER_MOTOR_TURN)
        return {
            _OUTPUT: self._output(now_s),
            _ALARM: self._alarm,
            _COMMUNICATION_ERROR: self._communication_error,
            **dict.fromkeys((_COMMAND_STEPS, _FEEDBACK_STEPS), steps),
            **dict.fromkeys((_COMMAND_RPM, _FEEDBACK_RPM), speed_rpm),
            **dict.fromkeys((_COMMAND_HZ, _FEEDBACK_HZ), speed_hz),
            _TORQUE: 0,
            _DRIVER_TEMPERATURE: 400,
            _MOTOR_TEMPERATURE: 350,
        }

    def _output(self, now_s: float) -> int:
        moving = self._axis.is_moving(now_s)
        output = Output(0)
        if not moving:
            output |= Output.IN_POS
            if self._steps(now_s) == 0:
                output |= Output.HOME_END
        if self._is_ready(now_s):
            output |= Output.READY
        if self._alarm:
            output |= Output.ALM_A
        if moving:
            output |= Output.MOVE
        return output | self._items[_INPUT] & (Input.M | Input.START)

    def _is_ready(self, now_s: float) -> bool:
        held = self._items[_INPUT] & (Input.STOP | Input.FREE)
        return not (held or self._alarm or self._axis.is_moving(now_s))

    def _steps(self, now_s: float) -> int:
        return round(self._axis.position_deg(now_s) / self._axis.step_deg) - self._origin_steps

    def _write_items(self, items: dict[int, int], now_s: float) -> None:
        for item, value in items.items():
            if item not in _WRITABLE:
                raise self._refusal(2, _UNDEFINED)
            if value not in _WRITABLE[item]:
                raise self._refusal(3, _OUT_OF_RANGE)
        if items.get(_PRESET) and self._axis.is_moving(now_s):
            raise self._refusal(4, _NOT_EXECUTABLE)
        before = {item: self._items[item] for item in items}
        self._items |= items
        self._maintain({item for item, value in items.items() if value and not before[item]}, now_s)
        self._start_direct_data(items, now_s)
        if _INPUT in items:
            self._take_inputs(before[_INPUT], items[_INPUT], now_s)
        if _ONE_SHOT in items:
            self._take_inputs(0, items[_ONE_SHOT], now_s)
            self._take_inputs(items[_ONE_SHOT], 0, now_s)
            self._items[_ONE_SHOT] = 0

    def _maintain(self, risen: Iterable[int], now_s: float) -> None:
        """Maintenance commands run when their item goes from 0 to 1."""
        for item in risen:
            if item == _ALARM_RESET:
                self._alarm = 0
            elif item == _ERROR_HISTORY:
                self._communication_error = 0
            elif item == _PRESET:
                self._origin_steps += self._steps(now_s)

    def _start_direct_data(self, written: dict[int, int], now_s: float) -> None:
        trigger = self._items[_TRIGGER]
        if trigger == 1 and _TRIGGER in written:
            self._items[_TRIGGER] = 0
        # -1 to -7 stand for the items from the number to the current
        elif trigger >= 0 or list(written) != [_DIRECT + 2 * (-trigger - 1)]:
            return
        operation = Operation(*(self._items[_DIRECT + 2 + 2 * place] for place in range(len(_OPERATION_RANGES))))
        buffered = bool(self._items[_DESTINATION]) and self._axis.is_moving(now_s) and not self._alarm
        self._start(operation, self._axis.end_s if buffered else now_s)

    def _take_inputs(self, before: int, after: int, now_s: float) -> None:
        risen, fallen = Input(after & ~before & 0xFFFF), Input(before & ~after & 0xFFFF)
        if risen & Input.ALM_RST:
            self._alarm = 0
        if after & (Input.STOP | Input.FREE) or fallen & (Input.FW_POS | Input.RV_POS):
            self._axis.stop(now_s, deceleration_deg_s2=self._stop_rate * self._axis.step_deg)
        for bit, operation in self._operations_of_inputs(after).items():
            if risen & bit:
                self._start(operation, now_s)

    def _operations_of_inputs(self, levels: int) -> dict[Input, Operation]:
        """What each input starts when it rises."""
        chosen = self._stored(levels & Input.M)
        jog = _DEFAULT_OPERATION._replace(type=Type.RELATIVE_TO_COMMAND, position=_JOG_STEPS, speed=_JOG_HZ)
        return {
            Input.START: chosen,
            Input.SSTART: chosen,
            Input.D_SEL0: self._stored(0),
            Input.D_SEL1: self._stored(1),
            Input.D_SEL2: self._stored(2),
            Input.ZHOME: Operation(Type.ABSOLUTE, 0, _HOMING_HZ, _HOMING_RATE_HZ_S, _HOMING_RATE_HZ_S, 1_000),
            Input.FW_JOG_P: jog,
            Input.RV_JOG_P: jog._replace(position=-_JOG_STEPS),
            Input.FW_POS: chosen._replace(type=Type.CONTINUOUS, speed=abs(chosen.speed)),
            Input.RV_POS: chosen._replace(type=Type.CONTINUOUS, speed=-abs(chosen.speed)),
        }

    def _stored(self, number: int) -> Operation:
        start = _STORED + _STORED_STRIDE * number
        return Operation(*(self._items[start + 2 * place] for place in range(len(_OPERATION_RANGES))))

    def _start(self, operation: Operation, start_s: float) -> None:
        if not self._is_ready(start_s):
            self._communication_error = _NOT_EXECUTABLE
            return
        if operation.speed == 0:
            self._alarm = _DATA_ALARM
            return
        self._stop_rate = operation.stop_rate
        step_deg = self._axis.step_deg
        self._axis.move(
            (self._target_steps(operation, start_s) + self._origin_steps) * step_deg,
            start_s,
            velocity_deg_s=abs(operation.speed) * step_deg,
            acceleration_deg_s2=operation.rate * step_deg,
            deceleration_deg_s2=operation.stop_rate * step_deg,
        )

    def _target_steps(self, operation: Operation, now_s: float) -> int:
        here = self._steps(now_s)
        turn = round(360 / self._axis.step_deg)
        forward = (operation.position - here) % turn
        match operation.type:
            case Type.ABSOLUTE:
                return operation.position
            case Type.RELATIVE_TO_COMMAND | Type.RELATIVE_TO_FEEDBACK:
                return here + operation.position
            case Type.CONTINUOUS:
                # until it is stopped, or the position counter ends
                return _LARGEST if operation.speed > 0 else -_LARGEST
            case Type.WRAP_ABSOLUTE:
                return here - here % turn + operation.position % turn
            case Type.WRAP_SHORTEST:
                return here + (forward if forward <= turn / 2 else forward - turn)
            case Type.WRAP_FORWARD:
                return here + forward
            case _:
                return here + forward - (turn if forward else 0)


def _signed(value: int) -> int:
    return value - (1 << 32) if value >= 1 << 31 else value
