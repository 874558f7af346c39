"""What the kinds of Elliptec modules have in common: what a module moves, how a motion ends, and its error codes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

OK, COMMUNICATION_TIMEOUT, MECHANICAL_TIMEOUT, NOT_SUPPORTED, OUT_OF_RANGE, BUSY = 0, 1, 2, 3, 4, 9
LONGEST_DRIVE_S = 2.0


# a time, and what a module says then without its address, or what finds out; None is silence
Said = tuple[float, str | Callable[[float], str | None]]


class ElliptecError(Exception):
    """A command that is answered with a status."""

    def __init__(self, status: int) -> None:
        super().__init__(status)
        self.status = status


@dataclass(frozen=True)
class Drive:
    """What a module is busy with until `end_s`, and the status it ends with."""

    end_s: float
    status: int = OK
    can_be_stopped: bool = False


class Mover(Protocol):
    """The part of a module that moves.

    Attributes
    ----------
    type_code, travel, pulses : int
        As the module tells them of itself.
    motors : int
        How many it has.
    """

    type_code: int
    travel: int
    pulses: int
    motors: int

    def position(self, now_s: float) -> int:
        """Position in pulses."""
        ...

    def drive(self, command: str, value: int | None, now_s: float, *, percent: int) -> Drive:
        """Begin one of the motions ho, ma, mr, fw, bw; raises ElliptecError, and then nothing has moved."""
        ...

    def stop(self, now_s: float) -> float:
        """Stop; when it rests."""
        ...

    def power_cycle(self, now_s: float) -> None:
        """Stop, and forget what a module forgets without power."""
        ...

    def setting(self, command: str, value: int | None) -> int:
        """Set or get jog step (sj, gj) or home offset (so, go); raises ElliptecError."""
        ...
