"""A link that was lost: everything is stopped, every device found again as it was, and what it broke is done anew."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import TYPE_CHECKING, TypeVar

from acquisition.events import LinkRestored
from acquisition.protocols import Analyzer, Reachable, RotaryAxis
from acquisition.stopping import LINK_ERRORS, require_rest
from drivers.clock import Clock
from goniometer.errors import DeviceError, NotConnectedError, ReplyTimeoutError

if TYPE_CHECKING:
    from acquisition.engine import Bench

T = TypeVar("T")

_PATIENCE_S = 30.0
"""How long a link may stay away: a USB adapter is back some 2 s after it was plugged in, a person takes longer."""

_FIRST_PAUSE_S, _LONGEST_PAUSE_S = 0.1, 3.0
"""Each attempt to connect waits twice as long as the one before, up to this."""

_UNREACHED = (NotConnectedError, ReplyTimeoutError)

_MOST = 3
"""Lost links that a step survives, of whichever devices: a plug that is loose wants a person."""


class LostLinks:
    """Gets a scan over links that are lost and come back.

    Only a link that is gone, or a device that is silent however often it is asked, is taken up again; not one that
    answers wrong. What cannot be told to stop meanwhile goes where it was sent, which the interlock has permitted
    wherever the others stop, and no farther.

    Parameters
    ----------
    bench : Bench
        The devices.
    clock : Clock
        The bench's clock.
    wait : callable
        Lets time pass; raises to end the scan.
    begin_again : callable
        Called with what has happened once all is well, before what was broken is done again.
    """

    def __init__(
        self,
        bench: Bench,
        clock: Clock,
        wait: Callable[[float], None],
        begin_again: Callable[[LinkRestored], None],
    ) -> None:
        self._movers: tuple[RotaryAxis | Analyzer, ...] = (*bench.axes.values(), *bench.selectors)
        self._to_check: list[tuple[Reachable, Callable[[], tuple[str, ...]]]] = [
            *((mover, partial(self._mover_again, mover)) for mover in self._movers),
            (bench.detector, bench.detector.connect),
        ]
        self._clock, self._wait, self._begin_again = clock, wait, begin_again
        self._in_this_step = 0

    def begin_step(self) -> None:
        """Forget what was lost before: each step may lose its links as often as the last."""
        self._in_this_step = 0

    def through(self, attempt: Callable[[], T]) -> T:
        """Do what may be done again from its beginning, again when a link was lost on the way.

        Raises
        ------
        NotConnectedError, ReplyTimeoutError
            When the link stays away for 30 s, or is lost for the fourth time in a step.
        DeviceError
            When a device comes back as another one, without its home, or elsewhere than it can be.
        """
        while True:
            try:
                return attempt()
            except _UNREACHED as lost:
                self._begin_again(self._restored(lost))

    def _restored(self, lost: DeviceError) -> LinkRestored:
        lost_s, lost_at = self._clock.now(), time.strftime("%H:%M:%S")
        self._in_this_step += 1
        if self._in_this_step > _MOST:
            lost.add_note(f"Links were lost {self._in_this_step} times in this step, and taken up again {_MOST} times.")
            raise lost
        for mover in self._movers:
            with suppress(*LINK_ERRORS):
                mover.stop()
        notes = self._all_back(lost)
        return LinkRestored(lost.device, lost.happened, lost_at, self._clock.now() - lost_s, notes)

    def _all_back(self, lost: DeviceError) -> tuple[str, ...]:
        give_up_s, pause_s = self._clock.now() + _PATIENCE_S, _FIRST_PAUSE_S
        while True:
            try:
                return self._all_as_before()
            except LINK_ERRORS as error:
                if self._clock.now() >= give_up_s:
                    lost.add_note(f"It was tried for {_PATIENCE_S:g} s to connect again, at last in vain: {error}")
                    raise lost from None
            except DeviceError as error:
                error.add_note(f"It came to light when all devices were checked, after this: {lost}")
                raise
            self._wait(pause_s)
            pause_s = min(2 * pause_s, _LONGEST_PAUSE_S)

    def _all_as_before(self) -> tuple[str, ...]:
        """See every device stopped, and the same as before, also those whose links were not lost: lines are shared."""
        notes: list[str] = []
        for number, (device, check) in enumerate(self._to_check):
            self._wait(0.0)  # a device that is away takes seconds
            try:
                notes += _over_a_fresh_link(device, check)
            except LINK_ERRORS:
                self._to_check.insert(0, self._to_check.pop(number))  # the next attempt begins with what is away
                raise
        return tuple(notes)

    def _mover_again(self, mover: RotaryAxis | Analyzer) -> tuple[str, ...]:
        mover.stop()
        require_rest(mover, self._clock, self._wait)
        return mover.connect()


def _over_a_fresh_link(device: Reachable, check: Callable[[], tuple[str, ...]]) -> list[str]:
    """Check a device, over a fresh connection where there is none; returns what it says."""
    try:
        notes = check()
    except _UNREACHED:
        device.reconnect()
        notes = check()
    return [f"{device.name}: {note}" for note in notes]
