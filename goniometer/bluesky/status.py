"""What became of an order: still under way, done, or failed with an error that says why."""

from __future__ import annotations

import threading
from collections.abc import Callable

StatusCallback = Callable[["Status"], None]


class Status:
    """A `bluesky.protocols.Status` that can be asked from any thread.

    Parameters
    ----------
    order : str
        What was ordered, for a person.
    """

    def __init__(self, order: str) -> None:
        self._order = order
        self._lock = threading.Lock()
        self._ended = threading.Event()
        self._error: BaseException | None = None
        self._callbacks: list[StatusCallback] = []

    @property
    def done(self) -> bool:
        """Whether the order has ended, well or not."""
        return self._ended.is_set()

    @property
    def success(self) -> bool:
        """Whether it has ended well."""
        return self.done and self._error is None

    def exception(self, timeout: float | None = 0.0) -> BaseException | None:
        """What it failed with; None when it ended well.

        Parameters
        ----------
        timeout : float or None
            Real seconds to wait for its end; None waits for ever.

        Raises
        ------
        TimeoutError
            When it has not ended by then.
        """
        if not self._ended.wait(timeout):
            raise TimeoutError(f"{self._order}: still under way after {timeout:g} s. Wait longer, or stop the device.")
        return self._error

    def wait(self, timeout: float | None = None) -> None:
        """Return once it has ended well; raises what it failed with, or TimeoutError as `exception` does."""
        if (error := self.exception(timeout)) is not None:
            raise error

    def add_callback(self, callback: StatusCallback) -> None:
        """Have `callback` called with this status when it has ended, at once if it has."""
        with self._lock:
            if not self.done:
                self._callbacks.append(callback)
                return
        callback(self)

    def end(self, error: BaseException | None = None) -> None:
        """Note the end, once, and tell everybody who asked to hear of it."""
        with self._lock:
            self._error = error
            self._ended.set()
        for callback in self._callbacks:
            callback(self)

    def __repr__(self) -> str:
        if not self.done:
            return f"<{self._order}: under way>"
        return f"<{self._order}: done>" if self._error is None else f"<{self._order}: failed. {self._error}>"
