"""A driver whose device's answers are garbled: it returns values or raises documented errors, and recovers."""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from garbling_port import FuzzClock, GarblingPort, open_link

from drivers.wire.link import Link
from goniometer.errors import DeviceError
from sim_devices.device import Device

_LONGEST_LEFT = 8192
_TRIES = 4


@dataclass(frozen=True)
class Conversation:
    """A driver's requests, and one of them with what it must return once answers come ungarbled again."""

    requests: Sequence[Callable[[], object]]
    ask: Callable[[], float]
    truth: Callable[[], float]
    tolerance: float


Begin = Callable[[Link, FuzzClock], Conversation]


class DriverRun:
    """A driver that asks one thing after the other."""

    def __init__(self, device: Device, converse: Begin, address: str, random_: random.Random) -> None:
        self._random, clock = random_, FuzzClock()
        self._port = GarblingPort(device, clock, random_)
        self._link = open_link(self._port, clock, address)
        self._conversation = converse(self._link, clock)
        self._clock = clock
        self._recover()

    def take(self) -> str:
        """Make requests until at least one string was garbled; now and then see that the driver recovers."""
        before, outcome = self._port.strings, "nothing"
        while self._port.strings == before:
            outcome = self._outcome(self._random.choice(self._conversation.requests))
        assert len(self._link._received) <= _LONGEST_LEFT
        if self._random.random() < 0.02:
            self._recover()
        return outcome

    def _outcome(self, request: Callable[[], object]) -> str:
        try:
            value = request()
        except DeviceError as error:
            return type(error).__name__
        assert not isinstance(value, float) or math.isfinite(value)
        return "answered"

    def _recover(self) -> None:
        self._port.be_honest()
        self._clock.now_s += 1000.0
        for _ in range(_TRIES):
            try:
                value = self._conversation.ask()
            except DeviceError as error:
                last = error
                continue
            truth = self._conversation.truth()
            assert abs(value - truth) <= self._conversation.tolerance, f"{value} was read where {truth} is true"
            break
        else:
            raise AssertionError("still no answer, though none is garbled") from last
        self._port.is_honest = False
