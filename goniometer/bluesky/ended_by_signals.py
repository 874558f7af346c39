"""SIGTERM and SIGHUP as exceptions: without them they end the program at once, with the bench in motion."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

from goniometer.errors import ScanInterrupted


@contextmanager
def ended_by_signals() -> Iterator[None]:
    """Let SIGTERM and SIGHUP raise ScanInterrupted in the main thread while the block lasts.

    Ctrl-C stays with Bluesky, and with Python. In another thread, and where the program has its own way with a signal,
    nothing is changed.
    """
    before = {}
    if threading.current_thread() is threading.main_thread():
        for name in ("SIGTERM", "SIGHUP"):
            number = getattr(signal, name, None)  # Windows has no SIGHUP
            if number is not None and signal.getsignal(number) is signal.SIG_DFL:
                before[number] = signal.signal(number, _raise)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _raise(number: int, frame: FrameType | None) -> None:
    raise ScanInterrupted(signal.Signals(number).name, 128 + number)
