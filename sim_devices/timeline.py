"""What something was doing at any time: a list of stretches, each from its start until the next."""

from __future__ import annotations

from collections import deque
from typing import Generic, TypeVar

T = TypeVar("T")


class Timeline(Generic[T]):
    """Stretches in the order they were asked for; they may start in the future, when a device queues its commands.

    Only the newest 64 stretches are kept, far more than any device here queues.

    Parameters
    ----------
    first : T
        What holds from the beginning of time.
    """

    def __init__(self, first: T) -> None:
        self._stretches: deque[tuple[float, T]] = deque([(float("-inf"), first)], maxlen=64)

    def add(self, start_s: float, stretch: T) -> None:
        """Let `stretch` hold from `start_s`, whatever was to start at that time or later."""
        self._stretches.append((start_s, stretch))

    def at(self, time_s: float) -> T:
        """The stretch that holds at `time_s`."""
        for start_s, stretch in reversed(self._stretches):
            if start_s <= time_s:
                return stretch
        return self._stretches[0][1]

    @property
    def last(self) -> T:
        """The newest stretch, which may not have begun yet."""
        return self._stretches[-1][1]
