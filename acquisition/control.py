"""What a person asks of a scan while it runs: a mailbox that any thread may write to and the scan's thread reads."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass

from acquisition.steps import Step
from goniometer.errors import LimitError, ScanInterrupted

ABORTED = 3
"""Exit code of a scan that a person ended by key or by `ScanControl.abort`."""


@dataclass(frozen=True)
class Wishes:
    """What is asked for at one moment; `skip` is a step of the direction that was the present one then."""

    skip: Step | None
    exposure_s: float | None
    refusals: tuple[str, ...]


class ScanControl:
    """Pauses a scan, lets it go on, ends it, skips a direction, changes the exposure; from any thread.

    Every method returns at once. The scan does what was asked when the reading at hand is stored; an end, between any
    two waits. One control is for one scan.
    """

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._is_paused = self._test_now = False
        self._at: Step | None = None
        self._skip: Step | None = None
        self._asked_s: float | None = None
        self._exposure_s: float | None = None
        self._refusals: list[str] = []
        self._abort: str | None = None
        self._nearest_s: Callable[[float], float] = lambda exposure_s: exposure_s
        self.is_waiting = False
        """Whether anything is asked for that the scan has not yet done; asked before every reading."""

    def pause(self) -> None:
        """Hold the scan when the reading at hand is stored: axes at rest, links alive."""
        with self._changed:
            self._is_paused = True
            self._note()

    def go_on(self) -> None:
        """End a pause; a scan that has suspended itself looks at once whether its cause has gone."""
        with self._changed:
            self._is_paused, self._test_now = False, True
            self._note()

    def abort(self, reason: str = "a request to end it") -> None:
        """End the scan: the bench is stopped, `ScanInterrupted` with exit code 3 says `reason`."""
        with self._changed:
            self._abort = self._abort or reason
            self._changed.notify_all()

    def skip(self) -> None:
        """Leave out what remains of the present direction; in a pause nothing moves before `go_on`."""
        with self._changed:
            self._skip = self._at
            self._note()

    def set_exposure(self, exposure_s: float) -> float:
        """Take all readings from the next one on with another exposure.

        Parameters
        ----------
        exposure_s : float
            In s, above 0.

        Returns
        -------
        float
            The exposure that is taken: the nearest whole number of the detector's samples.

        Raises
        ------
        LimitError
            When the detector cannot have it; the scan goes on with the old one.
        """
        with self._changed:
            self._asked_s = self._nearest_s(exposure_s)
            self._note()
            return self._asked_s

    def scale_exposure(self, factor: float) -> None:
        """Change the exposure by a factor; a refusal is told by the scan, not raised."""
        with self._changed:
            now_s = self._exposure_s if self._asked_s is None else self._asked_s
        if now_s is None:
            return  # there is no scan yet
        try:
            self.set_exposure(now_s * factor)
        except LimitError as error:
            with self._changed:
                self._refusals.append(str(error))
                self._note()

    @property
    def is_paused(self) -> bool:
        """Whether a pause is asked for, or holds."""
        return self._is_paused

    def begin(self, exposure_s: float, nearest_s: Callable[[float], float]) -> None:
        """Belong to a scan: `nearest_s` gives the exposure that its detector can have, or raises LimitError."""
        with self._changed:
            self._exposure_s, self._nearest_s = exposure_s, nearest_s
            if self._asked_s is not None:
                self._asked_s = nearest_s(self._asked_s)

    def at(self, step: Step) -> None:
        """The scan has come to a step: its direction is the present one."""
        self._at = step

    def check(self) -> None:
        """Raise ScanInterrupted when the scan was asked to end."""
        if self._abort is not None:
            raise ScanInterrupted(self._abort, ABORTED)

    def take(self) -> Wishes:
        """Take everything out that was asked for; a pause stays until `go_on`."""
        with self._changed:
            wishes = Wishes(self._skip, self._asked_s, tuple(self._refusals))
            self._skip, self._asked_s = None, None
            self._exposure_s = wishes.exposure_s or self._exposure_s
            self._refusals.clear()
            self.is_waiting = self._is_paused
            return wishes

    def asks_test(self) -> bool:
        """Whether `go_on` was called since this was asked last."""
        with self._changed:
            asked, self._test_now = self._test_now, False
            return asked

    def wait(self, real_s: float) -> None:
        """Wait until something changes, at most so long in real time, for that is a person's."""
        with self._changed:
            if self._is_paused and self._abort is None:
                self._changed.wait(real_s)

    def _note(self) -> None:
        self.is_waiting = True
        self._changed.notify_all()
