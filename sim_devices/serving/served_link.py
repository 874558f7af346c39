"""One client of a bench: its port, its session, and what is on its way to it."""

from __future__ import annotations

import selectors
from dataclasses import dataclass, field

from sim_devices.device import Device, Later, Session
from sim_devices.serving.ports import Port, SocketPort

# a client is not listened to while this much waits for it, because it does not read or because time stands still
_MOST_WAITING_BYTES = 65536
# for how many bytes counts what its device will say on its own
_LATER_BYTES = 32


@dataclass(eq=False)
class ServedLink:
    """A client as the reactor sees it; `watched` are the events it waits for, `wanted` those that it should."""

    port: Port
    device: Device
    session: Session
    scheduled_bytes: int = 0
    scheduled_laters: int = 0
    unsent: bytearray = field(default_factory=bytearray)
    has_ended: bool = False
    watched: int = 0

    @property
    def wanted(self) -> int:
        """The events to wait for now."""
        waiting_bytes = self.scheduled_bytes + len(self.unsent) + _LATER_BYTES * self.scheduled_laters
        listens = not self.has_ended and waiting_bytes < _MOST_WAITING_BYTES
        return (selectors.EVENT_READ if listens else 0) | (selectors.EVENT_WRITE if self.unsent else 0)

    @property
    def is_done(self) -> bool:
        """Whether the client has ended and has been answered."""
        return self.has_ended and not self.unsent and not self.scheduled_bytes

    @property
    def is_behind(self) -> bool:
        """Whether so much waits for it that nothing is said to it but replies; what is said, is said whole."""
        return len(self.unsent) >= _MOST_WAITING_BYTES

    def schedule(self, said: bytes | Later, count: int = 1) -> None:
        """Note that something is to be said to it; with -1, that it has been."""
        if isinstance(said, bytes):
            self.scheduled_bytes += count * len(said)
        else:
            self.scheduled_laters += count

    def lose(self, *, hangs_up: bool) -> None:
        """Lose all bytes that are on their way to it, and its connection too, if it has one, when that hangs up."""
        self.scheduled_bytes = 0
        self.unsent.clear()
        if hangs_up and isinstance(self.port, SocketPort):
            self.has_ended = True
            self.port.hang_up()

    def take(self, said: bytes, *, is_reply: bool) -> None:
        """Take what is to be sent; what was not asked for is lost on a client that does not read."""
        if is_reply or not self.is_behind:
            self.unsent += said
