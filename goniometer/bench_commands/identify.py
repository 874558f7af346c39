"""Questions that tell a device's family and do no harm to one of another family.

docs/commands.md says of every family what it makes of every question. In short: no question is a command that another
family knows; each line of text is a whole number of the six bytes in which an APT controller reads, so that it stays in
step; and none holds the byte 4, without which no message to a motor's channel can come about, however it is read.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

from drivers.modbus.frames import READ_REGISTERS, REFUSED, Framing, Request, RtuFraming, TcpFraming, read_request
from drivers.thorlabs_apt.messages import GET_INFO, RACK, REQ_INFO, SINGLE_UNIT, short_message
from drivers.wire.link import Link
from goniometer.errors import ReplyError, ReplyTimeoutError

_REPLY_S = 0.3
_ELLIPTEC_REPLY_S = 0.15
_HTTP_REPLY_S = 2.0
"""A camera may finish an exposure first."""

_AZ_REGISTER, _LEC_REGISTER = 0x007E, 0x9000


@dataclass(frozen=True)
class Identity:
    """What has answered: the driver that fits, its place on a port that may be shared, and its own words."""

    driver: str
    place: str
    says: str

    def __str__(self) -> str:
        return " ".join(part for part in (self.driver, self.place, f"({self.says})") if part)


@dataclass(frozen=True)
class Question:
    """One question of one or more families.

    Attributes
    ----------
    data : bytes
        What is sent.
    recognise : callable
        The identity in what has come, or None for "need more".
    reply_s : float
        Longest wait for the answer, in real seconds.
    """

    data: bytes
    recognise: Callable[[bytearray], Identity | None]
    reply_s: float = _REPLY_S


def ask(link: Link, questions: Sequence[Question]) -> Iterator[Identity]:
    """Ask one question after the other, until a device that has the port for itself has answered.

    What comes back without being an answer may have been garbled by what the device had heard before: the question is
    then asked once more.
    """
    for question in questions:
        found = _asked(link, question) or (_asked(link, question) if link.has_input() else None)
        if found is not None:
            yield found
            if not found.place:
                return


def _asked(link: Link, question: Question) -> Identity | None:
    try:
        link.discard_input()
        link.write(question.data)
        return link.read(question.recognise, question.reply_s)
    except (ReplyTimeoutError, ReplyError):
        return None


def _line(pattern: bytes, driver: str) -> Callable[[bytearray], Identity | None]:
    """Recognise a family by a line of text that holds `pattern`."""
    expression = re.compile(rb"([^\r\n]*" + pattern + rb"[^\r\n]*)[\r\n]", re.IGNORECASE)

    def recognise(received: bytearray) -> Identity | None:
        found = expression.search(received)
        return Identity(driver, "", _text(found[1])) if found else None

    return recognise


def _first_of(*recognisers: Callable[[bytearray], Identity | None]) -> Callable[[bytearray], Identity | None]:
    return lambda received: next(filter(None, (recognise(received) for recognise in recognisers)), None)


def _elliptec(address: str) -> Question:
    expression = re.compile(address.encode() + rb"IN([0-9A-F]{30})")

    def recognise(received: bytearray) -> Identity | None:
        found = expression.search(received)
        return Identity("thorlabs_elliptec", f"address {address}", f"ELL{int(found[1][:2], 16)}") if found else None

    return Question(f"{address}in  \r".encode(), recognise, _ELLIPTEC_REPLY_S)


def _apt(address: int) -> Question:
    expression = re.compile(
        GET_INFO.to_bytes(2, "little") + rb"\x54\x00\x81" + bytes([address]) + rb"(.{84})", re.DOTALL
    )

    def recognise(received: bytearray) -> Identity | None:
        found = expression.search(received)
        if not found:
            return None
        serial, model = int.from_bytes(found[1][:4], "little"), found[1][4:12]
        return Identity("thorlabs_apt", "", f"{_text(model)}, serial number {serial}")

    return Question(short_message(REQ_INFO, address), recognise)


def az(unit: int, *, over_tcp: bool = False) -> Question:
    """Ask a Modbus unit for what an Oriental Motor AZ has there: its driver output status."""
    return _modbus("oriental_az", _AZ_REGISTER, unit, TcpFraming() if over_tcp else RtuFraming())


def lec(unit: int, *, over_tcp: bool = False) -> Question:
    """Ask a Modbus unit for what an SMC LEC has there: its position."""
    return _modbus("smc_lec", _LEC_REGISTER, unit, TcpFraming() if over_tcp else RtuFraming())


def _modbus(driver: str, register: int, unit: int, framing: Framing) -> Question:
    request = read_request(READ_REGISTERS, register, 2)
    return Question(framing.wrap(unit, request.message), partial(_modbus_identity, driver, unit, framing, request))


def _modbus_identity(
    driver: str, unit: int, framing: Framing, request: Request, received: bytearray
) -> Identity | None:
    message = framing.take(received, unit)
    if message is None or not request.is_answered_by(message) or message[0] & REFUSED:
        return None
    return Identity(driver, f"unit {unit}", f"answers the {request.text}")


def _http(received: bytearray) -> Identity | None:
    """Recognise a server of HTTP, and what a camera's status.json says of it."""
    head, ended, body = bytes(received).partition(b"\r\n\r\n")
    if not (head.startswith(b"HTTP/1.") and ended):
        return None
    length = re.search(rb"\r\nContent-Length: *(\d+)", head, re.IGNORECASE)
    if length is not None and len(body) < int(length[1]):
        return None
    said = (re.search(rb'"%s" *: *"?([^",}]*)' % key, body) for key in (b"model", b"serial"))
    about = [_text(found[1]) for found in said if found]
    return Identity("http_camera", "", ", serial ".join(about) or f"a server of HTTP, {_text(head.splitlines()[0])}")


def _text(data: bytes | bytearray) -> str:
    return bytes(data).strip(b"\x00 ").decode("ascii", errors="replace")


_PM100 = _line(rb"THORLABS,[^,\r\n]*,[^,\r\n]*,", "thorlabs_pm100")
_SR830 = _line(rb"Stanford_Research_Systems,SR8[13]0,", "stanford_sr830")
_FW102C = _line(rb"THORLABS FW[12][01]2C", "thorlabs_fw102c")
_ESP301 = _line(rb"ESP30[01]", "newport_esp301")

IDENTITY_LF = Question(b"*IDN?\n", _first_of(_PM100, _SR830))
IDENTITY_CR = Question(b"*idn?\r", _first_of(_FW102C, _SR830))
VERSION = Question(b" VE?\r\n", _ESP301)
ELLIPTEC = tuple(_elliptec(address) for address in "0123456789ABCDEF")
STATUS = Question(b"GET /status.json HTTP/1.0\r\n\r\n", _http, _HTTP_REPLY_S)
APT = (_apt(SINGLE_UNIT), _apt(RACK))
