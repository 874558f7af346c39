"""What the bench asks of a simulated device: bytes and a time in, bytes and the times they are due out."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import Protocol, TypeAlias, runtime_checkable

Replies = list[tuple[float, bytes]]

# What a device says on its own, once something has happened: called with the time it was due at, it returns what is
# said then, or nothing when the occasion is gone, and perhaps what may follow. Virtual time never goes there by itself.
Later: TypeAlias = "Callable[[float], Sequence[Due]]"
Due: TypeAlias = "tuple[float, bytes | Later]"


# Lets all clients of a device hear bytes at a time, when something happens to it that none of them asked for.
Tell: TypeAlias = Callable[[float, bytes], None]


def hang_up(time_s: float) -> Sequence[Due]:
    """A `Later` with which a device ends a connection, once all that it said before has been sent."""
    return ()


class Passing(ABC):
    """A `Later` of which a newer one takes the place: nothing is said late, nor to a client that is behind.

    Attributes
    ----------
    patience_s : float
        What is later than that is passed.
    """

    patience_s: float

    @abstractmethod
    def __call__(self, due_s: float) -> Sequence[Due]:
        """What is said at its time, and what may follow."""

    @abstractmethod
    def passed(self, now_s: float) -> Sequence[Due]:
        """What may follow, when it has not been said."""


def unheard(time_s: float, data: bytes) -> None:
    """For a device that is on no bench."""


class Session(Protocol):
    """One client's conversation with a device; it owns at most what has arrived of an unfinished command."""

    def receive(self, data: bytes, now_s: float) -> Sequence[Due]:
        """Take what has arrived and return the replies with the times at which they are due, in order."""
        ...


class Device(Protocol):
    """A device; its state belongs to all its sessions and outlives each of them."""

    def session(self) -> Session:
        """A new client's conversation."""
        ...


@runtime_checkable
class Reports(Protocol):
    """A device that says what happens to it; `tell` is given to it once it is on a bench."""

    tell: Tell
