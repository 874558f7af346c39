"""Sees that a scan goes on: its thread says so between any two waits, and a second thread notices when it does not."""

from __future__ import annotations

import threading
from collections.abc import Callable
from types import TracebackType
from typing import Self

LIMIT_S = 20.0
"""A device that does not answer may keep a scan for some 10 s, which is no hang."""

_LOOKS = 10


class Watchdog:
    """Calls for help when the scan's thread has been silent for too long.

    Silence is counted in looks, not read off a clock: a program that was stopped (Ctrl-Z), or a computer that slept, is
    not taken for one that hangs.

    Parameters
    ----------
    limit_s : float
        The longest silence, in real seconds.
    bark : callable
        Called once, in the watchdog's thread, with the length of the silence.

    Attributes
    ----------
    look_s : float
        Time between two looks.
    """

    def __init__(self, limit_s: float, bark: Callable[[float], None]) -> None:
        self.limit_s, self.look_s, self._bark = limit_s, limit_s / _LOOKS, bark
        self._is_fed = True
        self._silent = 0
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._watch, name="watchdog", daemon=True)

    def feed(self) -> None:
        """The scan goes on; costs as much as setting a variable."""
        self._is_fed = True

    def look(self) -> bool:
        """Look once, `look_s` after the last time; True when it had to bark."""
        self._silent = 0 if self._is_fed else self._silent + 1
        self._is_fed = False
        if self._silent < _LOOKS:
            return False
        self._bark(self._silent * self.look_s)
        return True

    def _watch(self) -> None:
        while not self._ended.wait(self.look_s):
            if self.look():
                return

    def __enter__(self) -> Self:
        self.feed()
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._ended.set()
        self._thread.join()
