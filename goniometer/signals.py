"""Ctrl-C, SIGTERM and SIGHUP end a scan between two waits, never in the middle of an exchange with a device."""

from __future__ import annotations

import signal
import threading
from types import FrameType, TracebackType
from typing import Any, Self

from goniometer.errors import ScanInterrupted

_NAMES = ("SIGINT", "SIGTERM", "SIGHUP")
_REASONS = {"SIGINT": "Ctrl-C"}


class Interruption:
    """Notes a request to end and raises it where `check` is called.

    As a context manager it takes over the process' signals, in the main thread only: Python delivers them nowhere else,
    and a program that runs a scan in another thread of its own can call `request`.
    """

    def __init__(self) -> None:
        self._asked: ScanInterrupted | None = None
        self._is_asked = threading.Event()
        self._before: dict[signal.Signals, Any] = {}

    def request(self, reason: str, exit_code: int) -> None:
        """Ask the scan to end; the first request counts."""
        if self._asked is None:
            self._asked = ScanInterrupted(reason, exit_code)
            self._is_asked.set()

    def wait(self, duration_s: float) -> None:
        """Wait in real time; raises ScanInterrupted as soon as the end is asked for."""
        self._is_asked.wait(duration_s)
        self.check()

    def check(self) -> None:
        """Raise ScanInterrupted when the scan was asked to end."""
        if self._asked is not None:
            raise self._asked

    def _on_signal(self, number: int, frame: FrameType | None) -> None:
        name = signal.Signals(number).name
        self.request(_REASONS.get(name, name), 128 + number)

    def __enter__(self) -> Self:
        if threading.current_thread() is threading.main_thread():
            for name in _NAMES:
                number = getattr(signal, name, None)  # Windows has no SIGHUP
                if number is not None and signal.getsignal(number) is not signal.SIG_IGN:  # nohup: the scan goes on
                    self._before[number] = signal.signal(number, self._on_signal)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)
