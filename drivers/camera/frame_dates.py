"""When pictures of a running stream were begun, and how many are missing between them."""

from __future__ import annotations

import math
from collections import deque

_DELAYS = 256
"""Pictures over which the shortest delay is looked for: long enough to find one, too short for clocks to drift."""

TOLD_AFTER = 4
"""Pictures without dates that must all lag behind before pictures are taken to be missing, and not just late."""

_BACKLOG = 0.9
"""Of the time between two pictures: those that follow each other faster have waited in a buffer."""

_GAP = 1.5


class FrameDates:
    """Dates of the pictures of one stream, on the bench's clock.

    A picture may wait in a buffer before it arrives, but never arrives before it is there. So where the stream dates
    its pictures by a clock of its own, the shortest delay of late between the two clocks leads from one to the other.
    Where it does not, the pictures themselves are that clock, which stands still while pictures are missing: a picture
    that comes late keeps the date that it would have had in time, unless those behind it come as late, and no faster
    than the camera takes them. A date may then be too early, but not too late, so that no old light passes for new.

    Parameters
    ----------
    frame_s : float
        From one picture to the next.
    latency_s : float
        From the end of a picture's exposure until it arrives, at least.
    """

    def __init__(self, frame_s: float, latency_s: float) -> None:
        self._frame_s, self._latency_s = frame_s, latency_s
        self._delays: deque[tuple[float, int]] = deque()
        """Each shorter than those behind it, with the `_number` of its picture."""
        self._number = 0
        self._arrived_s = self._position_s = math.nan
        self._counted_s = 0.0
        self._is_dated = True

    def date(self, arrived_s: float, position_s: float) -> tuple[float, int]:
        """Return when a picture was begun, and how many were found missing before it.

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
        if self._is_dated and (math.isnan(position_s) or not (is_first or since_position_s > 0)):
            self._is_dated, is_first = False, True
            self._delays.clear()
        if self._is_dated:
            there_s, missing = self._by_position(arrived_s, position_s, since_position_s)
        else:
            there_s, missing = self._by_count(arrived_s, since_arrival_s)
        return there_s - self._frame_s - self._latency_s, 0 if is_first else missing

    def _by_position(self, arrived_s: float, position_s: float, interval_s: float) -> tuple[float, int]:
        self._number += 1
        delay_s = self._shortest_s(arrived_s - position_s, _DELAYS)
        is_gap = interval_s > _GAP * self._frame_s
        return position_s + delay_s, round(interval_s / self._frame_s) - 1 if is_gap else 0

    def _by_count(self, arrived_s: float, interval_s: float) -> tuple[float, int]:
        self._number += interval_s >= _BACKLOG * self._frame_s
        self._counted_s += self._frame_s
        before_s = self._delays[0][0] if self._delays else math.inf
        delay_s = self._shortest_s(arrived_s - self._counted_s, TOLD_AFTER)
        rise_s = delay_s - before_s
        return self._counted_s + delay_s, round(rise_s / self._frame_s) if rise_s > (_GAP - 1) * self._frame_s else 0

    def _shortest_s(self, delay_s: float, pictures: int) -> float:
        """The shortest delay of the last pictures, this one among them."""
        while self._delays and self._delays[-1][0] >= delay_s:
            self._delays.pop()
        self._delays.append((delay_s, self._number))
        while self._delays[0][1] <= self._number - pictures:
            self._delays.popleft()
        return self._delays[0][0]
