"""The clock of a bench that another process serves: one JSON object a line, over a loopback connection."""

from __future__ import annotations

import json
import math
import socket
import threading
import time
from typing import Any
from urllib.parse import urlsplit

from goniometer.errors import NotConnectedError, ReplyError, ReplyTimeoutError
from sim_devices.bench import Bench
from sim_devices.device import Replies
from sim_devices.lines import LineSplitter

_DEVICE = "simulated bench"
_LONGEST_REQUEST = 4096
_TIMEOUT_S = 10.0


class ControlServer:
    """Tells other processes what a bench holds, and lets them wait on its clock. It ends with the bench.

    Requests are ``{"request": "hello"}``, ``{"request": "now"}`` and ``{"request": "sleep", "duration_s": 0.1}``.
    The bench serves it like a device: the answer to a sleep is a reply that is due when the sleep is over, so
    everything that was sent to any device before it has been taken, and answered if it was due, by then.

    Parameters
    ----------
    bench : Bench
        The bench.
    scene_text : str
        The scene file, as read.
    """

    def __init__(self, bench: Bench, scene_text: str) -> None:
        self._bench, self._scene_text = bench, scene_text
        self.address = bench.listen(self)

    def session(self) -> _Session:
        """A new client."""
        return _Session(self)

    def answer(self, line: str, now_s: float) -> tuple[float, dict[str, Any]]:
        """Answer one request; returns when the answer is due, too."""
        try:
            request = json.loads(line)
        except ValueError:
            request = None
        match request:
            case {"request": "hello"}:
                return now_s, {"scene": self._scene_text, "speed": self._bench.clock.speed, "now_s": now_s}
            case {"request": "now"}:
                return now_s, {"now_s": now_s}
            case {"request": "sleep", "duration_s": duration_s} if _is_duration(duration_s):
                return now_s + duration_s, {"now_s": now_s + duration_s}
            case _:
                return now_s, {
                    "error": f"{line!r} is no request. Ask for hello, for now, or for sleep with duration_s."
                }


def _is_duration(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and 0 <= value < math.inf


class _Session:
    def __init__(self, server: ControlServer) -> None:
        self._server = server
        self._lines = LineSplitter(b"\n", limit=_LONGEST_REQUEST)

    def receive(self, data: bytes, now_s: float) -> Replies:
        """Answer every request that is complete."""
        answers = [self._server.answer(line, now_s) for line in self._lines.feed(data)]
        return [(due_s, json.dumps(answer).encode() + b"\n") for due_s, answer in answers]


class RemoteClock:
    """The clock of a bench in another process. Real time, scaled, is counted here; virtual time passes there.

    Parameters
    ----------
    address : str
        The control address that the bench has printed, ``socket://127.0.0.1:PORT``.

    Attributes
    ----------
    speed : float or "max"
        How fast the bench's time passes.
    scene_text : str
        The scene file of the bench.

    Raises
    ------
    NotConnectedError, ReplyTimeoutError, ReplyError
        From the start, and from `now` and `sleep` when time is virtual: the bench is not there, is silent, or is none.
    """

    def __init__(self, address: str) -> None:
        self._address = address
        self._lock = threading.Lock()
        try:
            url = urlsplit(address)
            self._connection = socket.create_connection((url.hostname or "", url.port or 0), timeout=_TIMEOUT_S)
        except (OSError, ValueError) as error:
            raise self._not_connected(str(error)) from error
        self._connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._replies = self._connection.makefile("rb")
        try:
            hello = self._ask({"request": "hello"}, "scene", "speed", "now_s")
        except BaseException:
            self.close()
            raise
        self.scene_text: str = hello["scene"]
        self.speed: float | str = hello["speed"]
        self._offset_s = hello["now_s"] - self._local_s()

    def now(self) -> float:
        """Seconds on the bench's clock."""
        if self.speed == "max":
            return float(self._ask({"request": "now"}, "now_s")["now_s"])
        return float(self._offset_s + self._local_s())

    def sleep(self, duration_s: float) -> None:
        """Return once `duration_s` have passed on the bench's clock."""
        if not (duration_s >= 0 and math.isfinite(duration_s)):
            raise ValueError(f"A clock can wait for zero seconds or more; {duration_s} s is not possible.")
        if self.speed == "max":
            self._ask({"request": "sleep", "duration_s": duration_s}, "now_s")
        else:
            time.sleep(duration_s / float(self.speed))

    def close(self) -> None:
        """Leave the bench."""
        self._replies.close()
        self._connection.close()

    def _local_s(self) -> float:
        return 0.0 if self.speed == "max" else time.monotonic() * float(self.speed)

    def _ask(self, request: dict[str, Any], *wanted: str) -> dict[str, Any]:
        with self._lock:
            try:
                self._connection.sendall(json.dumps(request).encode() + b"\n")
                line = self._replies.readline()
            except TimeoutError as error:
                raise ReplyTimeoutError(
                    _DEVICE,
                    f"it has not answered at {self._address} within {_TIMEOUT_S:g} s",
                    not_done=f"the request {request['request']!r}",
                    to_do="see whether the process that serves the bench still runs, and start it again",
                ) from error
            except (OSError, ValueError) as error:
                raise self._not_connected(str(error)) from error
        if not line:
            raise self._not_connected("the bench has closed the connection")
        return self._checked(line, wanted)

    def _checked(self, line: bytes, wanted: tuple[str, ...]) -> dict[str, Any]:
        try:
            answer = json.loads(line)
        except ValueError:
            answer = None
        if isinstance(answer, dict) and all(key in answer for key in wanted):
            return answer
        raise ReplyError(
            _DEVICE,
            f"what it answered at {self._address} has no {' and '.join(wanted)}: {line[:200]!r}",
            not_done="waiting on its clock",
            to_do="check that the address is the control address that 'goniometer simulate' printed",
        )

    def _not_connected(self, reason: str) -> NotConnectedError:
        return NotConnectedError(
            _DEVICE,
            f"its control address {self._address} cannot be reached ({reason})",
            not_done="waiting on its clock",
            to_do="start the bench with 'goniometer simulate' and use the address that it prints",
        )
