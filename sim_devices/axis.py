"""One turning axis of the simulated bench: where it is, whatever controller moves it."""

from __future__ import annotations

from collections.abc import Callable

from sim_devices import motion
from sim_devices.motion import Profile
from sim_devices.timeline import Timeline

AngleOfTime = Callable[[float], float]


class Axis:
    """An axis that starts at rest.

    Parameters
    ----------
    step_deg : float
        Encoder step; an axis comes to rest on a multiple of it after a move.
    start_deg : float
        Where it stands at first.

    Attributes
    ----------
    position_deg : callable
        What the encoder tells at a time; `motor_deg` itself, unless an effect disturbs it.
    before_motion : list of callable
        Called with a motion's start, in seconds, before the axis is told of it.
    """

    def __init__(self, step_deg: float, start_deg: float = 0.0) -> None:
        self.step_deg = step_deg
        self.position_deg: AngleOfTime = self.motor_deg
        self.before_motion: list[Callable[[float], None]] = []
        self._motions = Timeline(motion.at_rest(start_deg))

    def motor_deg(self, time_s: float) -> float:
        """True position of the motor."""
        return self._motions.at(time_s).position(time_s)

    def velocity_deg_s(self, time_s: float) -> float:
        """True velocity."""
        return self._motions.at(time_s).velocity(time_s)

    def profile(self, time_s: float) -> Profile:
        """The motion under way, or the one that has ended last."""
        return self._motions.at(time_s)

    def is_moving(self, time_s: float) -> bool:
        """Whether the axis has not yet come to rest."""
        return time_s < self._motions.at(time_s).end_s

    @property
    def end_s(self) -> float:
        """When the last motion that was asked for ends."""
        return self._motions.last.end_s

    @property
    def target_deg(self) -> float:
        """Where the last motion that was asked for ends."""
        return self._motions.last.end_deg

    def passes_at(self, position_deg: float, after_s: float) -> float | None:
        """When the motion under way is next at `position_deg`, not before `after_s`; None when it never is."""
        return self._motions.at(after_s).passes_at(position_deg, after_s)

    def move(
        self,
        target_deg: float,
        now_s: float,
        *,
        velocity_deg_s: float,
        acceleration_deg_s2: float,
        deceleration_deg_s2: float,
    ) -> None:
        """Go to the encoder step nearest to `target_deg`, from whatever motion is under way."""
        profile = motion.move(
            now_s,
            self.motor_deg(now_s),
            self.velocity_deg_s(now_s),
            round(target_deg / self.step_deg) * self.step_deg,
            velocity_deg_s=velocity_deg_s,
            acceleration_deg_s2=acceleration_deg_s2,
            deceleration_deg_s2=deceleration_deg_s2,
        )
        self._begin(profile)

    def stop(self, now_s: float, *, deceleration_deg_s2: float) -> None:
        """Decelerate to rest, and forget every motion that was to follow."""
        profile = motion.stop(
            now_s,
            self.motor_deg(now_s),
            self.velocity_deg_s(now_s),
            deceleration_deg_s2=deceleration_deg_s2,
        )
        self._begin(profile)

    def hold_up(self, now_s: float, duration_s: float) -> None:
        """Stand still for a while with the drive on, and then forget every motion that was to follow."""
        here_deg = self.motor_deg(now_s)
        self._begin(Profile(now_s, here_deg, 0.0, ((duration_s, 0.0),), here_deg))

    def _begin(self, profile: Profile) -> None:
        for look in self.before_motion:
            look(profile.start_s)
        self._motions.add(profile.start_s, profile)
