"""A call that wakes a thread which waits in a selector."""

from __future__ import annotations

import socket
import threading
from contextlib import suppress


class Waker:
    """Readable for a selector once it has been called, until it is heard; calls never wait.

    Parameters
    ----------
    sleeper : Thread
        The thread that waits; its own calls are none.
    """

    def __init__(self, sleeper: threading.Thread) -> None:
        self._sleeper = sleeper
        self._calls, self._hears = socket.socketpair()
        self._calls.setblocking(False)
        self._hears.setblocking(False)

    def fileno(self) -> int:
        """For a selector."""
        return self._hears.fileno()

    def call(self) -> None:
        """Wake; when no more calls fit in, there are enough."""
        if threading.current_thread() is not self._sleeper:
            with suppress(BlockingIOError):
                self._calls.send(b"\0")

    def hear(self) -> None:
        """Take the calls that have come."""
        with suppress(BlockingIOError):
            self._hears.recv(4096)

    def close(self) -> None:
        """Give both ends back."""
        self._calls.close()
        self._hears.close()
