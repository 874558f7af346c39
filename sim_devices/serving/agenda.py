"""What is to be said at which time: replies that clients wait for, and what devices say on their own."""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Callable
from typing import Generic, NamedTuple, TypeVar

from sim_devices.device import Later

T = TypeVar("T")


class Entry(NamedTuple, Generic[T]):
    """Something to be said to `client`: bytes, or what finds out at `due_s`; `order` tells equal times apart."""

    due_s: float
    order: int
    client: T
    said: bytes | Later
    is_reply: bool


class Agenda(Generic[T]):
    """Entries in the order of their times, and of their coming where the times are equal."""

    def __init__(self) -> None:
        self._replies: list[Entry[T]] = []
        self._unasked: list[Entry[T]] = []
        self._order = itertools.count()

    def add(self, due_s: float, client: T, said: bytes | Later, *, is_reply: bool) -> None:
        """Enter a reply, or what a device says on its own."""
        entry = Entry(due_s, next(self._order), client, said, is_reply)
        heapq.heappush(self._replies if is_reply else self._unasked, entry)

    @property
    def next_reply_s(self) -> float | None:
        """When the first reply is due; None when there is none."""
        return self._replies[0].due_s if self._replies else None

    @property
    def next_unasked_s(self) -> float | None:
        """When a device may next say something on its own; None when none will."""
        return self._unasked[0].due_s if self._unasked else None

    @property
    def next_told_s(self) -> float | None:
        """When a device may next tell a client something on its own; None when none will."""
        return min((entry.due_s for entry in self._unasked if entry.client is not None), default=None)

    def drop_bytes(self, client: T) -> None:
        """Drop all bytes that were to be said to a client, but not what it will find out later."""
        self._keep(lambda entry: entry.client is not client or not isinstance(entry.said, bytes))

    def forget(self, client: T) -> None:
        """Drop all that was to be said to a client."""
        self._keep(lambda entry: entry.client is not client)

    def _keep(self, is_wanted: Callable[[Entry[T]], bool]) -> None:
        for queue in (self._replies, self._unasked):
            queue[:] = filter(is_wanted, queue)
            heapq.heapify(queue)

    def pop(self, now_s: float) -> Entry[T] | None:
        """Take the first entry that is due by now; None when none is."""
        due = [queue for queue in (self._replies, self._unasked) if queue and queue[0].due_s <= now_s]
        return heapq.heappop(min(due, key=lambda queue: queue[0][:2])) if due else None
