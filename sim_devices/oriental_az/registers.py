"""The registers of an Oriental Motor AZ drive, as data: items of 32 bits, what they may hold, and the bits of two."""

from __future__ import annotations

from enum import IntEnum, IntFlag
from typing import NamedTuple

STORED_OPERATIONS = range(256)
LARGEST = 2**31 - 1
_STORED, _STORED_STRIDE = 0x1800, 64


class Item(IntEnum):
    """Addresses of items; each fills two registers, the upper half first."""

    DIRECT_NUMBER = 0x0058
    DIRECT_OPERATION = 0x005A
    TRIGGER = 0x0066
    DESTINATION = 0x0068
    ONE_SHOT_INPUT = 0x0074
    INPUT = 0x007C
    OUTPUT = 0x007E
    ALARM = 0x0080
    COMMUNICATION_ERROR = 0x00AC
    COMMAND_STEPS = 0x00C6
    COMMAND_RPM = 0x00C8
    COMMAND_HZ = 0x00CA
    FEEDBACK_STEPS = 0x00CC
    FEEDBACK_RPM = 0x00CE
    FEEDBACK_HZ = 0x00D0
    TORQUE = 0x00D6
    DRIVER_TEMPERATURE = 0x00F8
    MOTOR_TEMPERATURE = 0x00FA
    ALARM_RESET = 0x0180
    CLEAR_ALARM_HISTORY = 0x0184
    CLEAR_ERROR_HISTORY = 0x0188
    PRESET_POSITION = 0x018A


class CommunicationError(IntEnum):
    """Why the drive did not do what it was sent."""

    BAD_FRAME = 0x84
    UNDEFINED = 0x88
    OUT_OF_RANGE = 0x8C
    NOT_EXECUTABLE = 0x8D


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
    """One motion, in the order of its registers: rates in steps/s² (0.001 kHz/s), current in 0.1 %."""

    type: int
    position: int
    speed: int
    rate: int
    stop_rate: int
    current: int


DEFAULT_OPERATION = Operation(Type.ABSOLUTE, 0, 1_000, 1_000_000, 1_000_000, 1_000)

_WORD, _SWITCH, _RATES = range(-LARGEST - 1, LARGEST + 1), range(2), range(1, 1_000_000_001)
# in the order of an operation's registers
_OPERATION_ALLOWED: tuple[range | tuple[int, ...], ...] = (
    tuple(map(int, Type)),
    _WORD,
    range(-4_000_000, 4_000_001),
    _RATES,
    _RATES,
    range(1001),
)
_OTHERS_ALLOWED: dict[int, range | tuple[int, ...]] = {
    Item.DIRECT_NUMBER: STORED_OPERATIONS,
    Item.TRIGGER: range(-7, 2),
    Item.DESTINATION: _SWITCH,
    Item.ONE_SHOT_INPUT: _WORD,
    Item.INPUT: _WORD,
    Item.ALARM_RESET: _SWITCH,
    Item.CLEAR_ALARM_HISTORY: _SWITCH,
    Item.CLEAR_ERROR_HISTORY: _SWITCH,
    Item.PRESET_POSITION: _SWITCH,
}


def stored(number: int) -> int:
    """Address of a stored operation."""
    return _STORED + _STORED_STRIDE * number


def operation_items(address: int) -> range:
    """Addresses of an operation's items, from its own on."""
    return range(address, address + 2 * len(Operation._fields), 2)


_OPERATIONS = (int(Item.DIRECT_OPERATION), *map(stored, STORED_OPERATIONS))
# every item that can be written, with its allowed values
WRITABLE: dict[int, range | tuple[int, ...]] = {
    **_OTHERS_ALLOWED,
    **{
        item: allowed
        for address in _OPERATIONS
        for item, allowed in zip(operation_items(address), _OPERATION_ALLOWED, strict=True)
    },
}
# and what it holds at first
DEFAULTS = dict.fromkeys(WRITABLE, 0) | {
    item: value
    for address in _OPERATIONS
    for item, value in zip(operation_items(address), DEFAULT_OPERATION, strict=True)
}
