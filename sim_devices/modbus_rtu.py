"""The server side of Modbus RTU: frames, checksums, and functions on registers of 32-bit items.

A byte stream over TCP has no silences, so frames are told by their length and checksum: bytes that no frame can
begin with are dropped, and the first complete frame behind them counts.
"""

from __future__ import annotations

import struct
from typing import Protocol

from sim_devices.device import Replies

_SHORTEST_FRAME, _LONGEST_FRAME = 4, 256
_FIXED_LENGTH = 8
_MOST_READ, _MOST_WRITTEN, _MOST_WRITTEN_WITH_READ = 125, 123, 121
BROADCAST = 0


class ModbusError(Exception):
    """A request that is answered with an exception code: 1 function, 2 address, 3 value, 4 device."""

    def __init__(self, code: int) -> None:
        super().__init__(code)
        self.code = code


class Registers(Protocol):
    """What a device offers at its addresses. All raise ModbusError."""

    latency_s: float

    def read(self, address: int, count: int, now_s: float) -> list[int]:
        """Contents of `count` registers."""
        ...

    def write(self, address: int, values: list[int], now_s: float) -> None:
        """Write several registers; nothing is written when any of them is refused."""
        ...

    def write_one(self, address: int, value: int, now_s: float) -> None:
        """Write a single register."""
        ...

    def note_bad_frame(self) -> None:
        """Bytes came that are no frame."""
        ...


def _crc_table() -> list[int]:
    table = []
    for byte in range(256):
        for _ in range(8):
            byte = byte >> 1 ^ 0xA001 if byte & 1 else byte >> 1
        table.append(byte)
    return table


_CRC_TABLE = _crc_table()


def crc16(data: bytes) -> bytes:
    """Checksum of a frame, low byte first (polynomial 0xA001, start 0xFFFF)."""
    crc = 0xFFFF
    for byte in data:
        crc = crc >> 8 ^ _CRC_TABLE[(crc ^ byte) & 0xFF]
    return struct.pack("<H", crc)


class RtuSession:
    """One client of one unit on the bus.

    Parameters
    ----------
    unit : int
        Address of the device; frames for others are passed over, and broadcasts are obeyed without an answer.
    registers : Registers
        The device.
    """

    def __init__(self, unit: int, registers: Registers) -> None:
        self._unit, self._registers = unit, registers
        self._buffer = b""

    def receive(self, data: bytes, now_s: float) -> Replies:
        """Answer every request that is complete."""
        self._buffer += data
        replies: Replies = []
        while (frame := self._next_frame()) is not None:
            unit, request = frame[0], frame[1:-2]
            if unit not in (self._unit, BROADCAST):
                continue
            answer = self._answer(request, now_s)
            if unit != BROADCAST:
                body = bytes([unit]) + answer
                replies.append((now_s + self._registers.latency_s, body + crc16(body)))
        return replies

    def _next_frame(self) -> bytes | None:
        """Cut the first complete frame out of what has arrived, and drop what lies before it."""
        # a request for this unit behind bytes that still wait for more proves that these were no frame
        for start in range(len(self._buffer)):
            length = self._frame_length(start)
            if length is not None:
                if start:
                    self._registers.note_bad_frame()
                frame, self._buffer = self._buffer[start : start + length], self._buffer[start + length :]
                return frame
        self._buffer = self._buffer[-_LONGEST_FRAME:]
        return None

    def _frame_length(self, start: int) -> int | None:
        """Length of the frame that begins at `start`, when it is complete and its checksum is right."""
        available = len(self._buffer) - start
        if available < _SHORTEST_FRAME or (start and self._buffer[start] not in (self._unit, BROADCAST)):
            return None
        length = _request_length(self._buffer[start:])
        if length is None:
            # the length of an unknown function's request is known only when nothing follows it
            if start:
                return None
            length = available
        if not _SHORTEST_FRAME <= length <= min(available, _LONGEST_FRAME):
            return None
        frame = self._buffer[start : start + length]
        return length if crc16(frame[:-2]) == frame[-2:] else None

    def _answer(self, request: bytes, now_s: float) -> bytes:
        function = request[0]
        try:
            return bytes([function]) + self._run(function, request[1:], now_s)
        except ModbusError as error:
            return bytes([function | 0x80, error.code])

    def _run(self, function: int, data: bytes, now_s: float) -> bytes:
        match function:
            case 0x03:
                return self._read(*struct.unpack(">HH", data), now_s=now_s)
            case 0x06:
                address, value = struct.unpack(">HH", data)
                self._registers.write_one(address, value, now_s)
                return data
            case 0x08:
                if data[:2] != b"\0\0":
                    raise ModbusError(3)
                return data
            case 0x10:
                self._write(data, _MOST_WRITTEN, now_s)
                return data[:4]
            case 0x17:
                # the write comes first, so that what was written can be read back
                self._write(data[4:], _MOST_WRITTEN_WITH_READ, now_s)
                return self._read(*struct.unpack(">HH", data[:4]), now_s=now_s)
            case _:
                raise ModbusError(1)

    def _read(self, address: int, count: int, *, now_s: float) -> bytes:
        if not 1 <= count <= _MOST_READ:
            raise ModbusError(3)
        values = self._registers.read(address, count, now_s)
        return struct.pack(f">B{count}H", 2 * count, *values)

    def _write(self, data: bytes, most: int, now_s: float) -> None:
        address, count, size = struct.unpack(">HHB", data[:5])
        if not 1 <= count <= most or size != 2 * count:
            raise ModbusError(3)
        self._registers.write(address, list(struct.unpack(f">{count}H", data[5:])), now_s)


def _request_length(request: bytes) -> int | None:
    """Length of a request as its function and byte count tell it; more than there is when the count has not come."""
    match request[1]:
        case 0x01 | 0x02 | 0x03 | 0x04 | 0x05 | 0x06 | 0x08:
            return _FIXED_LENGTH
        case 0x0F | 0x10:
            return 9 + request[6] if len(request) > 6 else _LONGEST_FRAME
        case 0x17:
            return 13 + request[10] if len(request) > 10 else _LONGEST_FRAME
        case _:
            return None
