"""What the bench asks of a simulated device: bytes and a time in, bytes and the times they are due out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol, TypeAlias

Replies = list[tuple[float, bytes]]

# What a device says on its own, once something has happened: called with the time it was due at, it returns what is
# said then, or nothing when the occasion is gone, and perhaps what may follow. Virtual time never goes there by itself.
Later: TypeAlias = "Callable[[float], Sequence[Due]]"
Due: TypeAlias = "tuple[float, bytes | Later]"


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
