"""A simulated Thorlabs Elliptec module: its address on the bus, its commands, its status and its silence."""

from __future__ import annotations

import math
from collections.abc import Callable

from sim_devices.device import Tell, unheard
from sim_devices.thorlabs_elliptec.module import (
    BUSY,
    COMMUNICATION_TIMEOUT,
    NOT_SUPPORTED,
    OK,
    OUT_OF_RANGE,
    Drive,
    ElliptecError,
    Mover,
    Said,
)
from sim_devices.thorlabs_elliptec.motors import ElliptecMotors
from sim_devices.thorlabs_elliptec.packets import ADDRESSES, Packet
from sim_devices.thorlabs_elliptec.session import ElliptecSession, line

_MOTIONS = ("ho", "ma", "mr", "fw", "bw")
_ANSWERS = {"gj": "GJ", "go": "HO"}
_SEARCH_S = 3.0
_CLEANING_S = {"om": 60.0, "cm": 120.0}
_OK = f"GS{OK:02X}"


class ThorlabsElliptec:
    """A module. It hears everything on its line and speaks when its address, or its group's, is called.

    Parameters
    ----------
    mover : Mover
        What it moves: an `ElliptecRotator` or an `ElliptecSlider`.
    address : str
        One upper-case hex digit.
    serial_number : str
        Eight digits.

    Attributes
    ----------
    tell : callable
        Where it reports, at a time, what somebody did at its button.
    """

    def __init__(self, mover: Mover, address: str = "0", *, serial_number: str = "11400284") -> None:
        if len(address) != 1 or address not in ADDRESSES:
            raise ValueError(f"The address of a module is one of {ADDRESSES}; {address!r} is not.")
        self._mover, self._serial_number = mover, serial_number
        self._motors = ElliptecMotors(mover.motors)
        self._saved_address = address
        self.tell: Tell = unheard
        self._wake()

    def _wake(self) -> None:
        self.address = self._saved_address
        self._group: str | None = None
        self._isolated_until_s = float("-inf")
        self._latched = self._ahead = OK
        self._percent = 100
        self._drive: Drive | None = None
        self._motors.restore()

    def session(self) -> ElliptecSession:
        """A new client."""
        return ElliptecSession(self)

    def power_cycle(self, now_s: float) -> None:
        """Forget everything that was not saved; a motion ends at once."""
        self._mover.power_cycle(now_s)
        self._wake()

    def press(self, now_s: float) -> None:
        """Press the button that moves one step forward, which the module tells of its own accord."""
        if self._is_busy(now_s):
            return
        self._drive = self._mover.drive("fw", None, now_s, percent=self._percent)
        if now_s >= self._isolated_until_s:
            self.tell(now_s, line(self.address, f"BS{OK:02X}"))
            if math.isfinite(self._drive.end_s):
                position = self._mover.position(self._drive.end_s)
                self.tell(self._drive.end_s, line(self.address, f"BO{_hex(position)}"))

    def take(self, packet: Packet, now_s: float) -> list[Said]:
        """Carry out a packet that calls it; what it says, and when, without its address."""
        if not self._is_called(packet.address, now_s):
            return []
        if packet.address == self._group:
            self._group = None
        if self._ahead != OK and not self._is_busy(now_s):
            self._latched, self._ahead = self._ahead, OK
        try:
            return self._run(packet, now_s)
        except ElliptecError as error:
            return [(now_s, self._fail(error.status))]

    def give_up(self, address: str, now_s: float) -> list[Said]:
        """Hear that a packet to an address has not been finished in time."""
        return [(now_s, self._fail(COMMUNICATION_TIMEOUT))] if self._is_called(address, now_s) else []

    def _is_called(self, address: str, now_s: float) -> bool:
        return now_s >= self._isolated_until_s and address in (self.address, self._group)

    def _is_busy(self, now_s: float) -> bool:
        return self._drive is not None and now_s < self._drive.end_s

    def _require_idle(self, now_s: float) -> None:
        if self._is_busy(now_s):
            raise ElliptecError(BUSY)

    def _fail(self, status: int) -> str:
        """Keep an error until it is asked for, and tell it."""
        if status != BUSY:
            self._latched = status
        return f"GS{status:02X}"

    def _run(self, packet: Packet, now_s: float) -> list[Said]:
        command = packet.command
        if command in _MOTIONS:
            return self._move(packet, now_s)
        if command in _CLEANING_S:
            self._require_idle(now_s)
            drive = Drive(now_s + _CLEANING_S[command], can_be_stopped=True)
            return [(now_s, f"GS{BUSY:02X}"), *self._begin(drive, lambda _: _OK)]
        if command == "st":
            return self._stop(now_s)
        if command[1] in "123":
            return self._motor(packet, int(command[1]), now_s)
        return [(now_s, self._answer(packet, now_s))]

    def _answer(self, packet: Packet, now_s: float) -> str:
        match packet.command:
            case "in":
                return self._identity()
            case "gs":
                return self._status(now_s)
            case "gp":
                return self._position(now_s)
            case "gv":
                return f"GV{self._percent:02X}"
            case "gj" | "go" as question:
                return f"{_ANSWERS[question]}{_hex(self._mover.setting(question, None))}"
            case "sj" | "so" as setting:
                self._mover.setting(setting, packet.signed)
            case "sv":
                self._percent = _within(packet.value, 0x64)
            case "ca":
                self.address = ADDRESSES[_within(packet.value, 0xF)]
            case "ga":
                self._group = ADDRESSES[_within(packet.value, 0xF)]
            case "us":
                self._saved_address = self.address
                self._motors.save()
            case "is":
                self._isolated_until_s = now_s + 60.0 * _within(packet.value, 0xFF)
            case _:
                raise ElliptecError(NOT_SUPPORTED)
        return _OK

    def _begin(self, drive: Drive, answer: Callable[[float], str]) -> list[Said]:
        """Be busy, and say `answer` at the end of it unless it was stopped before."""
        self._drive, self._ahead = drive, drive.status

        def say(time_s: float) -> str | None:
            return answer(time_s) if self._drive is drive else None

        return [(drive.end_s, say)]

    def _move(self, packet: Packet, now_s: float) -> list[Said]:
        self._require_idle(now_s)
        drive = self._mover.drive(packet.command, packet.signed, now_s, percent=self._percent)
        if drive.can_be_stopped:
            self._drive = drive
            return [(now_s, _OK)]
        return self._begin(drive, lambda time_s: f"GS{drive.status:02X}" if drive.status else self._position(time_s))

    def _stop(self, now_s: float) -> list[Said]:
        """End a motion without end, or cleaning; a motion to a target goes on."""
        if self._drive is None or not self._is_busy(now_s):
            return [(now_s, _OK)]
        if not self._drive.can_be_stopped:
            raise ElliptecError(BUSY)
        if self._drive.end_s < float("inf"):
            self._drive = None
            return [(now_s, _OK)]
        return self._begin(Drive(self._mover.stop(now_s)), self._position)

    def _motor(self, packet: Packet, motor: int, now_s: float) -> list[Said]:
        """Tell of a motor, search its frequencies, or set the period of one."""
        self._motors.require(motor)
        match packet.command[0]:
            case "i":
                return [(now_s, f"I{motor}{self._motors.describe(motor)}")]
            case "s":
                self._require_idle(now_s)
                return self._begin(Drive(now_s + _SEARCH_S), lambda _: _OK)
            case "f" | "b" as direction:
                self._motors.set_period(motor, _within(packet.value, 0xFFFF), forward=direction == "f")
                return [(now_s, _OK)]
            case _:
                raise ElliptecError(NOT_SUPPORTED)

    def _identity(self) -> str:
        made_in, firmware, hardware = 2021, 14, 1
        return (
            f"IN{self._mover.type_code:02X}{self._serial_number}{made_in}{firmware}{hardware:02X}"
            f"{self._mover.travel:04X}{self._mover.pulses:08X}"
        )

    def _status(self, now_s: float) -> str:
        if self._is_busy(now_s):
            return f"GS{BUSY:02X}"
        status, self._latched = self._latched, OK
        return f"GS{status:02X}"

    def _position(self, now_s: float) -> str:
        return f"PO{_hex(self._mover.position(now_s))}"


def _hex(value: int) -> str:
    """Eight digits in two's complement."""
    return f"{value % (1 << 32):08X}"


def _within(value: int | None, most: int) -> int:
    if value is None:
        raise ElliptecError(NOT_SUPPORTED)
    if value > most:
        raise ElliptecError(OUT_OF_RANGE)
    return value
