"""A rotary axis as a scan moves it: limits, zero, the approach from one side, the way round, and deadlines."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from drivers.clock import Clock, Deadline
from drivers.motion import Progress, motion_deadline, refuse_outside, stalled, still_moving, stop_or_warn
from drivers.stage import Stage
from goniometer.errors import DeviceFaultError

HOMING_S = 180.0
"""How long a stage may search its home position."""


@dataclass(frozen=True)
class Travel:
    """How an axis may be moved, and when it has arrived; angles in degrees.

    Parameters
    ----------
    limits_deg : tuple of float
        Lowest and highest angle that the axis may be sent to.
    settle_s, tolerance_deg : float
        Time to come to rest, and how far from its target the axis may stop.
    zero_deg : float
        What the stage reads where the axis is at 0.
    backlash_deg : float
        Play of the gear. Every target is approached upwards: a move down, or a short one after it, goes so far below
        the target and comes back. 0 for a stage without play.
    wraps : bool
        Whether the stage may turn for ever, so that the axis takes the shorter way round.
    """

    limits_deg: tuple[float, float]
    settle_s: float
    tolerance_deg: float
    zero_deg: float = 0.0
    backlash_deg: float = 0.0
    wraps: bool = False

    @property
    def reachable_deg(self) -> tuple[float, float]:
        """The limits, less what the approach from below needs."""
        low_deg, high_deg = self.limits_deg
        return low_deg + (0.0 if self.wraps else self.backlash_deg), high_deg


class Axis:
    """One axis of the bench, on a stage of any make.

    Parameters
    ----------
    stage : Stage
        What turns it.
    clock : Clock
        Counts the deadlines of motions.
    travel : Travel
        How it may be moved.

    Attributes
    ----------
    permit : callable or None
        Asked before a move with the angles where it begins, turns and ends; raises to refuse it. None for an axis that
        cannot touch anything.
    """

    def __init__(self, stage: Stage, clock: Clock, travel: Travel) -> None:
        self.name, self.settle_s, self.tolerance_deg = stage.name, travel.settle_s, travel.tolerance_deg
        self.travel = travel
        self._stage, self._clock = stage, clock
        self._target_deg = 0.0
        self._legs: deque[float] = deque()
        self._deadline: Deadline | None = None
        self._progress: Progress | None = None
        self._came_from_below = False
        self._way_deg: list[float] = []
        self._rests = False
        self.permit: Callable[[Sequence[float]], None] | None = None

    def connect(self) -> tuple[str, ...]:
        """Check the stage and set it up; moves nothing. Returns errors left in it from earlier use."""
        return self._stage.connect()

    def is_homed(self) -> bool:
        """Whether the stage knows where its zero is."""
        return self._stage.is_homed()

    def start_homing(self) -> None:
        """Begin to search the home position; `is_moving` tells when it is found."""
        self._forget_motion()
        self._came_from_below = self._rests = False
        self._deadline = Deadline(self._clock, HOMING_S)
        self._stage.start_homing()

    def start_move(self, target_deg: float) -> None:
        """Begin to move to `target_deg`.

        Raises
        ------
        LimitError
            When the target, or the approach to it, is outside the limits; nothing is sent.
        CollisionError
            When `permit` finds a collision zone on the way; nothing is sent that moves.
        DeviceFaultError
            When the stage has lost its home position or does not take the move.
        """
        refuse_outside(self.name, target_deg, self.travel.reachable_deg)
        if not self._stage.is_homed():
            raise DeviceFaultError(
                self.name,
                "the stage does not know where its zero is: it was switched off, or never homed",
                not_done=f"the move to {target_deg:g} degrees; nothing was moved",
                to_do=f"clear the way of the axis, then: goniometer home --axis {self.name}",
            )
        self._forget_motion()
        here_deg = self._counted_deg()
        way_deg = self.way_deg(here_deg, target_deg)
        if self.permit is not None:
            self._rests = self._rests or not self._stage.is_moving()
            self.permit(way_deg if self._rests else [*self._until_rest_deg(here_deg), *way_deg])
        self._target_deg, self._way_deg = target_deg, way_deg
        self._legs.extend(way_deg[1:])
        self._start_leg(here_deg)

    def span_deg(self) -> tuple[float, float]:
        """Lowest and highest angle at which the axis is until it has arrived; a single one when it stands."""
        here_deg = self._counted_deg()
        angles_deg = [here_deg, *self._way_deg, *([] if self._rests else self._until_rest_deg(here_deg))]
        return min(angles_deg), max(angles_deg)

    def way_deg(self, here_deg: float, target_deg: float) -> list[float]:
        """The angles where a move begins, turns and ends; of an axis that turns for ever, with its whole turns."""
        if self.travel.wraps:
            target_deg = _nearest(target_deg, here_deg)
        play_deg, way_deg = self.travel.backlash_deg, target_deg - here_deg
        if play_deg and not (way_deg >= 0 and (self._came_from_below or way_deg > play_deg)):
            return [here_deg, target_deg - play_deg, target_deg]
        return [here_deg, target_deg]

    def is_moving(self) -> bool:
        """Ask whether the motion goes on.

        Raises
        ------
        DeviceFaultError
            When the stage reports a fault, or stands still far from its target: it is then told to stop.
        ReplyTimeoutError
            When the motion takes longer than its speed allows.
        """
        if self._stage.is_moving():
            self._require_progress()
            return True
        if self._legs:
            self._start_leg(self._counted_deg())
            return True
        self._forget_motion()
        self._rests = True
        return False

    def position_deg(self) -> float:
        """Where the stage says it is; of an axis that turns for ever, the angle nearest to its last target."""
        position_deg = self._counted_deg()
        return _nearest(position_deg, self._target_deg) if self.travel.wraps else position_deg

    def stop(self) -> None:
        """Stop; safe at any time.

        Raises
        ------
        NotConnectedError
            When the link is gone and a fresh connection fails too: the axis may still be moving.
        """
        self._forget_motion()
        self._came_from_below = self._rests = False
        stop_or_warn(self.name, self._stage.stop, self._stage.reconnect)

    def close(self) -> None:
        """Close the stage's port; it holds its position."""
        self._stage.close()

    def _start_leg(self, here_deg: float) -> None:
        there_deg, stage = self._legs.popleft(), self._stage
        self._rests = False
        way_deg = there_deg - here_deg
        self._came_from_below = way_deg > 0 or (way_deg == 0 and self._came_from_below)
        self._deadline = motion_deadline(self._clock, way_deg, stage.velocity_deg_s, stage.acceleration_deg_s2)
        self._progress = Progress(self._clock, here_deg, there_deg, stage) if stage.reports_in_motion else None
        stage.start_move(self.travel.zero_deg + there_deg)

    def _require_progress(self) -> None:
        if self._progress is not None and self._progress.is_due():
            position_deg = self._counted_deg()
            if not self._progress.goes_on(position_deg):
                self.stop()
                raise stalled(self.name, position_deg, self._target_deg)
        if self._deadline is not None and self._deadline.has_passed():
            self.stop()
            raise still_moving(self.name, self._target_deg)

    def _until_rest_deg(self, here_deg: float) -> tuple[float, float]:
        """Where the axis may come to rest, or turn back, when it is told something else at full speed."""
        brake_deg = self._stage.velocity_deg_s**2 / (2 * self._stage.acceleration_deg_s2)
        return here_deg - brake_deg, here_deg + brake_deg

    def _forget_motion(self) -> None:
        self._legs.clear()
        self._way_deg = []
        self._deadline = self._progress = None

    def _counted_deg(self) -> float:
        return self._stage.position_deg() - self.travel.zero_deg


def _nearest(angle_deg: float, to_deg: float) -> float:
    """The angle that differs from `angle_deg` by whole turns and is nearest to `to_deg`."""
    return angle_deg + 360.0 * round((to_deg - angle_deg) / 360.0)
