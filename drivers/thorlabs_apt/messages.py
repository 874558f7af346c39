"""The messages of Thorlabs' APT protocol, little endian, without checksum: bytes in, message or None out, and back."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Any

HOST = 0x01
RACK = 0x11
SINGLE_UNIT = 0x50
_BAYS = range(0x21, 0x2B)
_SOURCES = frozenset((RACK, SINGLE_UNIT, *_BAYS))

REQ_INFO, GET_INFO = 0x0005, 0x0006
STOP_UPDATES = 0x0012
REQ_BAY_USED, GET_BAY_USED = 0x0060, 0x0061
FAULT, RICH_FAULT = 0x0080, 0x0081
SET_CHANNEL_ENABLED, REQ_CHANNEL_ENABLED, GET_CHANNEL_ENABLED = 0x0210, 0x0211, 0x0212
SET_VELOCITY, REQ_VELOCITY, GET_VELOCITY = 0x0413, 0x0414, 0x0415
SET_BACKLASH, REQ_BACKLASH, GET_BACKLASH = 0x043A, 0x043B, 0x043C
REQ_HOME_SETTINGS, GET_HOME_SETTINGS = 0x0441, 0x0442
MOVE_HOME = 0x0443
MOVE_ABSOLUTE = 0x0453
MOVE_STOP = 0x0465
REQ_STATUS, GET_STATUS = 0x0480, 0x0481
REQ_DC_STATUS, GET_DC_STATUS, ACK_DC_STATUS = 0x0490, 0x0491, 0x0492

CHANNEL = 1
"""Every unit and every bay has its motor on channel 1."""

_HEADER_BYTES = 6
_LONG = 0x80
_LONGEST_DATA = 255
_INFO = struct.Struct("<I8sH4B60s3H")
_RICH_RESPONSE = struct.Struct("<HH64s")
_STATUS = struct.Struct("<HiiI")
_DC_STATUS = struct.Struct("<HiHHI")
_VELOCITY = struct.Struct("<Hiii")
_BACKLASH = struct.Struct("<Hi")
_HOME_SETTINGS = struct.Struct("<HHHii")


class Garbled(ValueError):
    """Bytes that cannot be a message from a device to the host, or a message that cannot be what it says it is."""


@dataclass(frozen=True)
class Message:
    """One message from a device; `first` and `second` are a short message's two parameters, `data` a long one's."""

    number: int
    source: int
    first: int = 0
    second: int = 0
    data: bytes = b""


@dataclass(frozen=True)
class Velocity:
    """Acceleration and highest velocity, in the device's own units."""

    acceleration: int
    velocity: int


def take_message(received: bytearray) -> Message | None:
    """Remove the first message from `received` and return it; None when more bytes are needed.

    Raises
    ------
    Garbled
        When the bytes are no header of a message from a device to the host; nothing is removed.
    """
    if (len(received) > 4 and received[4] & ~_LONG != HOST) or (len(received) > 5 and received[5] not in _SOURCES):
        raise Garbled(f"the bytes {received[:_HEADER_BYTES].hex(' ')} are no header of a message")
    if len(received) < _HEADER_BYTES:
        return None
    number, length, destination, source = struct.unpack_from("<HHBB", received)
    if not destination & _LONG:
        message = Message(number, source, first=received[2], second=received[3])
        del received[:_HEADER_BYTES]
        return message
    if length > _LONGEST_DATA:
        raise Garbled(
            f"the bytes {received[:_HEADER_BYTES].hex(' ')} announce {length} bytes, more than any message has"
        )
    if len(received) < _HEADER_BYTES + length:
        return None
    message = Message(number, source, data=bytes(received[_HEADER_BYTES : _HEADER_BYTES + length]))
    del received[: _HEADER_BYTES + length]
    return message


def short_message(number: int, address: int, first: int = 0, second: int = 0) -> bytes:
    """Make a message of two parameters."""
    return struct.pack("<HBBBB", number, first, second, address, HOST)


def long_message(number: int, address: int, data: bytes) -> bytes:
    """Make a message with data behind it."""
    return struct.pack("<HHBB", number, len(data), address | _LONG, HOST) + data


def set_velocity(address: int, velocity: Velocity) -> bytes:
    """Make the message that sets acceleration and highest velocity; motions begin at rest."""
    return long_message(SET_VELOCITY, address, _VELOCITY.pack(CHANNEL, 0, velocity.acceleration, velocity.velocity))


def set_backlash(address: int, counts: int) -> bytes:
    """Make the message that sets how far the controller goes below a target that it comes to from above."""
    return long_message(SET_BACKLASH, address, _BACKLASH.pack(CHANNEL, counts))


def move_absolute(address: int, counts: int) -> bytes:
    """Make the message that begins a move; raises struct.error for counts of more than 32 bits."""
    return long_message(MOVE_ABSOLUTE, address, struct.pack("<Hi", CHANNEL, counts))


def model_of(info: Message) -> str:
    """The model that a device names in its answer to HW_REQ_INFO."""
    return _text(_unpack(_INFO, info)[1])


def serial_number_of(info: Message) -> int:
    """The serial number in the same answer."""
    return int(_unpack(_INFO, info)[0])


def velocity_of(message: Message) -> Velocity:
    """Acceleration and highest velocity in an answer to REQ_VELOCITY."""
    channel, _, acceleration, velocity = _unpack(_VELOCITY, message)
    _require_channel(channel)
    return Velocity(acceleration, velocity)


def backlash_of(message: Message) -> int:
    """Backlash in counts, in an answer to REQ_BACKLASH."""
    channel, counts = _unpack(_BACKLASH, message)
    _require_channel(channel)
    return int(counts)


def home_offset_of(message: Message) -> int:
    """How far from its switch the zero lies, in counts, in an answer to REQ_HOME_SETTINGS."""
    channel, _, _, _, counts = _unpack(_HOME_SETTINGS, message)
    _require_channel(channel)
    return int(counts)


def status_of(message: Message) -> tuple[int, int]:
    """Position in counts, and status bits, of either kind of status answer."""
    if message.number == GET_STATUS:
        channel, position, _, bits = _unpack(_STATUS, message)
    else:
        channel, position, _, _, bits = _unpack(_DC_STATUS, message)
    _require_channel(channel)
    return position, bits


def fault_of(message: Message) -> str | None:
    """What a device reports of its own accord when something is wrong with it; None for any other message."""
    if message.number == FAULT:
        return "a fault that it does not describe"
    if message.number == RICH_FAULT:
        _, code, text = _unpack(_RICH_RESPONSE, message)
        return f"fault {code}: {_text(text)}"
    return None


def _text(padded: bytes) -> str:
    return padded.partition(b"\0")[0].decode("ascii", errors="replace").strip()


def _unpack(layout: struct.Struct, message: Message) -> tuple[Any, ...]:
    if len(message.data) != layout.size:
        raise Garbled(f"message 0x{message.number:04X} has {len(message.data)} bytes of data, not {layout.size}")
    return layout.unpack(message.data)


def _require_channel(channel: int) -> None:
    if channel != CHANNEL:
        raise Garbled(f"the answer is for channel {channel}, not {CHANNEL}")
