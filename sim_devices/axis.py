"""One turning axis of the simulated bench: where it is, whatever controller moves it."""

from __future__ import annotations

from sim_devices import motion
from sim_devices.timeline import Timeline


class Axis:
    """An axis that starts at 0 deg, at rest.

    Parameters
    ----------
    step_deg : float
        Encoder step; an axis comes to rest on a multiple of it after a move.
    """

    def __init__(self, step_deg: float) -> None:
        self.step_deg = step_deg
        self._motions = Timeline(motion.at_rest(0.0))

    def position_deg(self, time_s: float) -> float:
        """True position."""
        return self._motions.at(time_s).position(time_s)

    def velocity_deg_s(self, time_s: float) -> float:
        """True velocity."""
        return self._motions.at(time_s).velocity(time_s)

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
            self.position_deg(now_s),
            self.velocity_deg_s(now_s),
            round(target_deg / self.step_deg) * self.step_deg,
            velocity_deg_s=velocity_deg_s,
            acceleration_deg_s2=acceleration_deg_s2,
            deceleration_deg_s2=deceleration_deg_s2,
        )
        self._motions.add(now_s, profile)

    def stop(self, now_s: float, *, deceleration_deg_s2: float) -> None:
        """Decelerate to rest, and forget every motion that was to follow."""
        profile = motion.stop(
            now_s,
            self.position_deg(now_s),
            self.velocity_deg_s(now_s),
            deceleration_deg_s2=deceleration_deg_s2,
        )
        self._motions.add(now_s, profile)
