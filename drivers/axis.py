"""A rotary axis as a scan moves it: its zero, the legs of its way, deadlines, and where it may be meanwhile."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Sequence

from drivers.clock import Clock, Deadline
from drivers.motion import (
    Progress,
    motion_deadline,
    motion_s,
    no_home,
    refuse_elsewhere,
    refuse_outside,
    stalled,
    still_moving,
    stop_or_warn,
    without_home,
)
from drivers.stage import SaysWhenItStood, Stage
from drivers.travel import Travel, nearest_turn_deg
from goniometer.errors import DeviceFaultError

HOMING_S = 180.0
"""How long a stage may search its home position."""

_FRESH_S = 0.1
"""How long the position of an axis at rest, once asked, is taken for where it starts from."""


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
    rested_s : float
        When it was seen to have come to rest, on the bench's clock.
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
        self._is_under_way = False
        self._within_deg: tuple[float, float] | None = None
        self._was_homed = False
        self._seen_deg: tuple[float, float] | None = None
        self._arrives_s = math.inf
        self.rested_s = 0.0
        self.permit: Callable[[Sequence[float]], None] | None = None

    def connect(self) -> tuple[str, ...]:
        """Check the stage and set it up; moves nothing. Returns errors left in it from earlier use.

        Raises
        ------
        DeviceFaultError
            When it is called again, after a lost link, and the stage has forgotten its home.
        PositionError
            When it stands where its last move cannot have led.
        """
        was_homed = self._was_homed
        notes = self._stage.connect()
        if was_homed and not self.is_homed():
            raise without_home(self.name, "any further move")
        if self._within_deg is not None:
            refuse_elsewhere(self.name, self._counted_deg(), self._within_deg, self.tolerance_deg, self.travel.wraps)
        return notes

    def is_homed(self) -> bool:
        """Whether the stage knows where its zero is."""
        self._was_homed = self._stage.is_homed()
        return self._was_homed

    def start_homing(self) -> None:
        """Begin to search the home position; `is_moving` tells when it is found."""
        self._forget_motion()
        self._came_from_below = self._was_homed = False
        self._is_under_way, self._within_deg = True, None
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
            When the stage has lost its home position or does not take the move; with `permit`, also when it moves
            although this program has not told it to.
        """
        refuse_outside(self.name, target_deg, self.travel.reachable_deg)
        if not self.is_homed():
            raise without_home(self.name, f"the move to {target_deg:g} degrees; nothing was moved")
        here_deg = self._start_deg()
        way_deg = self.way_deg(here_deg, target_deg)
        if self.permit is not None:
            self.require_rest()
            self.permit(way_deg)
        angles_deg = [*way_deg, *self._until_rest_deg()]
        self._is_under_way, self._within_deg = True, (min(angles_deg), max(angles_deg))
        self._forget_motion()
        self._target_deg = target_deg
        self._legs.extend(way_deg[1:])
        self._start_leg(here_deg)

    def require_rest(self) -> None:
        """See that the axis does not move by itself; without its zero it may be anywhere in any case.

        Raises
        ------
        DeviceFaultError
            When the axis moves although this program has not told it to, or its stage reports a fault.
        """
        if not self._is_under_way and (self._was_homed or self.is_homed()) and self._stage.is_moving():
            raise DeviceFaultError(
                self.name,
                "the axis moves although this program has not told it to: a program that was killed, another one, or a "
                "person at the controller has",
                not_done="nothing was moved from here, and its motion was not stopped",
                to_do="wait until it stands or stop it with: goniometer stop, then start again",
            )

    def span_deg(self) -> tuple[float, float]:
        """Lowest and highest angle at which the axis may be until it is seen at rest; a single one when it stands.

        Anywhere within its limits while it does not know its zero or searches it.

        Raises
        ------
        DeviceFaultError
            As `require_rest`: then nobody knows.
        """
        self.require_rest()
        angles_deg = [self._counted_deg(), *self._until_rest_deg()]
        return min(angles_deg), max(angles_deg)

    def way_deg(self, here_deg: float, target_deg: float) -> list[float]:
        """The angles where a move begins, turns and ends; of an axis that turns for ever, with its whole turns."""
        return self.travel.way_deg(here_deg, target_deg, came_from_below=self._came_from_below)

    def is_moving(self) -> bool:
        """Ask whether the motion goes on.

        Raises
        ------
        DeviceFaultError
            When the stage reports a fault, stands still far from its target, or moves for longer than its speed allows:
            it is then told to stop.
        """
        if self._stage.is_moving():
            self._require_progress()
            return True
        if self._legs:
            self._start_leg(self._counted_deg())
            return True
        self._forget_motion()
        self._is_under_way = False
        stage = self._stage
        self.rested_s = stage.stood_s if isinstance(stage, SaysWhenItStood) else self._clock.now()
        return False

    def remaining_s(self) -> float:
        """How long it should still take to the end of this leg, by its speed; infinite when it searches its home."""
        return self._arrives_s - self._clock.now()

    def position_deg(self) -> float:
        """Where the stage says it is; of an axis that turns for ever, the angle nearest to its last target."""
        position_deg = self._counted_deg()
        self._seen_deg = None if self._is_under_way else (position_deg, self._clock.now())
        return nearest_turn_deg(position_deg, self._target_deg) if self.travel.wraps else position_deg

    def stop(self) -> None:
        """Stop; safe at any time.

        Raises
        ------
        NotConnectedError
            When the link is gone and a fresh connection fails too: the axis may still be moving.
        """
        self._forget_motion()
        self._came_from_below = False
        stop_or_warn(self.name, self._stage.stop, self._stage.reconnect)

    def reconnect(self) -> None:
        """Open the stage's port afresh, once, after the link was lost; raises NotConnectedError."""
        self._seen_deg = None
        self._stage.reconnect()

    def close(self) -> None:
        """Close the stage's port; it holds its position."""
        self._stage.close()

    def _start_leg(self, here_deg: float) -> None:
        there_deg, stage = self._legs.popleft(), self._stage
        way_deg = there_deg - here_deg
        self._came_from_below = way_deg > 0 or (way_deg == 0 and self._came_from_below)
        self._deadline = motion_deadline(self._clock, way_deg, stage.velocity_deg_s, stage.acceleration_deg_s2)
        self._arrives_s = self._clock.now() + motion_s(way_deg, stage.velocity_deg_s, stage.acceleration_deg_s2)
        self._progress = Progress(self._clock, here_deg, there_deg, stage) if stage.reports_in_motion else None
        stage.start_move(self.travel.zero_deg + there_deg)

    def _require_progress(self) -> None:
        if self._progress is not None and self._progress.is_due():
            position_deg = self._counted_deg()
            if not self._progress.goes_on(position_deg):
                self.stop()
                raise stalled(self.name, position_deg, self._target_deg)
        if self._deadline is not None and self._deadline.has_passed():
            homes = self._within_deg is None
            self.stop()
            raise no_home(self.name, HOMING_S) if homes else still_moving(self.name, self._target_deg)

    def _until_rest_deg(self) -> tuple[float, ...]:
        """How far it may go before it is seen at rest, whatever it is told meanwhile: some stages obey no stop.

        Wherever it brakes or turns back, that is between where it last stood and where it was sent since.
        """
        if self._is_under_way:
            return self._within_deg or self.travel.limits_deg
        return () if self._was_homed else self.travel.limits_deg

    def _forget_motion(self) -> None:
        self._legs.clear()
        self._deadline = self._progress = self._seen_deg = None
        self._arrives_s = math.inf

    def _start_deg(self) -> float:
        """Where the axis is, as it said just now, if it has not been moved since."""
        if self.permit is None and self._seen_deg is not None and self._clock.now() - self._seen_deg[1] <= _FRESH_S:
            return self._seen_deg[0]
        return self._counted_deg()

    def _counted_deg(self) -> float:
        return self._stage.position_deg() - self.travel.zero_deg
