"""Modbus messages as bytes: what is asked, how a good answer begins, and the frame around both."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Protocol

READ_COILS, READ_INPUTS, READ_REGISTERS = 1, 2, 3
WRITE_COIL, WRITE_REGISTER, LOOP_BACK, WRITE_REGISTERS = 5, 6, 8, 16
REFUSED = 0x80

_HEADER_BYTES = 7
_LONGEST_MESSAGE = 253
_POLYNOMIAL = 0xA001


@dataclass(frozen=True)
class Request:
    """A message, without unit and frame.

    Attributes
    ----------
    text : str
        What it asks for, for messages to people.
    message : bytes
        Function and data.
    answer_start : bytes
        What the message of a good answer begins with.
    answer_length : int
        How long that message is.
    """

    text: str
    message: bytes
    answer_start: bytes
    answer_length: int

    def is_answered_by(self, message: bytes) -> bool:
        """Whether this is a good answer to the request, or its refusal."""
        if message[0] == self.message[0] | REFUSED:
            return len(message) == 2
        return message.startswith(self.answer_start) and len(message) == self.answer_length


@lru_cache(256)
def read_request(function: int, address: int, count: int) -> Request:
    """Ask for `count` coils (function 1), inputs (2) or registers (3) from `address` on."""
    data_bytes = 2 * count if function == READ_REGISTERS else (count + 7) // 8
    message = struct.pack(">BHH", function, address, count)
    return Request(f"read of 0x{address:04X}", message, bytes((function, data_bytes)), 2 + data_bytes)


def write_request(function: int, address: int, word: int) -> Request:
    """Write one coil (function 5, word 0xFF00 or 0) or one register (6); the answer repeats the message."""
    message = struct.pack(">BHH", function, address, word)
    return Request(f"write to 0x{address:04X}", message, message, len(message))


def write_registers_request(address: int, words: Sequence[int]) -> Request:
    """Write all `words` from `address` on in one message."""
    answer = struct.pack(">BHH", WRITE_REGISTERS, address, len(words))
    message = answer + struct.pack(f">B{len(words)}H", 2 * len(words), *words)
    return Request(f"write to 0x{address:04X}", message, answer, len(answer))


def loop_back_request(mark: int) -> Request:
    """Ask for the return of a number that means nothing."""
    message = struct.pack(">BHH", LOOP_BACK, 0, mark)
    return Request("loop-back", message, message, len(message))


def crc16(data: bytes | bytearray) -> int:
    """Return the checksum of RTU frames (CRC-16, polynomial 0xA001, start 0xFFFF)."""
    crc = 0xFFFF
    for byte in data:
        crc = crc >> 8 ^ _CRC_OF_BYTE[(crc ^ byte) & 0xFF]
    return crc


class Framing(Protocol):
    """How a message becomes a frame on the wire, and the other way round."""

    answers_are_numbered: bool

    def wrap(self, unit: int, message: bytes) -> bytes:
        """Return the frame of a message to a unit."""
        ...

    def take(self, received: bytearray, unit: int) -> bytes | None:
        """Remove the next frame from this unit and all before it; return its message, or None for "need more"."""
        ...


class RtuFraming:
    """Unit, message, checksum; nothing marks where a frame begins, and nothing says what it answers."""

    answers_are_numbered = False

    def wrap(self, unit: int, message: bytes) -> bytes:
        """Return the frame of a message to a unit."""
        return _rtu_frame(unit, message)

    def take(self, received: bytearray, unit: int) -> bytes | None:
        """Remove the next frame from this unit and all before it; return its message, or None for "need more"."""
        first_candidate = None
        start = received.find(unit)
        while start >= 0:
            length = _rtu_length(received, start)
            if length is None or start + length > len(received):
                first_candidate = start if first_candidate is None else first_candidate
            elif length and crc16(received[start : start + length]) == 0:
                message = bytes(received[start + 1 : start + length - 2])
                del received[: start + length]
                return message
            start = received.find(unit, start + 1)
        del received[: len(received) if first_candidate is None else first_candidate]
        return None


class TcpFraming:
    """A header with a transaction number, which the answer repeats; Modbus TCP."""

    answers_are_numbered = True

    def __init__(self) -> None:
        self._transaction = 0

    def wrap(self, unit: int, message: bytes) -> bytes:
        """Return the frame of a message to a unit, under the next transaction number."""
        self._transaction = (self._transaction + 1) & 0xFFFF
        return struct.pack(">HHHB", self._transaction, 0, len(message) + 1, unit) + message

    def take(self, received: bytearray, unit: int) -> bytes | None:
        """Remove the answer to the frame wrapped last and all before it; return its message, None for "need more"."""
        while len(received) >= _HEADER_BYTES:
            transaction, protocol, length, answering = struct.unpack_from(">HHHB", received)
            if protocol != 0 or not 2 < length <= _LONGEST_MESSAGE + 1:
                del received[:1]
                continue
            end = _HEADER_BYTES - 1 + length
            if len(received) < end:
                return None
            message = bytes(received[_HEADER_BYTES:end])
            del received[:end]
            if (transaction, answering) == (self._transaction, unit):
                return message
        return None


@lru_cache(256)
def _rtu_frame(unit: int, message: bytes) -> bytes:
    frame = bytes((unit,)) + message
    return frame + struct.pack("<H", crc16(frame))


def _rtu_length(received: bytearray, start: int) -> int | None:
    """Length of a frame that begins at `start`: None when too little has come, 0 when no frame begins like this."""
    if len(received) < start + 3:
        return None
    function = received[start + 1]
    if function & REFUSED:
        return 5
    if function in (READ_COILS, READ_INPUTS, READ_REGISTERS):
        return 5 + received[start + 2]
    return 8 if function in (WRITE_COIL, WRITE_REGISTER, LOOP_BACK, WRITE_REGISTERS) else 0


def _crc_of_byte(byte: int) -> int:
    for _ in range(8):
        byte = byte >> 1 ^ _POLYNOMIAL if byte & 1 else byte >> 1
    return byte


_CRC_OF_BYTE = tuple(map(_crc_of_byte, range(256)))
