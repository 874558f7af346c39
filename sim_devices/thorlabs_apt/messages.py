"""Messages of the Thorlabs APT protocol, as a controller reads and writes them.

There is no start byte and no checksum. A header is believed when its number is one that messages may have, it is
addressed by a host to a controller, a rack or a bay and, if data follow, announces no more of them than any message
has; otherwise its first byte is dropped. A message whose rest does not come is given up, so that neither memory nor the
next command is lost to it.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

HOST, MOTHERBOARD, SINGLE_UNIT = 0x01, 0x11, 0x50
BAYS = range(0x21, 0x2B)
CHANNEL = 1

_HOSTS = range(0x01, 0x10)

_HEADER_BYTES = 6
_HAS_DATA = 0x80
_HIGHEST_NUMBER = 0x7FFF
_MOST_DATA_BYTES = 512
_PATIENCE_S = 0.5


@dataclass(frozen=True)
class AptMessage:
    """A message: two parameters, or data, which may be empty.

    Parameters
    ----------
    number : int
        Which message it is.
    destination, source : int
        Addresses.
    parameters : (int, int)
        Of a short message; zeros in a long one.
    data : bytes, optional
        Of a long message.
    """

    number: int
    destination: int
    source: int
    parameters: tuple[int, int] = (0, 0)
    data: bytes | None = None

    @property
    def channel(self) -> int | None:
        """The channel that a message to a motor names; None when its data are too short to name one."""
        if self.data is None:
            return self.parameters[0]
        return int.from_bytes(self.data[:2], "little") if len(self.data) >= 2 else None

    def answer(self, number: int, *parameters: int) -> AptMessage:
        """A short message back, from the address that this one was sent to."""
        first, second = (*parameters, 0, 0)[:2]
        return AptMessage(number, self.source, self.destination, (first, second))

    def answer_with_data(self, number: int, data: bytes) -> AptMessage:
        """A long message back, from the address that this one was sent to."""
        return AptMessage(number, self.source, self.destination, data=data)

    def encode(self) -> bytes:
        """The bytes on the line."""
        if self.data is None:
            return struct.pack("<HBBBB", self.number, *self.parameters, self.destination, self.source)
        size = len(self.data)
        return struct.pack("<HHBB", self.number, size, self.destination | _HAS_DATA, self.source) + self.data


class AptReader:
    """Cuts what a client sends into messages."""

    def __init__(self) -> None:
        self._received = bytearray()
        self._last_s = float("-inf")

    def feed(self, data: bytes, now_s: float) -> list[AptMessage]:
        """Messages that are complete now."""
        if now_s - self._last_s > _PATIENCE_S:
            self._received.clear()
        self._last_s = now_s
        self._received += data
        messages = []
        while (message := self._next()) is not None:
            messages.append(message)
        return messages

    def _next(self) -> AptMessage | None:
        while len(self._received) >= _HEADER_BYTES:
            header = bytes(self._received[:_HEADER_BYTES])
            size = _data_bytes(header)
            if size is None:
                del self._received[0]
                continue
            end = _HEADER_BYTES + size
            if len(self._received) < end:
                return None
            data = bytes(self._received[_HEADER_BYTES:end])
            del self._received[:end]
            return _message(header, data)
        return None


def _data_bytes(header: bytes) -> int | None:
    """How many data bytes follow a header; None when it is none."""
    number, destination, source = int.from_bytes(header[:2], "little"), header[4] & ~_HAS_DATA, header[5]
    if not 0 < number <= _HIGHEST_NUMBER or source not in _HOSTS:
        return None
    if destination not in BAYS and destination not in (MOTHERBOARD, SINGLE_UNIT):
        return None
    size = int.from_bytes(header[2:4], "little") if header[4] & _HAS_DATA else 0
    return size if size <= _MOST_DATA_BYTES else None


def _message(header: bytes, data: bytes) -> AptMessage:
    number = int.from_bytes(header[:2], "little")
    destination, source = header[4] & ~_HAS_DATA, header[5]
    if header[4] & _HAS_DATA:
        return AptMessage(number, destination, source, data=data)
    return AptMessage(number, destination, source, (header[2], header[3]))
