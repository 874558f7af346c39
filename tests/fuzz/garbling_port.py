"""A port on which a simulated device's answers are garbled, and where time passes by being waited for."""

from __future__ import annotations

import random
from collections import deque
from types import SimpleNamespace
from unittest.mock import patch

from mutation import Mutator

import drivers.clock
import drivers.wire.link
from drivers.wire.link import Link
from sim_devices.device import Device, Due

_AS_FAST = 100.0
_LOOK_S = 1e-4


class FuzzClock:
    """Time that passes where somebody waits; a sleep lasts a hundred times as long, so that deadlines come soon."""

    def __init__(self) -> None:
        self.now_s = 100.0

    def now(self) -> float:
        """Seconds."""
        return self.now_s

    def sleep(self, duration_s: float) -> None:
        """Let time pass."""
        self.now_s += _AS_FAST * duration_s


class GarblingPort:
    """What a link needs of a port.

    Attributes
    ----------
    is_honest : bool
        Whether answers come as the device gave them.
    strings : int
        How many were garbled.
    """

    def __init__(self, device: Device, clock: FuzzClock, random_: random.Random) -> None:
        self.is_honest, self.strings = True, 0
        self._session, self._clock, self._random = device.session(), clock, random_
        self._old: deque[bytes] = deque([b"\r\n", b"> "], maxlen=16)
        self._mutator = Mutator(self._old, random_)  # type: ignore[arg-type]
        self._arriving: deque[bytes] = deque()

    def open(self) -> None:
        """Lose what is on its way."""
        self._arriving.clear()

    def send(self, data: bytes) -> None:
        """Hand it to the device, and its answer to the mutator."""
        answer = self._said(self._session.receive(data, self._clock.now_s))
        if self.is_honest:
            self._arriving.append(answer)
            return
        self.strings += 1
        self._arriving += self._mutator.pieces(self._mutator.mutated(answer))
        if answer:
            self._old.append(answer)

    def receive(self, wait_s: float) -> bytes:
        """The next piece, if there is one."""
        while self._arriving:
            piece = self._arriving.popleft()
            if piece:
                return piece
        self._clock.now_s += wait_s + _LOOK_S
        return b""

    def be_honest(self) -> None:
        """From now on tell what the device says; all that is on its way arrives at once."""
        self.is_honest = True
        self._arriving = deque([b"".join(self._arriving)])

    def set_rts(self, *, on: bool) -> None:
        """Do nothing."""

    def fileno(self) -> int:
        """There is none."""
        return -1

    def close(self) -> None:
        """Do nothing."""

    def _said(self, due: list[Due]) -> bytes:
        said = b""
        for due_s, what in due:
            said += (
                what
                if isinstance(what, bytes)
                else self._said([now for now in what(due_s) if isinstance(now[1], bytes)])
            )
        return said


def open_link(port: GarblingPort, clock: FuzzClock, address: str = "socket://fuzz:1") -> Link:
    """A link on that port; from now on the links and deadlines of this process keep the clock's time."""
    time = SimpleNamespace(monotonic=clock.now)
    drivers.wire.link.time = drivers.clock.time = time  # type: ignore[assignment]
    with patch.object(drivers.wire.link, "TcpPort", lambda address, timeout_s: port):
        return Link(address, device="fuzz", reply_timeout_s=0.5)
