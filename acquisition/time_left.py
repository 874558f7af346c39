"""How long a scan still takes, as far as its plan and its course so far tell."""

from __future__ import annotations

from collections.abc import Callable

from drivers.clock import Clock

_TRUSTED_S = 10.0
"""Seconds of the scan so far that count as much as the plan does, at the most."""

_TRUSTED_SHARE = 0.06
"""The same as a share of a short scan."""

_TRUSTED_OF_LONGEST_S = 1.0
"""The same where the plan is for the longest time, of which as a rule little is needed."""


class TimeLeft:
    """Counts a scan's time down, and learns from how long steps truly take.

    Parameters
    ----------
    clock : Clock
        The bench's clock; the scan begins with the first question.
    duration_s : float
        How long the scan should take.
    is_limit : bool
        Whether that is a time limit, of a scan that ends by itself: then what is left of it is left, however long steps
        take.
    is_longest : bool
        Whether it is the plan of the longest scan that a recipe allows, and most likely a good deal too long.
    readings : int
        How many readings it should take; 0 where nobody knows.
    reading_s : callable
        How long a reading takes, by its exposure.
    """

    def __init__(
        self,
        clock: Clock,
        duration_s: float,
        *,
        is_limit: bool = False,
        is_longest: bool = False,
        readings: int = 0,
        reading_s: Callable[[float], float] = float,
    ) -> None:
        self._readings, self._held_s, self.reading_s = readings, 0.0, reading_s
        self._clock, self._duration_s, self._is_limit = clock, duration_s, is_limit
        trusted_s = _TRUSTED_OF_LONGEST_S if is_longest else min(_TRUSTED_S, _TRUSTED_SHARE * duration_s)
        self._trusted_s = trusted_s or _TRUSTED_S  # a plan of no duration is no measure
        self._begun_s: float | None = None
        self._done_s = 0.0

    def step_done(self, duration_s: float) -> None:
        """A step is done that should have taken so long; one from before the scan begins is not part of it."""
        if self._begun_s is None:
            self._duration_s -= duration_s
        else:
            self._done_s += duration_s

    def held(self, duration_s: float) -> None:
        """The scan was held for so long, which tells nothing of how long its steps take."""
        self._held_s += duration_s

    def left_out(self, duration_s: float, readings: int) -> None:
        """A step that should have taken so long is left out, with its readings."""
        self._duration_s -= duration_s
        self._readings -= readings

    def exposure_changed(self, before_s: float, exposure_s: float, taken: int, in_step: int) -> None:
        """All readings but so many have another exposure than before; so many of them belong to the present step."""
        if not self._is_limit:
            longer_s = self.reading_s(exposure_s) - self.reading_s(before_s)
            self._duration_s += longer_s * max(self._readings - taken, 0)
            self._done_s -= longer_s * in_step  # the step will be counted as if all of it had the new one

    def elapsed_s(self) -> float:
        """How long the scan has taken so far."""
        if self._begun_s is None:
            self._begun_s = self._clock.now()
        return self._clock.now() - self._begun_s

    def left_s(self) -> float:
        """How long the rest takes, at the rate of the part that is done."""
        elapsed_s = self.elapsed_s()
        if self._is_limit:
            return max(self._duration_s - elapsed_s, 0.0)
        pace = (elapsed_s - self._held_s + self._trusted_s) / (self._done_s + self._trusted_s)
        return max(self._duration_s - self._done_s, 0.0) * pace
