"""How a camera's clock stands to the bench's, learnt from the pictures themselves.

An exposure begins after it was asked for and ends before its picture comes. Each picture therefore bounds the offset
between the two clocks from both sides; the bounds of all pictures together leave little room, and a picture that does
not fit in shows another moment than the one asked for.
"""

from __future__ import annotations

import math

_DRIFT = 1e-4
"""By how much one clock may run faster than the other: that of quartz, with plenty to spare."""

TOLERANCE_S = 0.005
"""Of the camera's own times."""


class CameraClock:
    """Bounds of the offset, bench less camera, in seconds."""

    def __init__(self) -> None:
        self._low_s, self._high_s, self._at_s = -math.inf, math.inf, 0.0

    def off_by_s(self, start_s: float, exposure_s: float, *, asked_s: float, answered_s: float) -> float:
        """How far an exposure lies outside the time that it was asked for; 0 when it may well lie within.

        Parameters
        ----------
        start_s, exposure_s : float
            When it began on the camera's clock, and how long it was.
        asked_s, answered_s : float
            When it was asked for and when the picture began to come, on the bench's clock.

        Returns
        -------
        float
            Negative when it began too early, positive when it ended too late.
        """
        low_s, high_s = self._bounds_s(asked_s)
        too_early_s = asked_s - start_s - high_s
        too_late_s = low_s - (answered_s - exposure_s - start_s)
        if too_early_s > TOLERANCE_S:
            return -too_early_s
        return too_late_s if too_late_s > TOLERANCE_S else 0.0

    def learn(self, start_s: float, exposure_s: float, *, asked_s: float, answered_s: float) -> None:
        """Draw the bounds closer by a picture that fits; parameters as of `off_by_s`."""
        low_s, high_s = self._bounds_s(asked_s)
        self._low_s = max(low_s, asked_s - start_s)
        self._high_s = min(high_s, answered_s - exposure_s - start_s)
        self._at_s = asked_s

    def on_bench_s(self, start_s: float) -> float:
        """When an exposure began on the bench's clock: the earliest that it can have been."""
        return start_s + self._low_s

    def _bounds_s(self, now_s: float) -> tuple[float, float]:
        drift_s = _DRIFT * abs(now_s - self._at_s)
        return self._low_s - drift_s, self._high_s + drift_s
