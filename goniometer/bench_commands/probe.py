"""What is asked at a port, in which order and at which rates; and what came of it."""

from __future__ import annotations

import errno
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial

from drivers.wire.link import Link
from drivers.wire.wire_log import WireLog
from goniometer.bench_commands.identify import (
    APT,
    ELLIPTEC,
    IDENTITY_CR,
    IDENTITY_LF,
    STATUS,
    VERSION,
    Identity,
    Question,
    ask,
    az,
    lec,
)
from goniometer.bench_commands.port_lock import held_ports, holder_of
from goniometer.errors import NotConnectedError
from goniometer.rig_devices.entry import DeviceEntry

_APT_USB = (0x0403, 0xFAF0)
_QUIET_S = 0.05
_WRITE_S = 0.5


@dataclass(frozen=True)
class Round:
    """Questions asked one after the other; how a serial port is opened for them is without effect on a socket."""

    questions: Sequence[Question]
    baudrate: int = 115200
    parity: str = "N"
    rtscts: bool = False


@dataclass(frozen=True)
class Probed:
    """What came of a port: who holds it, why it was not asked or does not open, or what answered; nothing may have."""

    held_by: str = ""
    not_asked: str = ""
    not_opened: str = ""
    answers: tuple[Identity, ...] = ()

    @property
    def was_asked(self) -> bool:
        """Whether the port could be opened."""
        return not (self.held_by or self.not_asked or self.not_opened)

    def __str__(self) -> str:
        if self.held_by:
            return f"held by {self.held_by}; nothing was asked"
        if self.not_asked:
            return f"not asked: {self.not_asked}"
        if self.not_opened:
            return f"cannot be opened: {self.not_opened}"
        return ", ".join(map(str, self.answers)) or "no known device answers"


SOCKET = (
    Round(
        # text first; a Modbus frame last, because it would put an APT controller out of step
        (IDENTITY_LF, IDENTITY_CR, VERSION, *ELLIPTEC, *APT, az(1), lec(1))
    ),
)
MODBUS_TCP = (Round((az(1, over_tcp=True), lec(1, over_tcp=True))),)
HTTP = (Round((STATUS,)),)
APT_USB = (Round(APT, rtscts=True),)
SERIAL = (
    Round((IDENTITY_LF, IDENTITY_CR)),
    # the first question of a rate ends what bytes of other rates have left behind, and may not be understood
    Round((VERSION, VERSION), 19200, rtscts=True),
    Round((IDENTITY_CR, IDENTITY_LF, IDENTITY_CR, *ELLIPTEC), 9600),
    Round((VERSION, VERSION), 921600, rtscts=True),
    Round((lec(1),), 38400),
    Round((az(1),), parity="E"),
)


def rounds_for(port: str, usb: tuple[int, int] | None) -> tuple[Round, ...]:
    """What is asked at a port of which nothing is known but its address and, perhaps, its USB vendor and product."""
    if port.startswith("modbus-tcp://"):
        return MODBUS_TCP
    if port.startswith("http://"):
        return HTTP
    if port.startswith("socket://"):
        return SOCKET
    return APT_USB if usb == _APT_USB else SERIAL


def expected_rounds(port: str, device: DeviceEntry) -> tuple[Round, ...]:
    """What a device of the rig file is asked, at the rate that the file gives; nothing for one that cannot be asked."""
    if greeting := device.greeting:
        question = Question(greeting.question, partial(_greeted, device, greeting.answer))
        return (Round((question,), greeting.baudrate, greeting.parity, greeting.rtscts),)
    said = device.model_dump()
    unit, over_tcp = said.get("unit", 1), port.startswith("modbus-tcp://")
    family = {
        "thorlabs_pm100": (IDENTITY_LF,),
        "stanford_sr830": (IDENTITY_LF,),
        "thorlabs_fw102c": (IDENTITY_CR,),
        "newport_esp301": (VERSION,),
        "thorlabs_elliptec": ELLIPTEC,
        "thorlabs_apt": APT,
        "oriental_az": (az(unit, over_tcp=over_tcp),),
        "smc_lec": (lec(unit, over_tcp=over_tcp),),
        "http_camera": (STATUS,),
    }
    usual = {"thorlabs_elliptec": 9600, "stanford_sr830": 9600, "smc_lec": 38400}
    return tuple(
        Round(
            questions,
            said.get("baudrate", usual.get(driver, 115200)),
            said.get("parity", "none")[0].upper(),
            rtscts=driver in ("newport_esp301", "thorlabs_apt"),
        )
        for driver, questions in family.items()
        if device.driver.startswith(driver)
    )


def _greeted(device: DeviceEntry, answer: bytes, received: bytearray) -> Identity | None:
    if answer not in received:
        return None
    return Identity(device.driver, device.place or "", bytes(received).strip().decode("ascii", errors="replace"))


def probe(port: str, expected: Sequence[Round], others: Sequence[Round], wire_log: WireLog | None = None) -> Probed:
    """Ask all that is expected, then the others until a device answers; a port that a program holds is left alone."""
    if holder := holder_of(port):
        return Probed(held_by=str(holder))
    try:
        with held_ports([port]):
            answers = tuple(answer for one in expected for answer in _answers(port, one, wire_log))
            found = (tuple(_answers(port, one, wire_log)) for one in others)
            return Probed(answers=answers or next(filter(None, found), ()))
    except NotConnectedError as error:
        reason = error.__cause__
        if getattr(reason, "errno", None) in (errno.EBUSY, errno.EAGAIN) or "PermissionError(13" in str(reason):
            return Probed(held_by="another program")
        return Probed(not_opened=str(reason or error.happened))


def _answers(port: str, one: Round, wire_log: WireLog | None) -> Iterator[Identity]:
    link = Link(
        port,
        device=port,
        baudrate=one.baudrate,
        parity=one.parity,
        rtscts=one.rtscts,
        reply_timeout_s=_WRITE_S,
        wire_log=wire_log,
    )
    try:
        if one.questions is APT:  # its manual's way to open the port
            link.set_rts(on=True)
            link.discard_input(_QUIET_S)
            link.set_rts(on=False)
        yield from ask(link, one.questions)
    finally:
        link.close()
