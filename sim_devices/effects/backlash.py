"""Backlash: play between a motor and the arm that it turns."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from pydantic import Field

from sim_devices.axis import Axis
from sim_devices.effects.entry import ArmEffect
from sim_devices.timeline import Timeline

if TYPE_CHECKING:
    from sim_devices.world import World


class Backlash(ArmEffect):
    """The arm follows its motor by half the play behind, in either direction, and stands while the play is taken up."""

    effect: Literal["backlash"] = Field(description="the effect's name")
    play_deg: float = Field(gt=0, le=5, description="what the motor turns on a reversal before the arm does, in deg")

    def install(self, world: World) -> None:
        """Let the light see the load instead of the motor."""
        world.angle_deg[self.axis] = Load(world.axes[self.axis], self.play_deg).angle_deg


class Load:
    """What hangs on an axis with play; it starts in the middle of it.

    The play operator: for a motor that goes one way from a to b the load goes from y to min(max(y, b - h), b + h), with
    half the play h; so where the load is depends on every turning point of the motor, and on no speed.

    Parameters
    ----------
    axis : Axis
        The axis, at rest.
    play_deg : float
        The whole play.
    """

    def __init__(self, axis: Axis, play_deg: float) -> None:
        self._axis, self._half_deg = axis, play_deg / 2
        self._starts = Timeline(axis.motor_deg(0.0))
        axis.before_motion.append(self._begin)

    def angle_deg(self, time_s: float) -> float:
        """Where the load is."""
        angle_deg, motion = self._starts.at(time_s), self._axis.profile(time_s)
        end_s = motion.start_s
        for duration_s, _ in motion.phases:
            # velocity changes its sign between phases only
            end_s = min(end_s + duration_s, time_s)
            angle_deg = self._follow(angle_deg, motion.position(end_s))
        return self._follow(angle_deg, motion.position(time_s))

    def _begin(self, start_s: float) -> None:
        self._starts.add(start_s, self.angle_deg(start_s))

    def _follow(self, angle_deg: float, motor_deg: float) -> float:
        return min(max(angle_deg, motor_deg - self._half_deg), motor_deg + self._half_deg)
