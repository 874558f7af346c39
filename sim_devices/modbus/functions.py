"""The functions of Modbus, whatever frames carry them: what a request asks of a unit's registers and bits.

A unit offers the functions of its own table; everything else is answered with an exception.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping
from typing import Any, Protocol

BROADCAST = 0
_ON, _OFF = 0xFF00, 0x0000
_MOST_REGISTERS_READ, _MOST_REGISTERS_WRITTEN, _MOST_WRITTEN_WITH_READ = 125, 123, 121
_MOST_BITS_READ, _MOST_BITS_WRITTEN = 2000, 1968

# what follows the function's number, and the time: what follows it in the answer
Function = Callable[[bytes, float], bytes]
# address, count, time
Read = Callable[[int, int, float], list[int]]
# address, values, time
Write = Callable[[int, list[int], float], None]


class ModbusError(Exception):
    """A request that is answered with an exception code: 1 function, 2 address, 3 value, 4 device."""

    def __init__(self, code: int) -> None:
        super().__init__(code)
        self.code = code


class Unit(Protocol):
    """A device at an address of a bus.

    `latency_s` is what it takes to find an answer, and `character_s` how long one character is on its serial line.
    """

    unit: int
    latency_s: float
    character_s: float

    def answer(self, request: bytes, now_s: float) -> bytes:
        """Run a request, from its function on, and return its answer."""
        ...

    def note_bad_frame(self) -> None:
        """Bytes came that are no frame."""
        ...


def answer(functions: Mapping[int, Function], request: bytes, now_s: float) -> bytes:
    """Run the function that a request names; an exception's answer when there is none, or it refuses."""
    number = request[0]
    try:
        if number not in functions:
            raise ModbusError(1)
        return bytes([number]) + functions[number](request[1:], now_s)
    except ModbusError as error:
        return bytes([number | 0x80, error.code])


def loop_back(data: bytes, now_s: float) -> bytes:
    """08: only "return query data" is known."""
    if len(data) < 4 or data[:2] != b"\0\0":
        raise ModbusError(3)
    return data


def read_bits(read: Read) -> Function:
    """01 and 02."""

    def run(data: bytes, now_s: float) -> bytes:
        address, count = _unpack(">HH", data)
        if not 1 <= count <= _MOST_BITS_READ:
            raise ModbusError(3)
        bits = sum(bit << place for place, bit in enumerate(read(address, count, now_s)))
        size = -(-count // 8)
        return bytes([size]) + bits.to_bytes(size, "little")

    return run


def write_bit(write: Write) -> Function:
    """05."""

    def run(data: bytes, now_s: float) -> bytes:
        address, state = _unpack(">HH", data)
        if state not in (_ON, _OFF):
            raise ModbusError(3)
        write(address, [int(state == _ON)], now_s)
        return data

    return run


def write_bits(write: Write) -> Function:
    """0F."""

    def run(data: bytes, now_s: float) -> bytes:
        address, count, size = _unpack(">HHB", data[:5])
        if not 1 <= count <= _MOST_BITS_WRITTEN or not size == len(data) - 5 == -(-count // 8):
            raise ModbusError(3)
        bits = int.from_bytes(data[5:], "little")
        write(address, [bits >> place & 1 for place in range(count)], now_s)
        return data[:4]

    return run


def read_registers(read: Read) -> Function:
    """03."""

    def run(data: bytes, now_s: float) -> bytes:
        address, count = _unpack(">HH", data)
        if not 1 <= count <= _MOST_REGISTERS_READ:
            raise ModbusError(3)
        return struct.pack(f">B{count}H", 2 * count, *read(address, count, now_s))

    return run


def write_register(write: Write) -> Function:
    """06."""

    def run(data: bytes, now_s: float) -> bytes:
        address, value = _unpack(">HH", data)
        write(address, [value], now_s)
        return data

    return run


def write_registers(write: Write, most: int = _MOST_REGISTERS_WRITTEN) -> Function:
    """10."""

    def run(data: bytes, now_s: float) -> bytes:
        address, count, size = _unpack(">HHB", data[:5])
        if not 1 <= count <= most or not size == len(data) - 5 == 2 * count:
            raise ModbusError(3)
        write(address, list(struct.unpack(f">{count}H", data[5:])), now_s)
        return data[:4]

    return run


def read_and_write_registers(read: Read, write: Write) -> Function:
    """17: the write comes first, so that what was written can be read back."""
    read_part, write_part = read_registers(read), write_registers(write, _MOST_WRITTEN_WITH_READ)

    def run(data: bytes, now_s: float) -> bytes:
        write_part(data[4:], now_s)
        return read_part(data[:4], now_s)

    return run


def _unpack(layout: str, data: bytes) -> tuple[Any, ...]:
    """Numbers of a request; one of another length, which only frames without a checksum let through, is refused."""
    if len(data) != struct.calcsize(layout):
        raise ModbusError(3)
    return struct.unpack(layout, data)
