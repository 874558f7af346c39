"""Motion of one axis as a pure function of time: constant accelerations, one after the other, then rest."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property


@dataclass(frozen=True)
class Profile:
    """Where an axis is from `start_s` on; before that it counts as standing at its start.

    Parameters
    ----------
    start_s : float
        Time at which the motion begins.
    start_deg, start_velocity_deg_s : float
        State at that time.
    phases : tuple of (duration_s, acceleration_deg_s2)
        Constant accelerations in order; the velocity is zero after the last.
    end_deg : float
        Where the axis rests afterwards.
    """

    start_s: float
    start_deg: float
    start_velocity_deg_s: float
    phases: tuple[tuple[float, float], ...]
    end_deg: float

    @cached_property
    def end_s(self) -> float:
        """Time from which the axis is at rest."""
        return self.start_s + sum(duration_s for duration_s, _ in self.phases)

    @cached_property
    def fastest_deg_s(self) -> float:
        """Greatest speed on the way."""
        speeds_deg_s = [self.start_velocity_deg_s]
        for duration_s, acceleration in self.phases:
            speeds_deg_s.append(speeds_deg_s[-1] + acceleration * duration_s)
        return max(map(abs, speeds_deg_s))

    def position(self, time_s: float) -> float:
        """Position at `time_s`, in degrees."""
        return self._state(time_s)[0]

    def velocity(self, time_s: float) -> float:
        """Velocity at `time_s`, in degrees per second."""
        return self._state(time_s)[1]

    def passes_at(self, position_deg: float, after_s: float) -> float | None:
        """First time not before `after_s` at which the axis is at `position_deg`; None when it never is."""
        begin_s, begin_deg, velocity = self.start_s, self.start_deg, self.start_velocity_deg_s
        for duration_s, acceleration in self.phases:
            for since_s in _roots(acceleration / 2, velocity, begin_deg - position_deg):
                if -1e-9 <= since_s <= duration_s + 1e-9 and begin_s + since_s >= after_s:
                    return begin_s + since_s
            begin_deg += (velocity + acceleration * duration_s / 2) * duration_s
            velocity += acceleration * duration_s
            begin_s += duration_s
        # rounding may put the target a hair beyond the end
        return max(after_s, self.end_s) if abs(position_deg - self.end_deg) < 1e-9 else None

    def _state(self, time_s: float) -> tuple[float, float]:
        if time_s >= self.end_s:
            return self.end_deg, 0.0
        position, velocity, left_s = self.start_deg, self.start_velocity_deg_s, time_s - self.start_s
        if left_s < 0:
            return position, 0.0
        for duration_s, acceleration in self.phases:
            if left_s < duration_s:
                return position + (velocity + acceleration * left_s / 2) * left_s, velocity + acceleration * left_s
            position += (velocity + acceleration * duration_s / 2) * duration_s
            velocity += acceleration * duration_s
            left_s -= duration_s
        return self.end_deg, 0.0


def at_rest(position_deg: float) -> Profile:
    """An axis that stands at `position_deg`."""
    return Profile(float("-inf"), position_deg, 0.0, (), position_deg)


def stop(start_s: float, start_deg: float, start_velocity_deg_s: float, *, deceleration_deg_s2: float) -> Profile:
    """Decelerate to rest from a state of motion."""
    duration_s = abs(start_velocity_deg_s) / deceleration_deg_s2
    acceleration = -math.copysign(deceleration_deg_s2, start_velocity_deg_s)
    end_deg = start_deg + start_velocity_deg_s * duration_s / 2
    return Profile(start_s, start_deg, start_velocity_deg_s, ((duration_s, acceleration),), end_deg)


def move(
    start_s: float,
    start_deg: float,
    start_velocity_deg_s: float,
    target_deg: float,
    *,
    velocity_deg_s: float,
    acceleration_deg_s2: float,
    deceleration_deg_s2: float,
) -> Profile:
    """Go from a state of rest or motion to rest at a target, with a trapezoid (or triangle) of velocity.

    An axis that moves away from the target, or too fast to stop before it, first comes to rest and turns back.

    Parameters
    ----------
    start_s, start_deg, start_velocity_deg_s : float
        State at the start.
    target_deg : float
        Where the axis comes to rest.
    velocity_deg_s, acceleration_deg_s2, deceleration_deg_s2 : float
        Magnitudes, all positive.
    """
    brake_deg = start_velocity_deg_s * abs(start_velocity_deg_s) / (2 * deceleration_deg_s2)
    way_deg = target_deg - start_deg
    phases: list[tuple[float, float]] = []
    speed = abs(start_velocity_deg_s)
    if brake_deg * way_deg < 0 or abs(brake_deg) > abs(way_deg):
        phases.append((speed / deceleration_deg_s2, -math.copysign(deceleration_deg_s2, start_velocity_deg_s)))
        way_deg -= brake_deg
        speed = 0.0
    sign = math.copysign(1.0, way_deg)
    phases += (
        (duration_s, sign * acceleration)
        for duration_s, acceleration in _one_way(
            abs(way_deg), speed, velocity_deg_s, acceleration_deg_s2, deceleration_deg_s2
        )
        if duration_s > 0
    )
    return Profile(start_s, start_deg, start_velocity_deg_s, tuple(phases), target_deg)


def _one_way(
    way: float, speed: float, top_speed: float, acceleration: float, deceleration: float
) -> tuple[tuple[float, float], ...]:
    """Phases over `way` >= 0 from `speed` >= 0, slow enough to stop in time, to rest."""
    if speed > top_speed:
        first, first_way = -deceleration, (speed**2 - top_speed**2) / (2 * deceleration)
        peak = top_speed
    else:
        first = acceleration
        # the triangle's top: way = (peak² - speed²) / 2a + peak² / 2d
        peak = math.sqrt((2 * acceleration * way + speed**2) * deceleration / (acceleration + deceleration))
        peak = min(max(peak, speed), top_speed)
        first_way = (peak**2 - speed**2) / (2 * acceleration)
    cruise_way = way - first_way - peak**2 / (2 * deceleration)
    cruise_s = max(cruise_way, 0.0) / peak if peak > 0 else 0.0
    return ((peak - speed) / first, first), (cruise_s, 0.0), (peak / deceleration, -deceleration)


def _roots(a: float, b: float, c: float) -> tuple[float, ...]:
    """Real roots of a x² + b x + c in ascending order."""
    if a == 0:
        return (-c / b,) if b != 0 else ()
    discriminant = b * b - 4 * a * c
    if discriminant < 0:
        return ()
    # adding numbers of one sign only, so that no digit of the smaller root cancels
    q = -(b + math.copysign(math.sqrt(discriminant), b)) / 2
    roots = {q / a, c / q} if q != 0 else {0.0}
    return tuple(sorted(roots))
