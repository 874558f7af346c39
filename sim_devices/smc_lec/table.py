"""An LER rotary table at its LEC controller: servo, return to origin, operations, hold and alarm."""

from __future__ import annotations

import math
from typing import NamedTuple

from sim_devices.axis import Axis
from sim_devices.smc_lec.registers import Operation

_SERVO_S = 0.3
_HOMING_SPEED_DEG_S, _HOMING_SEARCH_S = 20.0, 0.5
_JOG_SPEED_DEG_S = 10.0
_ACCELERATION_DEG_S2, _HARDEST_DEG_S2 = 1000.0, 3000.0


class _Course(NamedTuple):
    target_deg: float
    speed_deg_s: float
    acceleration_deg_s2: float = _ACCELERATION_DEG_S2
    deceleration_deg_s2: float = _ACCELERATION_DEG_S2
    is_homing: bool = False
    is_jog: bool = False


class LecTable:
    """A table after power-on: without torque, its origin not known, positions counted from where it stands.

    Parameters
    ----------
    axis : Axis
        What turns; its 0 deg is the origin.
    travel_deg : (float, float)
        Least and greatest position.
    top_speed_deg_s : float
        Greatest speed.

    Attributes
    ----------
    has_alarm, is_emergency : bool
        Whether an alarm is on, and whether the emergency stop is pressed.
    """

    def __init__(self, axis: Axis, travel_deg: tuple[float, float], top_speed_deg_s: float) -> None:
        self._axis, self._travel_deg, self._top_speed_deg_s = axis, travel_deg, top_speed_deg_s
        self._zero_deg = 0.0
        self.is_emergency = False
        self._forget()

    def _forget(self) -> None:
        self.has_alarm = False
        self._is_homed = False
        self._is_servo_wanted = False
        self._ready_s = math.inf
        self._course: _Course | None = None
        self._arrival_s = -math.inf
        self._is_held = False
        self._area_deg = (0.0, 0.0)
        self._in_position_deg = 0.0

    def power_cycle(self, now_s: float) -> None:
        """Lose the torque, the origin and every command."""
        self._axis.stop(now_s, deceleration_deg_s2=_HARDEST_DEG_S2)
        self._forget()
        self._zero_deg = self._axis.target_deg

    def position_deg(self, now_s: float) -> float:
        """Position from the origin, or from where the power came on."""
        return self._axis.position_deg(now_s) - self._zero_deg

    def speed_deg_s(self, now_s: float) -> float:
        """Speed, without a sign."""
        return abs(self._axis.velocity_deg_s(now_s))

    @property
    def target_deg(self) -> float:
        """Where the last course leads."""
        return (self._course.target_deg if self._course else self._axis.target_deg) - self._zero_deg

    def is_ready(self, now_s: float) -> bool:
        """Whether the servo holds the table."""
        return now_s >= self._ready_s

    def is_homed(self, now_s: float) -> bool:
        """Whether the origin is known."""
        self._arrive(now_s)
        return self._is_homed

    def is_busy(self, now_s: float) -> bool:
        """Whether the table moves or searches its origin."""
        self._arrive(now_s)
        searches = self._course is not None and self._course.is_homing and not self._is_held
        return searches or self._axis.is_moving(now_s)

    def is_in_position(self, now_s: float) -> bool:
        """Whether the table is within the in-position width of its target, to one encoder step."""
        left_deg = abs(self.position_deg(now_s) - self.target_deg)
        width_deg = max(self._in_position_deg, self._axis.step_deg)
        return self.is_homed(now_s) and self.is_ready(now_s) and left_deg <= width_deg

    def is_in_area(self, now_s: float) -> bool:
        """Whether the table is inside the area of its operation."""
        first_deg, last_deg = self._area_deg
        return first_deg < last_deg and self.is_homed(now_s) and first_deg <= self.position_deg(now_s) <= last_deg

    def emergency(self, is_on: bool, now_s: float) -> None:
        """Press or release the emergency stop."""
        self.is_emergency = is_on
        self._supply(now_s)

    def servo(self, is_on: bool, now_s: float) -> None:
        """Ask for torque, or take it away: that ends any course."""
        self._is_servo_wanted = is_on
        self._supply(now_s)

    def trip(self, now_s: float) -> None:
        """Raise an alarm: no torque until it is reset."""
        self.has_alarm = True
        self._supply(now_s)

    def reset(self, is_on: bool, now_s: float) -> None:
        """Clear the alarm."""
        if is_on:
            self.has_alarm = False
            self._supply(now_s)

    def hold(self, is_on: bool, now_s: float) -> None:
        """Come to rest and keep the target, or go on to it."""
        self._arrive(now_s)
        self._is_held = is_on
        if self._course is not None and is_on:
            self._axis.stop(now_s, deceleration_deg_s2=self._course.deceleration_deg_s2)
        elif self._course is not None:
            self._run(self._course, now_s)

    def home(self, is_on: bool, now_s: float) -> None:
        """Begin the return to the origin; an alarm without torque."""
        if is_on and self._may_begin(now_s):
            self._is_homed = False
            self._run(_Course(0.0, _HOMING_SPEED_DEG_S, is_homing=True), now_s)

    def jog(self, direction: int, now_s: float) -> None:
        """Turn towards one end of the travel, or stop doing so where `direction` is 0."""
        if direction and self._may_begin(now_s):
            self._run(_Course(self._travel_deg[direction > 0], _JOG_SPEED_DEG_S, is_jog=True), now_s)
        elif not direction and self._course is not None and self._course.is_jog:
            self._axis.stop(now_s, deceleration_deg_s2=self._course.deceleration_deg_s2)
            self._course = None

    def start(self, operation: Operation | None, now_s: float) -> bool:
        """Begin an operation; an alarm when it is none, or not possible.

        Returns
        -------
        bool
            Whether it was taken. During a course, a hold, an alarm or an emergency stop it is left alone.
        """
        if not self._may_begin(now_s):
            return False
        if operation is None or not self.is_homed(now_s) or not self._is_possible(operation, now_s):
            self.trip(now_s)
            return False
        self._area_deg, self._in_position_deg = operation.area_deg, operation.in_position_deg
        target_deg = self._destination_deg(operation, now_s)
        step_deg = self._axis.step_deg
        course = _Course(
            round(target_deg / step_deg) * step_deg,
            operation.speed_deg_s,
            operation.acceleration_deg_s2,
            operation.deceleration_deg_s2,
        )
        self._run(course, now_s)
        return True

    def _may_begin(self, now_s: float) -> bool:
        if self.has_alarm or self.is_emergency or self._is_held or self.is_busy(now_s):
            return False
        if not self.is_ready(now_s):
            self.trip(now_s)
            return False
        return True

    def _destination_deg(self, operation: Operation, now_s: float) -> float:
        return operation.position_deg + (self.target_deg if operation.is_relative else 0.0)

    def _is_possible(self, operation: Operation, now_s: float) -> bool:
        first_deg, last_deg = self._travel_deg
        return (
            first_deg <= self._destination_deg(operation, now_s) <= last_deg
            and 0 < operation.speed_deg_s <= self._top_speed_deg_s
            and 0 < operation.acceleration_deg_s2 <= _HARDEST_DEG_S2
            and 0 < operation.deceleration_deg_s2 <= _HARDEST_DEG_S2
        )

    def _supply(self, now_s: float) -> None:
        """Give torque where it is wanted and nothing forbids it; take it, and every course, where not."""
        self._arrive(now_s)
        if self._is_servo_wanted and not self.has_alarm and not self.is_emergency:
            self._ready_s = min(self._ready_s, now_s + _SERVO_S)
            return
        self._ready_s = math.inf
        self._axis.stop(now_s, deceleration_deg_s2=_HARDEST_DEG_S2)
        self._course = None

    def _run(self, course: _Course, now_s: float) -> None:
        self._axis.move(
            course.target_deg,
            now_s,
            velocity_deg_s=course.speed_deg_s,
            acceleration_deg_s2=course.acceleration_deg_s2,
            deceleration_deg_s2=course.deceleration_deg_s2,
        )
        self._course = course
        self._arrival_s = self._axis.end_s + _HOMING_SEARCH_S * course.is_homing

    def _arrive(self, now_s: float) -> None:
        """Let the end of a course have its consequences."""
        if self._course is None or self._is_held or now_s < self._arrival_s:
            return
        if self._course.is_homing:
            self._is_homed, self._zero_deg = True, 0.0
        self._course = None
