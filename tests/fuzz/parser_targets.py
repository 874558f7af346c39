"""The drivers' parsers alone, with what must hold of anything they accept."""

from __future__ import annotations

import math
import random
import re
import struct
from collections.abc import Callable

from crc16 import crc16, framed
from stream_run import StreamRun, lines
from target import Target

from drivers.modbus.frames import RtuFraming, TcpFraming
from drivers.newport_esp301.errors import parse_error as parse_esp301_error
from drivers.stanford_sr830.lock_in import parse_condition, parse_sample
from drivers.thorlabs_apt.messages import (
    HOST,
    Garbled,
    Message,
    fault_of,
    model_of,
    status_of,
    take_message,
    velocity_of,
)
from drivers.thorlabs_elliptec.packets import identity_of, parse_packet
from drivers.thorlabs_fw102c import parse_exchange
from drivers.thorlabs_pm100.errors import parse_error as parse_pm100_error
from drivers.wire.framing import take_exactly
from drivers.wire.reply_text import number, switch, whole_number
from goniometer.errors import ReplyError

_UNIT = 1


def _values(*readers: Callable[[str], object]) -> Callable[[bytes], str]:
    """Let every reader look at a line; what it returns must be what the line says, or it is refused."""

    def read(frame: bytes) -> str:
        line, accepted = frame.decode("ascii", errors="replace").strip(), False
        for reader in readers:
            try:
                value = reader(line)
            except ReplyError:
                continue
            accepted = True
            if isinstance(value, float):
                assert math.isfinite(value)
                assert set(line) <= set("0123456789+-.eE")
        return "accepted" if accepted else "refused"

    return read


def _exchange(frame: bytes) -> str:
    exchange = parse_exchange(frame)
    assert "\r" not in exchange.echo
    assert "\0" not in exchange.echo + exchange.answer
    return "accepted"


def _packet(frame: bytes) -> str:
    packet = parse_packet(frame)
    if packet is None:
        return "refused"
    assert f"{packet.address:X}{packet.kind}{packet.data}".encode() == frame
    assert re.fullmatch(rb"[0-9A-F][A-Z][A-Z1-3][0-9A-F]+", frame)
    assert packet.pulses >= -(1 << 31) or packet.kind[0] == "I"
    if packet.kind == "IN":
        assert identity_of(packet).pulses == int(frame[25:33], 16)
    return "accepted"


def _message(received: bytearray, near: bytes) -> str:
    before = bytes(received)
    try:
        message = take_message(received)
    except Garbled:
        assert received == before
        del received[:1]  # as the port does when it looks for an answer
        return "refused"
    if message is None:
        return "more"
    taken = before[: len(before) - len(received)]
    assert taken == _encoded(message, is_long=bool(taken[4] & 0x80))
    for read in (model_of, velocity_of, status_of, fault_of):
        try:
            read(message)
        except Garbled:
            continue
    return "accepted"


def _encoded(message: Message, *, is_long: bool) -> bytes:
    if is_long:
        return struct.pack("<HHBB", message.number, len(message.data), HOST | 0x80, message.source) + message.data
    return struct.pack("<HBBBB", message.number, message.first, message.second, HOST, message.source)


def _begin_rtu(random_: random.Random) -> StreamRun:
    framing = RtuFraming()

    def take(received: bytearray, near: bytes) -> str:
        message = framing.take(received, _UNIT)
        if message is None:
            assert len(received) <= 260
            return "more"
        body = bytes([_UNIT]) + message
        assert body + crc16(body) in near, f"accepted {body.hex(' ')} without its checksum on the wire"
        return "accepted" if body in RTU_BODIES else "collision"

    return StreamRun([framed(body) for body in RTU_BODIES], random_, take)


def _begin_tcp(random_: random.Random) -> StreamRun:
    framing, messages = TcpFraming(), [body[1:] for body in RTU_BODIES]
    framing.wrap(_UNIT, b"\3")
    header = struct.Struct(">HHHB")

    def take(received: bytearray, near: bytes) -> str:
        message = framing.take(received, _UNIT)
        if message is None:
            assert len(received) <= 260
            return "more"
        assert header.pack(1, 0, len(message) + 1, _UNIT) + message in near
        return "accepted"

    frames = [header.pack(number, 0, len(message) + 1, _UNIT) + message for message in messages for number in (1, 2)]
    return StreamRun(frames, random_, take)


def _begin_exactly(random_: random.Random) -> StreamRun:
    def take(received: bytearray, near: bytes) -> str:
        frame = take_exactly(received, 7)
        assert len(received) < 7 or frame is not None
        return "more" if frame is None else "accepted"

    return StreamRun([b"0123456", b"abcdefghij"], random_, take)


RTU_BODIES = [
    bytes.fromhex(text)
    for text in (
        "01 03 04 00 00 21 34",
        "01 03 20" + "5A01" * 16,
        "01 01 02 00 01",
        "01 02 02 07 00",
        "01 05 00 19 FF 00",
        "01 06 00 7D 00 10",
        "01 08 00 00 A5 37",
        "01 10 00 58 00 10",
        "01 83 02",
        "02 03 04 00 00 3A 98",
        "01 90 03",
    )
]
APT_FRAMES = [
    bytes.fromhex("06 00 54 00 81 50") + bytes(84),
    bytes.fromhex("81 04 0E 00 81 50 01 00 00 00 5D 00 00 00 5D 00 00 25 00 90"),
    bytes.fromhex("91 04 0E 00 81 50 01 00 00 10 00 00 00 00 00 00 00 25 00 90"),
    bytes.fromhex("15 04 0E 00 81 22 01 00 00 00 00 00 AC 3A 00 00 55 55 5E 04"),
    bytes.fromhex("12 02 01 01 01 50"),
    bytes.fromhex("44 04 01 00 01 21"),
    bytes.fromhex("61 00 00 01 01 11"),
    bytes.fromhex("81 00 44 00 81 50 65 04 03 00") + b"over-current".ljust(64, b"\0"),
]

_NUMBERS = [b"12.500000", b"-0.5", b"1.234205E-03", b"9.9E+37", b"0", b"1", b"7", b"+3", b"-3.59302e-07"]
LINE_READERS = {
    "esp301": _values(
        lambda line: number("axis", "TP?", line),
        lambda line: switch("axis", "MD?", line),
        lambda line: whole_number("axis", "SN?", line),
        lambda line: parse_esp301_error("axis", line),
    ),
    "fw102c": _exchange,
    "pm100": _values(lambda line: number("meter", "READ?", line), lambda line: parse_pm100_error("meter", line)),
    "sr830": _values(lambda line: parse_sample("lock-in", line), lambda line: parse_condition("lock-in", line)),
    "elliptec": _packet,
}
TARGETS = [
    Target(
        "esp301",
        "parser",
        lines(
            [line + b"\r\n" for line in [*_NUMBERS, b"0, 451322, NO ERROR DETECTED", b"113, 5, MOTOR NOT ENABLED"]],
            b"\r\n",
            LINE_READERS["esp301"],
        ),
    ),
    Target(
        "fw102c",
        "parser",
        lines(
            [b"pos?\r3\r> ", b"\0\0pos=2\r> ", b"x\rCommand error CMD_NOT_DEFINED\r> "], b"> ", LINE_READERS["fw102c"]
        ),
    ),
    Target(
        "pm100",
        "parser",
        lines(
            [line + b"\n" for line in [*_NUMBERS, b'0,"No error"', b'-113,"Undefined header"', b"+0,No error"]],
            b"\n",
            LINE_READERS["pm100"],
        ),
    ),
    Target(
        "sr830",
        "parser",
        lines(
            [line + b"\r" for line in [*_NUMBERS, b"0.00103,12.5,317.2", b"255", b"26"]],
            b"\r",
            LINE_READERS["sr830"],
        ),
    ),
    Target(
        "elliptec",
        "parser",
        lines(
            [
                b"0IN0E1140028420211401016800023000\r\n",
                b"0PO00004600\r\n",
                b"BGS09\r\n",
                b"0GV64\r\n",
                b"0GJ00004600\r\n",
                b"0I1110300FFFFFFFF00B8008D\r\n",
                b"3BO00000020\r\n",
            ],
            b"\r\n",
            LINE_READERS["elliptec"],
        ),
    ),
    Target("apt", "parser", lambda random_: StreamRun(APT_FRAMES, random_, _message)),
    Target("modbus_rtu", "parser", _begin_rtu),
    Target("modbus_tcp", "parser", _begin_tcp),
    Target("fixed_length", "parser", _begin_exactly),
]
