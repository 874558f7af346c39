"""A simulated device fed through a session: it answers on, and what was never validly sent changes nothing."""

from __future__ import annotations

import heapq
import itertools
import math
import random
import re
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass

from crc16 import crc16
from mutation import Mutator

from sim_devices.device import Device, Due

_PAUSES_S = (0.0, 0.0, 0.0, 0.001, 0.02, 0.3, 5.0)
_MOST_PENDING = 1000
_NEAR = 600
_WRITES = (0x05, 0x06, 0x0F, 0x10, 0x17)


@dataclass
class Bench:
    """A device, what must not change by itself, and the Modbus messages that it was handed."""

    device: Device
    state: Callable[[], Hashable]
    accepted: list[bytes]


@dataclass(frozen=True)
class Wire:
    """A device's protocol as the outside sees it.

    Attributes
    ----------
    build : callable
        A fresh device.
    frames : sequence of bytes
        Valid requests.
    resync : bytes
        What a host sends to be understood again, after `pause_s`; None for a new connection.
    probe, answer : bytes
        A question, and a pattern of what is said to it.
    may_change : callable
        Whether bytes could hold, however they are cut, a command that changes the state.
    second_chances_s : tuple of float
        Waits before the question is asked again: a device may have been told to be silent for so long, or the first
        question may have been taken for the rest of an unfinished frame.
    has_checksums : bool
        Whether every frame carries one.
    """

    build: Callable[[], Bench]
    frames: Sequence[bytes]
    resync: bytes | None
    pause_s: float
    probe: bytes
    answer: bytes
    may_change: Callable[[bytes], bool]
    second_chances_s: tuple[float, ...] = ()
    has_checksums: bool = False


class Talk:
    """One client of a device, with what the device will say on its own.

    Attributes
    ----------
    now_s : float
        The bench's time, turned by hand.
    """

    def __init__(self, device: Device) -> None:
        self.now_s = 100.0
        self._device, self._order = device, itertools.count()
        self.reconnect()

    def reconnect(self) -> None:
        """Be a new client."""
        self._session = self._device.session()
        self._later: list[tuple[float, int, Callable[[float], Sequence[Due]]]] = []

    def send(self, data: bytes) -> bytes:
        """What is answered to `data`; what was to be said unasked by now has been said before."""
        while self._later and self._later[0][0] <= self.now_s:
            due_s, _, say = heapq.heappop(self._later)
            self._enter(say(due_s))
        return self._enter(self._session.receive(data, self.now_s))

    @property
    def pending(self) -> int:
        """How much is still to be said unasked."""
        return len(self._later)

    def _enter(self, due: Sequence[Due]) -> bytes:
        said = []
        for due_s, what in due:
            assert not math.isnan(due_s)
            if isinstance(what, bytes):
                said.append(what)
            else:
                heapq.heappush(self._later, (due_s, next(self._order), what))
        return b"".join(said)


class DeviceRun:
    """A device with one client that sends garbage, and now and then something sensible."""

    def __init__(self, wire: Wire, random_: random.Random) -> None:
        self._wire, self._random = wire, random_
        self._mutator = Mutator(wire.frames, random_)
        self._bench = wire.build()
        self._talk = Talk(self._bench.device)
        self._sent, self._state = b"", self._bench.state()

    def take(self) -> str:
        """Feed a string in pieces; half of the time, see that the device is what it was and still answers."""
        data = self._mutator.string()
        self._sent += data
        said = b"".join(self._talk.send(piece) for piece in self._mutator.pieces(data))
        assert self._talk.pending < _MOST_PENDING
        self._talk.now_s += self._random.choice(_PAUSES_S)
        if self._random.random() < 0.5:
            self._resynchronise()
            self._compare()
            self._ask()
        return "answered" if said else "silent"

    def _resynchronise(self) -> None:
        self._talk.now_s += self._wire.pause_s
        if self._wire.resync is None:
            self._talk.reconnect()
        else:
            self._talk.send(self._wire.resync)
            self._sent += self._wire.resync

    def _compare(self) -> None:
        """Only what was validly sent may have changed the state."""
        if self._wire.has_checksums:
            for request in self._bench.accepted:
                bodies = [bytes([unit]) + request for unit in (0, 1)]
                assert any(body + crc16(body) in self._sent for body in bodies), (
                    f"obeyed {request.hex(' ')} without its checksum in {self._sent.hex(' ')}"
                )
            may_change = any(request[0] in _WRITES for request in self._bench.accepted)
        else:
            may_change = self._wire.may_change(self._sent)
        state = self._bench.state()
        assert may_change or state == self._state, f"{self._sent!r} changed {self._state} to {state}"
        self._state = state
        # without a way to be understood again, what is sent next may complete what was sent before
        self._sent = self._sent[-_NEAR:] if self._wire.has_checksums else b""
        self._bench.accepted.clear()

    def _ask(self) -> None:
        wire = self._wire
        for patience_s in (0.0, *wire.second_chances_s):
            self._talk.now_s += patience_s
            answer = self._talk.send(wire.probe)
            self._sent += wire.probe * wire.has_checksums
            if re.search(wire.answer, answer):
                return
        raise AssertionError(f"{wire.probe!r} was answered with {answer!r}")
