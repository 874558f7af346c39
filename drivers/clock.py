"""The clock that everything that waits is given, so that a bench may run on simulated time."""

from __future__ import annotations

import time
from typing import Protocol


class Clock(Protocol):
    """Seconds that pass, and a way to let them pass."""

    def now(self) -> float:
        """Seconds since the clock began; never goes back."""
        ...

    def sleep(self, duration_s: float) -> None:
        """Return once `duration_s` have passed on this clock."""
        ...


class WallClock:
    """Real time, counted from the moment the clock was made."""

    def __init__(self) -> None:
        self._start_s = time.monotonic()

    def now(self) -> float:
        """Seconds since the clock was made."""
        return time.monotonic() - self._start_s

    def sleep(self, duration_s: float) -> None:
        """Wait `duration_s` real seconds."""
        time.sleep(duration_s)


class LaterClock:
    """Another clock, ahead by `ahead_s`: time that goes on where an earlier process has left it."""

    def __init__(self, clock: Clock, ahead_s: float) -> None:
        self._clock, self._ahead_s = clock, ahead_s

    def now(self) -> float:
        """Seconds of the other clock and those that it is ahead."""
        return self._clock.now() + self._ahead_s

    def sleep(self, duration_s: float) -> None:
        """Wait on the other clock."""
        self._clock.sleep(duration_s)


class Deadline:
    """A time limit that is fair to a device on a simulated clock.

    A simulated clock may run far ahead of the threads that serve the bench, so the limit has passed only when it has
    passed on the clock and a short grace has passed in real time too. On real time the two are one.

    Parameters
    ----------
    clock : Clock
        The clock the limit is counted on.
    duration_s : float
        The limit, in seconds of that clock.
    """

    _REAL_GRACE_S = 2.0

    def __init__(self, clock: Clock, duration_s: float) -> None:
        self._clock = clock
        self._end_s = clock.now() + duration_s
        self._real_end_s = time.monotonic() + min(duration_s, self._REAL_GRACE_S)

    def has_passed(self) -> bool:
        """Whether the limit is over."""
        return self._clock.now() > self._end_s and time.monotonic() > self._real_end_s
