"""What every rotary axis has in common: the soft limits, and how long a motion may take."""

from __future__ import annotations

from collections.abc import Callable

from drivers.clock import Clock, Deadline
from goniometer.errors import LimitError, NotConnectedError, ReplyError, ReplyTimeoutError

_LINK_ERRORS = (NotConnectedError, ReplyTimeoutError, ReplyError)


def refuse_outside(name: str, target_deg: float, limits_deg: tuple[float, float]) -> None:
    """Raise LimitError unless the target lies within the limits, ends included."""
    low_deg, high_deg = limits_deg
    if not low_deg <= target_deg <= high_deg:
        raise LimitError(
            name,
            f"the target {target_deg:g} degrees is outside the limits {low_deg:g} to {high_deg:g} degrees",
            not_done="the move was refused and nothing was sent",
            to_do="change the angle in the recipe, or limits_deg in the rig file if the arm can truly go there",
        )


def motion_deadline(clock: Clock, distance_deg: float, velocity_deg_s: float, acceleration_deg_s2: float) -> Deadline:
    """Allow twice the duration of a trapezoidal motion, and 5 s."""
    duration_s = abs(distance_deg) / velocity_deg_s + velocity_deg_s / acceleration_deg_s2
    return Deadline(clock, 2 * duration_s + 5.0)


def still_moving(name: str, target_deg: float) -> ReplyTimeoutError:
    """Describe a motion that has not ended in time."""
    return ReplyTimeoutError(
        name,
        f"the motion to {target_deg:g} degrees has not ended within twice its expected time and 5 s",
        not_done="the target was not reached; the axis may still be moving",
        to_do="look whether something is in its way, and whether the velocity and acceleration in the rig file are "
        "those of the device",
    )


def stop_or_warn(name: str, stop: Callable[[], None], reconnect: Callable[[], None]) -> None:
    """Stop; when the link fails, open it afresh and stop once more, for an axis must not run on for a lost link.

    Raises
    ------
    NotConnectedError
        When the second attempt fails too: the axis may still be moving.
    """
    try:
        stop()
        return
    except _LINK_ERRORS as error:
        first = error
    try:
        reconnect()
        stop()
    except _LINK_ERRORS as error:
        raise NotConnectedError(
            name,
            f"the stop did not get through ({first.happened}), nor over a fresh connection ({error.happened})",
            not_done="the axis was not stopped and may still be moving",
            to_do="cut its power or press the emergency stop now",
        ) from error
