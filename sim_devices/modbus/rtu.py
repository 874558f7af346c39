"""Modbus RTU: frames with checksums on a serial line, or the same bytes through TCP.

A byte stream over TCP has no silences of 3.5 characters that could be relied on, so frames are told by their length and
checksum: bytes that no frame can begin with are dropped, and the first complete frame behind them counts. A silence
that no computer's own delays explain does end a frame.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator

from sim_devices.device import Replies
from sim_devices.modbus.functions import BROADCAST, Unit

_SHORTEST_FRAME, _LONGEST_FRAME = 4, 256
_SILENCE_CHARACTERS = 3.5
_LONG_SILENCE_S = 0.2

# lengths of frames by function: fixed ones, and those with a count of bytes at a place that adds to the rest
_FIXED_REQUESTS = dict.fromkeys((0x01, 0x02, 0x03, 0x04, 0x05, 0x06, 0x08), 8)
_COUNTED_REQUESTS = {0x0F: (6, 9), 0x10: (6, 9), 0x17: (10, 13)}
_FIXED_REPLIES = dict.fromkeys((0x05, 0x06, 0x08, 0x0F, 0x10), 8) | dict.fromkeys(range(0x80, 0x100), 5)
_COUNTED_REPLIES = dict.fromkeys((0x01, 0x02, 0x03, 0x04, 0x17), (2, 5))


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


def exchange_s(unit: Unit, request: bytes, answer: bytes) -> float:
    """Time of one exchange on the serial line: request and answer framed, the silence between, and the latency."""
    frames = len(request) + len(answer) + 2 * 3
    return unit.latency_s + (frames + _SILENCE_CHARACTERS) * unit.character_s


class RtuSession:
    """One client of one unit on the bus.

    Parameters
    ----------
    unit : Unit
        The device. Frames for and from other units are passed over, and broadcasts are obeyed without an answer.
    """

    def __init__(self, unit: Unit) -> None:
        self._unit = unit
        self._buffer = b""
        self._free_s = float("-inf")
        self._heard_s = float("-inf")

    def receive(self, data: bytes, now_s: float) -> Replies:
        """Answer every request that is complete."""
        if self._buffer and now_s > self._heard_s + _LONG_SILENCE_S:
            self._unit.note_bad_frame()
            self._buffer = b""
        self._heard_s = now_s
        replies: Replies = []
        for start in range(0, len(data), _LONGEST_FRAME):
            self._buffer += data[start : start + _LONGEST_FRAME]
            while (frame := self._next_frame()) is not None:
                replies += self._obey(frame[0], frame[1:-2], now_s)
        return replies

    def _obey(self, unit: int, request: bytes, now_s: float) -> Replies:
        if unit not in (self._unit.unit, BROADCAST):
            return []
        answer = self._unit.answer(request, now_s)
        if unit == BROADCAST:
            return []
        self._free_s = max(now_s, self._free_s) + exchange_s(self._unit, request, answer)
        body = bytes([unit]) + answer
        return [(self._free_s, body + crc16(body))]

    def _next_frame(self) -> bytes | None:
        """Cut the first complete frame out of what has arrived, and drop what lies before it."""
        # A request for this unit behind bytes that still wait for more proves that these were no frame. Behind garbage
        # only what this unit must not miss is looked for.
        ours = (self._unit.unit, BROADCAST)
        for start in (place for place, byte in enumerate(self._buffer) if not place or byte in ours):
            for length in self._possible_lengths(start):
                frame = self._buffer[start : start + length]
                if _SHORTEST_FRAME <= length == len(frame) <= _LONGEST_FRAME and crc16(frame[:-2]) == frame[-2:]:
                    if start:
                        self._unit.note_bad_frame()
                    self._buffer = self._buffer[start + length :]
                    return frame
        self._buffer = self._buffer[-_LONGEST_FRAME:]
        return None

    def _possible_lengths(self, start: int) -> Iterator[int]:
        """Lengths of a frame that begins at `start`, as far as what has come of it tells."""
        head = self._buffer[start : start + _LONGEST_FRAME]
        is_for_this = head[0] in (self._unit.unit, BROADCAST)
        if len(head) < _SHORTEST_FRAME:
            return
        known = list(_lengths(head, _FIXED_REQUESTS, _COUNTED_REQUESTS))
        if not is_for_this:
            known += _lengths(head, _FIXED_REPLIES, _COUNTED_REPLIES)
        # the length of an unknown function's frame is known only when nothing follows it
        yield from known if known or start else [len(head)]


def _lengths(head: bytes, fixed: dict[int, int], counted: dict[int, tuple[int, int]]) -> Iterator[int]:
    function = head[1]
    if function in fixed:
        yield fixed[function]
    elif function in counted:
        place, rest = counted[function]
        yield rest + head[place] if len(head) > place else _LONGEST_FRAME + 1
