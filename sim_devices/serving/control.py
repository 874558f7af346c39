"""What another process may ask of a bench: one JSON object a line, over a loopback connection."""

from __future__ import annotations

import select
import socket
import socketserver
import threading
from collections.abc import Callable
from typing import Any

from pydantic import ValidationError

from goniometer.errors import ConfigurationError, DeviceFaultError
from sim_devices.bench import Bench
from sim_devices.faults.known import one_fault
from sim_devices.serving.json_lines import parsed, printed

_LONGEST_REQUEST = 4096
_LONGEST_SLEEP_S = 1e6

_LETS_GO_S = 0.5
"""Real seconds for which a program waits for the one before it, which has ended but has not been seen to yet."""

_NAP_S = 0.5
"""Real seconds from look to look whether the client for whom time is slept away is still there."""


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

    def answer(self, request: Any, require_client: Callable[[], None] = lambda: None) -> dict[str, Any]:
        """Answer one request; a sleep when it is over, or `require_client` raises because nobody waits any more."""
        clock = self._bench.clock
        match request:
            case {"request": "hello"}:
                return {"scene": self._scene_text, "speed": clock.speed, "now_s": clock.now()}
            case {"request": "now"}:
                return {"now_s": clock.now()}
            case {"request": "sleep", "duration_s": (int() | float()) as duration_s} if (
                duration_s is not True and 0 <= duration_s <= _LONGEST_SLEEP_S
            ):
                self._sleep(duration_s, require_client)
                return {"now_s": clock.now()}
            case {"request": "fault", "fault": fault}:
                return self._switch_on(fault)
            case _:
                return {"error": "this is no request: ask for hello, now, sleep with duration_s, or fault with fault"}

    def _sleep(self, duration_s: float, require_client: Callable[[], None]) -> None:
        clock = self._bench.clock
        if clock.speed != "max":
            nap_s = _NAP_S * clock.speed
            end_s = clock.now() + duration_s
            while (duration_s := end_s - clock.now()) > nap_s:
                clock.sleep(nap_s)
                require_client()
        clock.sleep(max(duration_s, 0.0))

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
                request = parsed(line)
                is_fault = isinstance(request, dict) and request.get("request") == "fault"
                is_served = is_served or (not is_fault and control.client.acquire(timeout=_LETS_GO_S))
                if request is None:  # whatever this is, a web page perhaps, it does not speak to a bench
                    self._send({"error": "this is no JSON object in a line of its own"})
                    return
                if is_served or is_fault:
                    self._send(control.answer(request, self._require_client))
                else:
                    self._send({"error": "another program is using this bench"})
        except DeviceFaultError as error:
            self._send({"error": str(error)})
        except ConnectionError:
            return
        finally:
            if is_served:
                control.client.release()

    def _require_client(self) -> None:
        """Raise ConnectionError when the client has gone."""
        if select.select([self.connection], [], [], 0)[0] and not self.connection.recv(1, socket.MSG_PEEK):
            raise ConnectionError

    def _send(self, answer: dict[str, Any]) -> None:
        self.wfile.write(printed(answer))
