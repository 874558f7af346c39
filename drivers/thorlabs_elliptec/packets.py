"""The packets of Thorlabs Elliptec modules: an address, two letters, and hexadecimal numbers, high digit first."""

from __future__ import annotations

import re
from dataclasses import dataclass

_DIGITS = {"GS": 2, "PO": 8, "IN": 30, "GV": 2, "GJ": 8, "HO": 8, "I1": 22, "I2": 22, "I3": 22, "BS": 2, "BO": 8}
_PACKET = re.compile(r"([0-9A-F])([A-Z][A-Z0-9])([0-9A-F]*)", re.ASCII)

UNSOLICITED = ("BS", "BO")
"""What a module says when a person uses its buttons or a handset."""

BUSY = 0x09
"""The status of a module that has not finished; its answer is still to come."""

_STATUS = {
    0x01: "communication time-out",
    0x02: "mechanical time-out: the motor did not reach its target, as happens below half the full velocity",
    0x03: "command error or command not supported",
    0x04: "value out of range",
    0x05: "the module is isolated from the bus",
    0x06: "the module is back from isolation",
    0x07: "initialising error",
    0x08: "thermal error",
    BUSY: "busy",
    0x0A: "sensor error",
    0x0B: "motor error",
    0x0C: "out of range",
    0x0D: "over-current",
}


@dataclass(frozen=True)
class Packet:
    """One packet from a module; `data` are hexadecimal digits, as many as `kind` has."""

    address: int
    kind: str
    data: str

    @property
    def unsigned(self) -> int:
        """The data as one number, 0 or more."""
        return int(self.data, 16)

    @property
    def pulses(self) -> int:
        """The data as a position: two's complement of 32 bits."""
        return self.unsigned - (1 << 32) if self.unsigned >= 1 << 31 else self.unsigned


@dataclass(frozen=True)
class Identity:
    """What a module says of itself; `travel` in degrees or mm, `pulses` in a full turn, or in one mm."""

    model: int
    serial: str
    travel: int
    pulses: int


def parse_packet(line: bytes) -> Packet | None:
    """Read a line without its ending; None when it is no packet of a module."""
    match = _PACKET.fullmatch(line.decode("latin-1"))
    if match is None or _DIGITS.get(match[2]) != len(match[3]):
        return None
    return Packet(int(match[1], 16), match[2], match[3])


def identity_of(packet: Packet) -> Identity:
    """Read an ``IN`` packet: type, serial number, year, firmware, hardware, travel and pulses."""
    data = packet.data
    return Identity(int(data[:2], 16), data[2:10], int(data[18:22], 16), int(data[22:30], 16))


def command(address: int, letters: str, data: str = "") -> bytes:
    """Make a packet to a module; it has no ending, its length follows from its letters."""
    return f"{address:X}{letters}{data}".encode("ascii")


def hex_pulses(pulses: int) -> str:
    """Write a position of 32 bits; raises OverflowError for more."""
    return pulses.to_bytes(4, "big", signed=True).hex().upper()


def status_text(status: int) -> str:
    """What a status means to a person."""
    return _STATUS.get(status, f"status 0x{status:02X}, which is not in its manual")
