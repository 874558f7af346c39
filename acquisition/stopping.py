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
"""Longest time an axis may take to come to rest after it was told to stop."""

_PAUSES_S = (1.0, 3.0)
"""Before an axis that cannot be asked is told to stop once more: a cable that was pulled may be in again."""

_LINK_ERRORS = (NotConnectedError, ReplyTimeoutError, ReplyError)


def stop_all(axes: Sequence[RotaryAxis], analyzer: Analyzer, clock: Clock) -> list[BaseException]:
    """Stop everything, see the axes come to rest, and return what failed, whatever it is.

    An axis that is seen to rest has not failed, whatever became of the command.
    """
    devices: list[RotaryAxis | Analyzer] = [*axes, analyzer]
    failures = {device.name: error for device in devices if (error := _failure(device.stop)) is not None}
    for axis in axes:
        error = _failure(partial(_see_at_rest, axis, clock))
        if error is not None:
            failures[axis.name] = error
        elif isinstance(failures.get(axis.name), DeviceError):
            del failures[axis.name]
    return list(failures.values())


def _failure(attempt: Callable[[], None]) -> BaseException | None:
    try:
        attempt()
    except BaseException as error:  # noqa: BLE001 (kept; whatever it is, the next device must be stopped too)
        return error
    return None


def _see_at_rest(axis: RotaryAxis, clock: Clock) -> None:
    for pause_s in _PAUSES_S:
        try:
            return _require_rest(axis, clock)
        except _LINK_ERRORS:
            clock.sleep(pause_s)
        with suppress(*_LINK_ERRORS):
            axis.stop()
    try:
        return _require_rest(axis, clock)
    except _LINK_ERRORS as error:
        raise DeviceFaultError(
            axis.name,
            f"it was told to stop, and whether it has stopped cannot be seen ({error.happened})",
            not_done="the axis may still be moving",
            to_do="look at it, and cut its power if it moves",
        ) from error


def _require_rest(axis: RotaryAxis, clock: Clock) -> None:
    deadline = Deadline(clock, _REST_S)
    while axis.is_moving():
        if deadline.has_passed():
            raise DeviceFaultError(
                axis.name,
                f"it answers, and still moves {_REST_S:g} s after it was told to stop",
                not_done="the axis may be anywhere",
                to_do="cut its power now",
            )
        clock.sleep(POLL_S)
