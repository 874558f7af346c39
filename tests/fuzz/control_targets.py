"""The bench's control socket, at both of its ends."""

from __future__ import annotations

import io
import json
import math
import random
import threading
from contextlib import suppress
from types import SimpleNamespace
from typing import Any

from mutation import Mutator
from target import Target

from goniometer.errors import DeviceError
from sim_devices.serving import control, remote_clock
from sim_devices.serving.clock import VirtualClock
from sim_devices.serving.control import ControlServer
from sim_devices.serving.remote_clock import RemoteClock

_LONGEST_REQUEST = 4096
_REQUESTS = [
    json.dumps(request).encode() + b"\n"
    for request in (
        {"request": "hello"},
        {"request": "now"},
        {"request": "sleep", "duration_s": 0.1},
        {"request": "sleep", "duration_s": 12},
        {"request": "sleep", "duration_s": 1e3},
        {"request": "fault", "fault": {"fault": "late", "device": "meter", "late_s": 2}},
        {"request": "tea", "more": [[], {}, "\u0394", None, True]},
    )
] + [b"[" * 3000 + b"\n", b'{"request": "sleep", "duration_s": ' + b"9" * 400 + b"}\n"]
_REPLIES = [
    json.dumps(reply).encode() + b"\n"
    for reply in (
        {"scene": "scene: iron\n", "speed": "max", "now_s": 12.5},
        {"scene": "", "speed": 40.0, "now_s": 0},
        {"now_s": 3.25},
        {"error": "another program is using this bench"},
    )
]


def _heard(data: bytes) -> int:
    """How many requests a server takes: no more after one that is no JSON, or null."""
    rest = io.BytesIO(data)
    for count, request in enumerate(iter(lambda: rest.readline(_LONGEST_REQUEST), b""), start=1):
        with suppress(ValueError, RecursionError):
            if json.loads(request) is not None:
                continue
        return count
    return count if data else 0


class ServerRun:
    """A bench's control socket, spoken to by one client after another."""

    def __init__(self, random_: random.Random) -> None:
        self._mutator = Mutator(_REQUESTS, random_)
        self._control: Any = object.__new__(ControlServer)
        self._clock = VirtualClock()
        self._control._bench = SimpleNamespace(clock=self._clock, faults=SimpleNamespace(switch_on=lambda fault: None))
        self._control._scene_text, self._control.client = "scene", threading.Lock()

    def take(self) -> str:
        """Feed a string, and see that every line up to the first that is no JSON is answered by one of JSON.

        The next client is served.
        """
        data, before_s = self._mutator.string(), self._clock.now()
        said = self._said(data)
        answers = [json.loads(line) for line in said.splitlines()]
        assert len(answers) == _heard(data)
        assert all(set(answer) in ({"error"}, {"now_s"}, {"scene", "speed", "now_s"}) for answer in answers)
        assert math.isfinite(self._clock.now())
        assert b"sleep" in data.replace(b"\\", b"sleep") or self._clock.now() == before_s
        assert b'"now_s"' in self._said(b'{"request": "now"}\n')
        return "error" if any("error" in answer for answer in answers) else "answered"

    def _said(self, data: bytes) -> bytes:
        handler: Any = object.__new__(control._Client)
        handler.server = SimpleNamespace(control=self._control)
        handler.rfile, handler.wfile = io.BytesIO(data), io.BytesIO()
        handler.handle()
        said: bytes = handler.wfile.getvalue()
        return said


class ClientRun:
    """A remote clock whose bench says what it should not."""

    def __init__(self, random_: random.Random) -> None:
        self._mutator, self._random = Mutator(_REPLIES, random_), random_

    def take(self) -> str:
        """Begin a clock and ask it; it tells a time or raises what is documented."""
        hello = self._mutator.mutated(_REPLIES[0]) if self._random.random() < 0.7 else _REPLIES[0]
        clock: Any = None
        try:
            clock = self._clock(hello + self._mutator.string() + self._mutator.string())
            assert isinstance(clock.scene_text, str)
            assert math.isfinite(clock.now())
            clock.sleep(0.0)
        except DeviceError as error:
            return type(error).__name__
        return "answered"

    def _clock(self, replies: bytes) -> RemoteClock:
        connection = SimpleNamespace(
            setsockopt=lambda *_: None,
            makefile=lambda _: io.BytesIO(replies),
            sendall=lambda _: None,
            close=lambda: None,
        )
        real, remote_clock.socket = (
            remote_clock.socket,
            SimpleNamespace(create_connection=lambda *_, **__: connection, IPPROTO_TCP=0, TCP_NODELAY=0),
        )
        try:
            return RemoteClock("socket://127.0.0.1:1")
        finally:
            remote_clock.socket = real


TARGETS = [Target("control", "device", ServerRun), Target("control", "driver", ClientRun)]
