"""A port at which something is wrong: what stands between the sessions of a device and their clients."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

from sim_devices.device import Due, Later, Passing, Session, hang_up
from sim_devices.faults.entry import Chunks, Random

_PATIENCE_S = 0.5
"""What comes so much later at most is waited for by any client, and so by virtual time."""

_WAITED_S = 1.0
"""How long a client is taken to have waited, in virtual time, that speaks while replies to it are under way."""

Disturb = Callable[[float, bytes, Random], Chunks]


@dataclass
class _Disturbance:
    disturb: Disturb
    random: Random
    replies_left: int


class FaultyPort:
    """What is wrong at one port, for all of its clients.

    Parameters
    ----------
    is_virtual : bool
        Whether time is virtual. Real clients then wait no time at all, so one that speaks again is taken to have
        waited for a second.

    Attributes
    ----------
    deaf_until_s, busy_until_s, refuses_until_s : float
        Until then what clients say is lost; is kept, to be heard afterwards; new clients are refused.
    """

    def __init__(self, *, is_virtual: bool) -> None:
        self.is_virtual = is_virtual
        self.deaf_until_s = self.busy_until_s = self.refuses_until_s = -math.inf
        self._disturbances: list[_Disturbance] = []

    def disturb(self, disturb: Disturb, random: Random, replies: int) -> None:
        """Have the next replies disturbed, after all disturbances that are there."""
        self._disturbances.append(_Disturbance(disturb, random, replies))

    def disturbed(self, due_s: float, reply: bytes) -> Chunks:
        """What becomes of a reply."""
        chunks: Chunks = [(due_s, reply)]
        for disturbance in self._disturbances:
            disturbance.replies_left -= 1
            disturb, random = disturbance.disturb, disturbance.random
            chunks = [piece for at_s, chunk in chunks if chunk for piece in disturb(at_s, chunk, random)]
        self._disturbances = [disturbance for disturbance in self._disturbances if disturbance.replies_left]
        return [(at_s, chunk) for at_s, chunk in chunks if chunk]


class FaultySession:
    """A client's conversation through a faulty port; replies keep their order, however late they are.

    Parameters
    ----------
    session : Session
        The device's side.
    port : FaultyPort
        What is wrong.
    """

    def __init__(self, session: Session, port: FaultyPort) -> None:
        self._session, self._port = session, port
        self._late: deque[tuple[float, bytes]] = deque()
        self._unheard = b""
        self._waited_s = 0.0
        self._last_due_s = -math.inf

    def receive(self, data: bytes, now_s: float) -> list[Due]:
        """Hand on what the device hears, and return what becomes of its replies."""
        port = self._port
        if now_s < port.deaf_until_s:
            return []
        if port.is_virtual:
            self._waited_s = self._waited_s + _WAITED_S if self._late or self._unheard else 0.0
        due = self._arrived(now_s)
        self._unheard += data
        if now_s + self._waited_s < port.busy_until_s:
            return [*due, (port.busy_until_s, self._hear)]
        port.busy_until_s = min(port.busy_until_s, now_s)  # also when it is over because its client has waited
        return [*due, *self._hear(now_s)]

    def _hear(self, now_s: float) -> list[Due]:
        data, self._unheard = self._unheard, b""
        is_lost = not data or now_s < self._port.deaf_until_s
        return [] if is_lost else self._passed(self._session.receive(data, now_s))

    def _passed(self, due: Sequence[Due]) -> list[Due]:
        passed: list[Due] = []
        for due_s, said in due:
            if isinstance(said, bytes):
                for at_s, chunk in self._port.disturbed(due_s, said):
                    passed += self._enter(at_s, chunk, at_s - due_s)
            elif said is hang_up:
                passed.append((max(due_s, self._late[-1][0] if self._late else due_s), said))
            elif isinstance(said, Passing):
                passed.append((due_s, _Passing(said, self._said_later)))
            else:
                passed.append((due_s, partial(self._said_later, said)))
        return passed

    def _said_later(self, said: Later, now_s: float) -> list[Due]:
        due = said(now_s)
        return self._passed([] if now_s < self._port.deaf_until_s else due)

    def _enter(self, at_s: float, chunk: bytes, late_s: float) -> list[Due]:
        """Say it in its turn: at once known to come, or when its time has come if nobody may wait for it."""
        if self._late and self._late[-1][0] == math.inf:
            chunk = self._late.pop()[1] + chunk
        at_s = max(at_s, self._late[-1][0] if self._late else self._last_due_s)
        if late_s <= _PATIENCE_S and not self._late:
            self._last_due_s = at_s
            return [(at_s, chunk)]
        self._late.append((at_s, chunk))
        return [] if at_s == math.inf else [(at_s, self._arrived)]

    def _arrived(self, now_s: float) -> list[Due]:
        """What has come by now of what was late."""
        arrived: list[Due] = []
        if now_s < self._port.deaf_until_s:
            self._late.clear()
        while self._late and self._late[0][0] <= now_s + self._waited_s:
            arrived.append((now_s, self._late.popleft()[1]))
        return arrived


class _Passing(Passing):
    """What passes, through a faulty port."""

    def __init__(self, said: Passing, say: Callable[[Later, float], list[Due]]) -> None:
        self._said, self._say = said, say
        self.patience_s = said.patience_s

    def __call__(self, due_s: float) -> Sequence[Due]:
        """What is said at its time, disturbed."""
        return self._say(self._said, due_s)

    def passed(self, now_s: float) -> Sequence[Due]:
        """What may follow, disturbed."""
        return self._say(self._said.passed, now_s)
