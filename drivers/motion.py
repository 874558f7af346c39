"""What every rotary axis has in common: the soft limits, and how long a motion may take."""

from __future__ import annotations

from drivers.clock import Clock, Deadline
from goniometer.errors import LimitError, ReplyTimeoutError


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
