"""The clock of a bench that another process serves: one JSON object a line, over a loopback connection."""

from __future__ import annotations

import json
import math
import socket
import socketserver
import sys
import threading
import time
from typing import Any
from urllib.parse import urlsplit

from pydantic import ValidationError

from goniometer.errors import ConfigurationError, DeviceFaultError, NotConnectedError, ReplyError, ReplyTimeoutError
from sim_devices.bench import Bench
from sim_devices.faults.known import one_fault

_DEVICE = "simulated bench"
_LONGEST_REQUEST = 4096
_LONGEST_REPLY = 1 << 24  # the first one holds the scene
_LONGEST_SLEEP_S = 1e6
_TIMEOUT_S = 10.0


class ControlServer:
    """Tells other processes what a bench holds, lets them wait on its clock, and lets things go wrong.

    Requests are ``{"request": "hello"}``, ``{"request": "now"}`` and ``{"request": "sleep", "duration_s": 0.1}``. A
    sleep is one on the bench's own clock, in a thread of its client: virtual time then passes as it does for a program
    that holds the bench itself. One client at a time is served, because two scans would move each other's axes. Any
    client may ask for ``{"request": "fault", "fault": {"fault": "late", "device": "meter", "late_s": 2}}``.

    Parameters
    ----------
    bench : Bench
        The bench, started.
    scene_text : str
        The scene file, as read.

    Attributes
    ----------
    address : str
        Where it listens, from the start until `stop`.
    """

    def __init__(self, bench: Bench, scene_text: str) -> None:
        self._bench, self._scene_text = bench, scene_text
        self.client = threading.Lock()
        self._server = _Server(self)
        self.address = f"socket://127.0.0.1:{self._server.server_address[1]}"
        self._thread = threading.Thread(
            target=self._server.serve_forever, args=(0.05,), name="bench control", daemon=True
        )
        self._thread.start()

    def stop(self) -> None:
        """Listen no more."""
        self._server.shutdown()
        self._thread.join()
        self._server.server_close()

    def answer(self, request: Any) -> dict[str, Any]:
        """Answer one request; a sleep when it is over."""
        clock = self._bench.clock
        match request:
            case {"request": "hello"}:
                return {"scene": self._scene_text, "speed": clock.speed, "now_s": clock.now()}
            case {"request": "now"}:
                return {"now_s": clock.now()}
            case {"request": "sleep", "duration_s": (int() | float()) as duration_s} if (
                duration_s is not True and 0 <= duration_s <= _LONGEST_SLEEP_S
            ):
                clock.sleep(duration_s)
                return {"now_s": clock.now()}
            case {"request": "fault", "fault": fault}:
                return self._switch_on(fault)
            case _:
                return {"error": "this is no request: ask for hello, now, sleep with duration_s, or fault with fault"}

    def _switch_on(self, fault: Any) -> dict[str, Any]:
        try:
            self._bench.faults.switch_on(one_fault.validate_python(fault))
        except ValidationError as error:
            places = (".".join(map(str, fault["loc"])) or "fault" for fault in error.errors())
            reasons = (fault["msg"] for fault in error.errors())
            return {"error": "; ".join(f"{place}: {reason}" for place, reason in zip(places, reasons, strict=True))}
        except ConfigurationError as error:
            return {"error": str(error)}
        return {"now_s": self._bench.clock.now()}


class _Server(socketserver.ThreadingTCPServer):
    daemon_threads = True

    def __init__(self, control: ControlServer) -> None:
        self.control = control
        super().__init__(("127.0.0.1", 0), _Client)


class _Client(socketserver.StreamRequestHandler):
    disable_nagle_algorithm = True
    server: _Server

    def handle(self) -> None:
        """Answer line after line until the client goes."""
        control, is_served = self.server.control, False
        try:
            while line := self.rfile.readline(_LONGEST_REQUEST):
                request = _parsed(line)
                is_fault = isinstance(request, dict) and request.get("request") == "fault"
                is_served = is_served or (not is_fault and control.client.acquire(blocking=False))
                if is_served or is_fault:
                    self._send(control.answer(request))
                else:
                    self._send({"error": "another program is using this bench"})
        except DeviceFaultError as error:
            self._send({"error": str(error)})
        except ConnectionError:
            return
        finally:
            if is_served:
                control.client.release()

    def _send(self, answer: dict[str, Any]) -> None:
        self.wfile.write(json.dumps(answer).encode() + b"\n")


def _parsed(line: bytes) -> Any:
    try:
        return json.loads(line)
    except (ValueError, RecursionError):  # brackets within brackets within brackets
        return None


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
                line = self._replies.readline(_LONGEST_REPLY)
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
        answer = _parsed(line)
        if isinstance(answer, dict) and all(_is_usable(key, answer.get(key)) for key in wanted):
            return answer
        if isinstance(answer, dict) and "error" in answer:
            raise DeviceFaultError(
                _DEVICE,
                f"at {self._address} it answered: {answer['error']}",
                not_done="waiting on its clock",
                to_do="wait until the other program has ended, or serve a second bench with 'goniometer simulate'",
            )
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


def _is_usable(key: str, value: Any) -> bool:
    """Whether a reply's value is what its key promises."""
    if key == "scene":
        return isinstance(value, str)
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) < sys.float_info.max
    return (key == "speed" and value == "max") or (is_number and (key != "speed" or value > 0))
