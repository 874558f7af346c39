"""The coils, inputs and registers of an SMC LEC controller, as data."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

COILS = range(0x10, 0x40)
INPUTS = range(0x40, 0x50)
REGISTERS = range(0x9000, 0x9120)
WRITABLE_REGISTERS = range(0x9100, 0x9120)


class Coil(IntEnum):
    """What a host tells the controller."""

    STEP_NUMBER = 0x10
    HOLD = 0x18
    SVON = 0x19
    DRIVE = 0x1A
    RESET = 0x1B
    SETUP = 0x1C
    JOG_MINUS = 0x1D
    JOG_PLUS = 0x1E
    SERIAL_MODE = 0x30


# the number of a step is six bits
NAMED_COILS = frozenset(range(Coil.STEP_NUMBER, Coil.STEP_NUMBER + 6)) | frozenset(map(int, Coil))


class InputBit(IntEnum):
    """What the controller tells a host."""

    BUSY = 0x48
    SVRE = 0x49
    SETON = 0x4A
    INP = 0x4B
    AREA = 0x4C
    WAREA = 0x4D
    ESTOP = 0x4E
    ALARM = 0x4F


class Register(IntEnum):
    """Addresses of numbers: first the state, then the operation that a host writes."""

    POSITION = 0x9000
    SPEED = 0x9002
    THRUST = 0x9003
    TARGET = 0x9004
    STEP = 0x9006
    START = 0x9100
    MODE = 0x9102
    OPERATION_SPEED = 0x9103
    OPERATION_POSITION = 0x9104
    ACCELERATION = 0x9106
    DECELERATION = 0x9107
    PUSH_FORCE = 0x9108
    TRIGGER_LEVEL = 0x9109
    PUSH_SPEED = 0x910A
    MOVING_FORCE = 0x910B
    AREA_1 = 0x910C
    AREA_2 = 0x910E
    IN_POSITION = 0x9110


# numbers with a sign that fill two registers, the upper half first
LONG = frozenset(
    {
        Register.POSITION,
        Register.TARGET,
        Register.OPERATION_POSITION,
        Register.AREA_1,
        Register.AREA_2,
        Register.IN_POSITION,
    }
)
# some firmware looks at the upper byte, some at the lower
STARTS = frozenset({0x0001, 0x0100})
ABSOLUTE, RELATIVE = frozenset({0x0001, 0x0100}), frozenset({0x0002, 0x0200})


class Operation(NamedTuple):
    """One motion as a host asks for it: absolute or relative, in degrees."""

    is_relative: bool
    position_deg: float
    speed_deg_s: float
    acceleration_deg_s2: float
    deceleration_deg_s2: float
    area_deg: tuple[float, float]
    in_position_deg: float


def operation(numbers: dict[int, int]) -> Operation | None:
    """Read the operation's registers; None when its mode is neither absolute nor relative."""
    mode = numbers[Register.MODE]
    if mode not in ABSOLUTE | RELATIVE:
        return None
    return Operation(
        is_relative=mode in RELATIVE,
        position_deg=numbers[Register.OPERATION_POSITION] / 100,
        speed_deg_s=numbers[Register.OPERATION_SPEED],
        acceleration_deg_s2=numbers[Register.ACCELERATION],
        deceleration_deg_s2=numbers[Register.DECELERATION],
        area_deg=(numbers[Register.AREA_1] / 100, numbers[Register.AREA_2] / 100),
        in_position_deg=numbers[Register.IN_POSITION] / 100,
    )


def words(register: int, number: int) -> list[int]:
    """A number as its registers hold it."""
    return [number >> 16 & 0xFFFF, number & 0xFFFF] if register in LONG else [number & 0xFFFF]
