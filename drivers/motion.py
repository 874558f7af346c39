"""What every motion has in common: soft limits, how long it may take, and whether it goes on."""

from __future__ import annotations

import math
from collections.abc import Callable

from drivers.clock import Clock, Deadline
from drivers.stage import Stage
from goniometer.errors import (
    DeviceFaultError,
    LimitError,
    NotConnectedError,
    PositionError,
    ReplyError,
    ReplyTimeoutError,
)

_LINK_ERRORS = (NotConnectedError, ReplyTimeoutError, ReplyError)
_LOOK_S = 0.5
_STALLED_S = 2.0


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


def refuse_elsewhere(
    name: str, position_deg: float, within_deg: tuple[float, float], tolerance_deg: float, wraps: bool
) -> None:
    """Raise PositionError unless an axis stands where its last move can have led, whole turns aside if it wraps."""
    low_deg, high_deg = within_deg[0] - tolerance_deg, within_deg[1] + tolerance_deg
    nearest_deg = position_deg + 360.0 * math.ceil((low_deg - position_deg) / 360.0) if wraps else position_deg
    if not low_deg <= nearest_deg <= high_deg:
        raise PositionError(
            name,
            f"after its link was lost it stands at {position_deg:g} degrees, where its last move between "
            f"{within_deg[0]:g} and {within_deg[1]:g} degrees cannot have led: it was moved by hand, its controller "
            "counts from another zero, or another one answers",
            not_done="it was not moved any more",
            to_do="look where it truly stands and which cable leads where, home it, then start again",
        )


def without_home(name: str, not_done: str) -> DeviceFaultError:
    """Describe a stage that cannot be moved before it is homed."""
    return DeviceFaultError(
        name,
        "the stage does not know where its zero is: it was switched off, or never homed",
        not_done=not_done,
        to_do=f"clear the way of the axis, then: goniometer home --axis {name}",
    )


def motion_s(distance_deg: float, velocity_deg_s: float, acceleration_deg_s2: float) -> float:
    """Duration of a motion of trapezoidal speed, or of a triangle when full speed is not reached."""
    distance_deg = abs(distance_deg)
    if distance_deg < velocity_deg_s**2 / acceleration_deg_s2:
        return 2.0 * math.sqrt(distance_deg / acceleration_deg_s2)
    return distance_deg / velocity_deg_s + velocity_deg_s / acceleration_deg_s2


def motion_deadline(clock: Clock, distance_deg: float, velocity_deg_s: float, acceleration_deg_s2: float) -> Deadline:
    """Allow twice the duration of a trapezoidal motion, and 5 s."""
    duration_s = abs(distance_deg) / velocity_deg_s + velocity_deg_s / acceleration_deg_s2
    return Deadline(clock, 2 * duration_s + 5.0)


def still_moving(name: str, target_deg: float) -> DeviceFaultError:
    """Describe a motion that has not ended in time, although the device answers."""
    return DeviceFaultError(
        name,
        f"the motion to {target_deg:g} degrees has not ended within twice its expected time and 5 s",
        not_done="the target was not reached; the axis was told to stop",
        to_do="look whether something is in its way, and whether the velocity and acceleration in the rig file are "
        "those of the device",
    )


def no_home(name: str, homing_s: float) -> DeviceFaultError:
    """Describe a search for the home position that has not ended in time, although the device answers."""
    return DeviceFaultError(
        name,
        f"the search for the home position has not ended within {homing_s:g} s",
        not_done="the zero is not known; the axis was told to stop",
        to_do="look what holds it up, then home it again",
    )


class Progress:
    """Whether an axis comes nearer to its target; looked at every half second, for a look is an exchange.

    Parameters
    ----------
    clock : Clock
        The clock the motion is timed on.
    start_deg, target_deg : float
        Where the motion begins and where it should end.
    stage : Stage
        Its speed says how much progress there should be.
    """

    def __init__(self, clock: Clock, start_deg: float, target_deg: float, stage: Stage) -> None:
        self._clock, self._target_deg = clock, target_deg
        # a hundredth of the way at full speed: encoder noise and a slow start are less, or more, than that
        self._least_deg = 0.01 * stage.velocity_deg_s * _STALLED_S
        self._moved_deg = start_deg
        self._stalled = Deadline(clock, _STALLED_S)
        self._looked_s = clock.now()

    def is_due(self) -> bool:
        """Whether it is time to look at the position."""
        return self._clock.now() - self._looked_s >= _LOOK_S

    def goes_on(self, position_deg: float) -> bool:
        """Take the position; False when there was no progress for too long, far from the target."""
        self._looked_s = self._clock.now()
        if abs(position_deg - self._moved_deg) >= self._least_deg:
            self._moved_deg = position_deg
            self._stalled = Deadline(self._clock, _STALLED_S)
        return not self._stalled.has_passed() or abs(position_deg - self._target_deg) < self._least_deg


def stalled(name: str, position_deg: float, target_deg: float) -> DeviceFaultError:
    """Describe an axis that stands still on its way."""
    return DeviceFaultError(
        name,
        f"the axis has stood still at {position_deg:g} degrees for {_STALLED_S:g} s on its way to {target_deg:g} "
        "degrees, although its controller says that it moves",
        not_done="the target was not reached; the axis was told to stop",
        to_do="look whether something is in its way or its motor is off, and home it before the next scan",
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
