"""The end of every scan: all that can move is told to stop, and seen to."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial

from acquisition.protocols import Analyzer, RotaryAxis
from acquisition.timing import POLL_S
from drivers.clock import Clock, Deadline
from goniometer.errors import DeviceError, DeviceFaultError, NotConnectedError, ReplyError, ReplyTimeoutError

_REST_S = 10.0
"""Longest time anything may take to come to rest after it was told to stop."""

_LOOK_S = 0.3

_PAUSES_S = (1.0, 3.0)
"""Before what cannot be asked is told to stop once more: a cable that was pulled may be in again."""

LINK_ERRORS = (NotConnectedError, ReplyTimeoutError, ReplyError)
"""What shows that a device cannot be asked, and nothing about the device."""


def stop_all(movers: Sequence[RotaryAxis | Analyzer], clock: Clock) -> dict[str, BaseException]:
    """Stop everything, see it come to rest, and return what failed, whatever it is, by the mover's name.

    What is seen to rest has not failed, whatever became of the command. An analyzer that knows nothing of a motion it
    was told to stop, as a wheel without such a command, counts as at rest.
    """
    failures = {mover.name: error for mover in movers if (error := _failure(mover.stop)) is not None}
    for mover in movers:
        error = _failure(partial(_see_at_rest, mover, clock))
        if error is not None:
            failures[mover.name] = error
        elif isinstance(failures.get(mover.name), DeviceError):
            del failures[mover.name]
    return failures


def _failure(attempt: Callable[[], None]) -> BaseException | None:
    try:
        attempt()
    except BaseException as error:  # noqa: BLE001 (kept; whatever it is, the next device must be stopped too)
        return error
    return None


def require_rest(mover: RotaryAxis | Analyzer, clock: Clock, wait: Callable[[float], None]) -> None:
    """See that what was told to stop comes to rest; raises DeviceFaultError when it does not within 10 s."""
    _wait_while(mover.is_moving, mover.name, POLL_S, clock, wait)


def _see_at_rest(mover: RotaryAxis | Analyzer, clock: Clock) -> None:
    for pause_s in _PAUSES_S:
        try:
            return _require_still(mover, clock)
        except LINK_ERRORS:
            clock.sleep(pause_s)
        with suppress(*LINK_ERRORS):
            mover.stop()
    try:
        return _require_still(mover, clock)
    except LINK_ERRORS as error:
        raise DeviceFaultError(
            mover.name,
            f"it was told to stop, and whether it has stopped cannot be seen ({error.happened})",
            not_done="it may still be moving",
            to_do="look at it, and cut its power if it moves",
        ) from error


def _require_still(mover: RotaryAxis | Analyzer, clock: Clock) -> None:
    """See it at rest; an axis that answers with an alarm alone, which says nothing of motion, by where it stands."""
    try:
        mover.is_moving()
    except DeviceFaultError:
        if not isinstance(mover, RotaryAxis):
            raise
        was_deg = mover.position_deg()
        clock.sleep(_LOOK_S)

        def goes_on() -> bool:
            nonlocal was_deg
            before_deg, was_deg = was_deg, mover.position_deg()
            return abs(was_deg - before_deg) > mover.tolerance_deg

        _wait_while(goes_on, mover.name, _LOOK_S, clock, clock.sleep)
    else:
        require_rest(mover, clock, clock.sleep)


def _wait_while(
    moves: Callable[[], bool], name: str, look_s: float, clock: Clock, wait: Callable[[float], None]
) -> None:
    deadline = Deadline(clock, _REST_S)
    while moves():
        if deadline.has_passed():
            raise DeviceFaultError(
                name,
                f"it answers, and still moves {_REST_S:g} s after it was told to stop",
                not_done="it may be anywhere",
                to_do="cut its power now",
            )
        wait(look_s)
