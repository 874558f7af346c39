"""What the bench asks of a simulated device: bytes and a time in, bytes and the times they are due out."""

from __future__ import annotations

from typing import Protocol

Replies = list[tuple[float, bytes]]


class Session(Protocol):
    """One client's conversation with a device; it owns at most what has arrived of an unfinished command."""

    def receive(self, data: bytes, now_s: float) -> Replies:
        """Take what has arrived and return the replies with the times at which they are due, in order."""
        ...


class Device(Protocol):
    """A device; its state belongs to all its sessions and outlives each of them."""

    def session(self) -> Session:
        """A new client's conversation."""
        ...
