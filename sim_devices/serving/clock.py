"""The clocks of a simulated bench: real time times a factor, and virtual time that advances when somebody waits."""

from __future__ import annotations

import math
import threading
import time
from typing import Literal, Protocol


class Served(Protocol):
    """What a clock needs of the bench that runs on it."""

    def serve(self) -> None:
        """Take everything that clients have sent, and answer what is due."""
        ...

    def raise_failure(self) -> None:
        """Raise what has stopped the bench, if anything has."""
        ...


class BenchClock(Protocol):
    """What a bench needs of the clock it runs on; `speed` is a factor on real time, or "max"."""

    @property
    def speed(self) -> float | Literal["max"]:
        """How fast its time passes."""
        ...

    def now(self) -> float:
        """Seconds since the clock began; never goes back."""
        ...

    def sleep(self, duration_s: float) -> None:
        """Return once `duration_s` have passed on this clock."""
        ...

    def attach(self, bench: Served) -> None:
        """Tell the clock which bench runs on it."""
        ...

    def reach(self, time_s: float) -> bool:
        """Whether it is `time_s` now, after going there where the clock can."""
        ...

    def real_s_until(self, time_s: float) -> float:
        """Real seconds until it will be `time_s`."""
        ...


class ScaledClock:
    """Real time, `speed` times as fast, from `begin_s` at the moment the clock was made."""

    def __init__(self, speed: float, begin_s: float = 0.0) -> None:
        if not (speed > 0 and math.isfinite(speed)):
            raise ValueError(f"The speed of a bench is a positive number; {speed} is not. Give for example 1 or 40.")
        self._speed, self._begin_s = float(speed), begin_s
        self._start_s = time.monotonic()
        self._bench: Served | None = None

    @property
    def speed(self) -> float:
        """How many of its seconds pass in a real one."""
        return self._speed

    def attach(self, bench: Served) -> None:
        """Tell the clock which bench runs on it."""
        self._bench = bench

    def now(self) -> float:
        """Seconds since the clock was made, times the speed, on top of where it began."""
        return self._begin_s + (time.monotonic() - self._start_s) * self.speed

    def sleep(self, duration_s: float) -> None:
        """Wait `duration_s` over speed; raises what has stopped the bench meanwhile."""
        time.sleep(_checked(duration_s) / self.speed)
        if self._bench is not None:
            self._bench.raise_failure()

    def reach(self, time_s: float) -> bool:
        """Whether `time_s` has come."""
        return time_s <= self.now()

    def real_s_until(self, time_s: float) -> float:
        """Real seconds until `time_s`; 0 when it has come."""
        return max(0.0, (time_s - self.now()) / self.speed)


class VirtualClock:
    """Time that stands still until somebody waits, and then passes at once.

    A bench whose clients have nothing more to say goes straight to its next reply; a caller of `sleep` first lets the
    bench take and answer everything that was sent before, and then finds `duration_s` gone.
    """

    @property
    def speed(self) -> Literal["max"]:
        """As fast as can be."""
        return "max"

    def __init__(self) -> None:
        self._now_s = 0.0
        self._lock = threading.Lock()
        self._bench: Served | None = None

    def attach(self, bench: Served) -> None:
        """Tell the clock which bench runs on it."""
        self._bench = bench

    def now(self) -> float:
        """Seconds of virtual time."""
        return self._now_s

    def sleep(self, duration_s: float) -> None:
        """Serve the bench in the caller's thread, then advance; raises what has stopped the bench."""
        _checked(duration_s)
        if self._bench is not None:
            self._bench.serve()
        with self._lock:
            self._now_s += duration_s
        if self._bench is not None:
            # what a device said on its own meanwhile is with its client now
            self._bench.serve()

    def reach(self, time_s: float) -> bool:
        """Go to `time_s`, unless it has passed; always true."""
        with self._lock:
            self._now_s = max(self._now_s, time_s)
        return True

    def real_s_until(self, time_s: float) -> float:
        """No real time at all."""
        return 0.0


def _checked(duration_s: float) -> float:
    if not (duration_s >= 0 and math.isfinite(duration_s)):
        raise ValueError(f"A clock can wait for zero seconds or more; {duration_s} s is not possible.")
    return duration_s
