"""When pictures of a running stream were begun, and how many are missing between them."""

from __future__ import annotations

import math
from collections import deque

_DELAYS = 256
"""Pictures over which the shortest delay is looked for: long enough to find one, too short for clocks to drift."""

_GAP = 1.5


class FrameDates:
    """Dates of the pictures of one stream, on the bench's clock.

    A picture may wait in a buffer before it arrives, but never arrives before it is there. So where the stream dates
    its pictures by a clock of its own, the shortest delay of late between the two clocks leads from one to the other;
    where it does not, a picture is dated by its arrival.

    Parameters
    ----------
    frame_s : float
        From one picture to the next.
    latency_s : float
        From the end of a picture's exposure until it arrives, at least.
    """

    def __init__(self, frame_s: float, latency_s: float) -> None:
        self._frame_s, self._latency_s = frame_s, latency_s
        self._delays_s: deque[float] = deque(maxlen=_DELAYS)
        self._arrived_s = self._position_s = math.nan
        self._is_dated = True

    def date(self, arrived_s: float, position_s: float) -> tuple[float, int]:
        """Return when a picture was begun, and how many are missing before it.

        Parameters
        ----------
        arrived_s : float
            On the bench's clock.
        position_s : float
            On the stream's own; nan where it has none. One that stands still, or goes back, is not used any more.
        """
        since_arrival_s, since_position_s = arrived_s - self._arrived_s, position_s - self._position_s
        is_first = math.isnan(self._arrived_s)
        self._arrived_s, self._position_s = arrived_s, position_s
        self._is_dated = self._is_dated and not math.isnan(position_s) and (is_first or since_position_s > 0)
        self._delays_s.append(arrived_s - position_s)
        there_s = position_s + min(self._delays_s) if self._is_dated else arrived_s
        begun_s = there_s - self._frame_s - self._latency_s
        if is_first:
            return begun_s, 0
        interval_s = since_position_s if self._is_dated else since_arrival_s
        return begun_s, round(interval_s / self._frame_s) - 1 if interval_s > _GAP * self._frame_s else 0
