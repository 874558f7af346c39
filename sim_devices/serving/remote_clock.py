"""The clock of a bench that another process serves, at the other end of its control connection."""

from __future__ import annotations

import math
import socket
import sys
import threading
import time
from typing import Any
from urllib.parse import urlsplit

from goniometer.errors import DeviceFaultError, NotConnectedError, ReplyError, ReplyTimeoutError
from sim_devices.serving.json_lines import parsed, printed

_DEVICE = "simulated bench"
_LONGEST_REPLY = 1 << 24  # the first one holds the scene
_TIMEOUT_S = 10.0


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
                self._connection.sendall(printed(request))
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
        answer = parsed(line)
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
