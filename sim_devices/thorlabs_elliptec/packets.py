"""Packets of the Thorlabs Elliptec bus, as a module hears them: their length is fixed by the command."""

from __future__ import annotations

from dataclasses import dataclass

ADDRESSES = "0123456789ABCDEF"
GIVES_UP_S = 2.0

# data characters that follow the address and the two letters
_DATA_LENGTHS = {
    **dict.fromkeys(("in", "gs", "gp", "fw", "bw", "gj", "go", "gv", "st", "us", "om", "cm"), 0),
    **dict.fromkeys(("i1", "i2", "i3", "s1", "s2", "s3"), 0),
    **dict.fromkeys(("ho", "ca", "ga"), 1),
    **dict.fromkeys(("sv", "is"), 2),
    **dict.fromkeys(("f1", "b1", "f2", "b2", "f3", "b3"), 4),
    **dict.fromkeys(("ma", "mr", "sj", "so"), 8),
}


@dataclass(frozen=True)
class Packet:
    """A command with its data, for the module at `address`."""

    address: str
    command: str
    data: str = ""

    @property
    def value(self) -> int | None:
        """The data as a number without sign; None unless they are upper-case hex digits."""
        return int(self.data, 16) if self.data and set(self.data) <= set(ADDRESSES) else None

    @property
    def signed(self) -> int | None:
        """The data as a number of 32 bits in two's complement."""
        value = self.value
        return None if value is None else (value + (1 << 31)) % (1 << 32) - (1 << 31)


class PacketReader:
    """Puts packets together, character by character; what cannot be one is passed over.

    Attributes
    ----------
    unfinished : str
        What has come of the next packet.
    """

    def __init__(self) -> None:
        self.unfinished = ""

    def take(self, character: str) -> Packet | None:
        """Take one character; the packet that it completes. A command that does not exist is one without data."""
        if character == "\r":
            self.unfinished = ""
        if character in "\r\n":
            return None
        begun = self.unfinished + character
        if len(begun) == 1 or (len(begun) == 2 and not _is_letter(character)):
            # what should have been a command may be the address of the next packet
            self.unfinished = character if character in ADDRESSES else ""
            return None
        if len(begun) - 3 < _DATA_LENGTHS.get(begun[1:3], 0) or len(begun) < 3:
            self.unfinished = begun
            return None
        self.unfinished = ""
        return Packet(begun[0], begun[1:3], begun[3:])


def _is_letter(character: str) -> bool:
    return "a" <= character <= "z"
