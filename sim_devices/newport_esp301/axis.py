"""One axis of the simulated ESP301: its motions, its limits and its home."""

from __future__ import annotations

import math

from sim_devices.axis import Axis
from sim_devices.newport_esp301.parameter import axis_error
from sim_devices.newport_esp301.settings import Esp301Settings
from sim_devices.newport_esp301.stages import Esp301Stage

# until the index is found, and found again slowly
_INDEX_SEARCH_S = 10.0
_ENDLESS_DEG = 360.0 * 10_000


class Esp301Axis:
    """What the controller knows of one axis. Without power until it is switched on.

    Positions of the controller are those of the stage less a zero, in degrees here.

    Parameters
    ----------
    axis : Axis
        What it turns.
    stage : Esp301Stage
        Its model.
    switches_deg : float
        Where the stage has a limit switch on either side; infinite if it turns without end.

    Attributes
    ----------
    powered : bool
        Whether the motor is on.
    settings : Esp301Settings
        Speeds, limits and the unit.
    home_mode : int
        How home is searched when no other way is named.
    """

    def __init__(self, axis: Axis, stage: Esp301Stage, switches_deg: float) -> None:
        self._axis, self.stage, self._switches_deg = axis, stage, switches_deg
        self._zero_deg = 0.0
        self.powered = False
        self._set_defaults()

    def _set_defaults(self) -> None:
        self.settings = Esp301Settings(self._axis.step_deg, self.stage.top_deg_s)
        self.home_mode = 1
        self._homing_end_s: float | None = None
        self._zero_after_homing = False
        self._limit_ahead: int | None = None
        self._faults: list[tuple[int, float]] = []

    @property
    def step_deg(self) -> float:
        """One count of the encoder."""
        return self._axis.step_deg

    @property
    def target_deg(self) -> float:
        """Where the last motion leads."""
        return self._axis.target_deg - self._zero_deg

    def encoder_deg(self, now_s: float) -> float:
        """Where the encoder tells that the stage is, in whole counts."""
        return round((self._axis.position_deg(now_s) - self._zero_deg) / self.step_deg) * self.step_deg

    def desired_deg(self, now_s: float) -> float:
        """Where the motion under way should be by now."""
        return self._axis.motor_deg(now_s) - self._zero_deg

    def velocity_deg_s(self, now_s: float) -> float:
        """How fast the stage turns."""
        return self._axis.velocity_deg_s(now_s)

    @property
    def busy_until_s(self) -> float:
        """When motion and homing end."""
        return max(self._axis.end_s, self._homing_end_s or -math.inf)

    def is_busy(self, now_s: float) -> bool:
        """Whether the axis moves or searches its home."""
        return now_s < self.busy_until_s

    def finish_motion(self, now_s: float) -> list[tuple[int, float]]:
        """Let what follows from a motion's end follow; the errors it ran into, with their times."""
        faults, self._faults = self._faults, []
        if self.is_busy(now_s):
            return faults
        if self._homing_end_s is not None:
            if self._zero_after_homing:
                self._zero_deg = self._axis.target_deg
            self._homing_end_s = None
        if self._limit_ahead is not None:
            faults.append((self._limit_ahead, self._axis.end_s))
            self.powered = self.powered and self._limit_ahead not in (4, 5)
            self._limit_ahead = None
        return faults

    def stop(self, now_s: float) -> None:
        """Decelerated stop; error 20 when it interrupts the home search."""
        self._halt(now_s, self.settings["AG"])

    def power_off(self, now_s: float) -> None:
        """Emergency stop, and power off."""
        self.powered = False
        self._halt(now_s, self.settings["AE"])

    def reset(self, now_s: float) -> None:
        """Back to the state after power-on; the position is kept."""
        self.power_off(now_s)
        self._set_defaults()

    def turns(self, axis: Axis) -> bool:
        """Whether this is the axis of that stage."""
        return self._axis is axis

    def hit_limit(self, now_s: float) -> None:
        """Stop as the limit switch ahead makes it: at once, with an error, and without power."""
        self._faults.append((4 if self._axis.velocity_deg_s(now_s) >= 0 else 5, now_s))
        self.power_off(now_s)

    def lose_home(self, now_s: float) -> None:
        """Count from 0 where it stands."""
        self.define(0.0, now_s)

    def define(self, position_deg: float, now_s: float) -> None:
        """Let the position be this one, here."""
        self._zero_deg = self._axis.position_deg(now_s) - position_deg

    def passes_at(self, position_deg: float, now_s: float) -> float:
        """When the motion under way passes a position; error 1 when it never does."""
        time_s = self._axis.passes_at(position_deg + self._zero_deg, now_s)
        if time_s is None:
            raise axis_error(1)
        return time_s

    def move_to(self, position_deg: float, now_s: float) -> None:
        """Go to a position, unless it is beyond a software limit."""
        self._require_ready()
        if position_deg > self.settings["SR"]:
            raise axis_error(6)
        if position_deg < self.settings["SL"]:
            raise axis_error(7)
        self._go(position_deg + self._zero_deg, now_s, velocity_deg_s=self.settings["VA"])

    def run(self, sign: int, now_s: float) -> None:
        """Run to the software limit."""
        self._require_ready()
        limit_deg = self.settings["SR" if sign > 0 else "SL"] + self._zero_deg
        self._go(limit_deg, now_s, velocity_deg_s=self.settings["VA"], limit_ahead=6 if sign > 0 else 7)

    def run_to_switch(self, sign: int, now_s: float) -> None:
        """Run to the limit switch."""
        self._require_ready()
        self._go(sign * _ENDLESS_DEG, now_s, velocity_deg_s=self.settings["VA"])

    def search_home(self, mode: int, now_s: float) -> None:
        """Search home in one of the ways 0 to 6: count zero, home switch or index, and limit switches."""
        self.require_no_homing()
        if not self.powered:
            raise axis_error(20)
        target_deg = self._zero_deg if mode == 0 else 0.0
        if mode >= 3:
            target_deg = math.copysign(min(self._switches_deg, _ENDLESS_DEG), 1 if mode in (3, 5) else -1)
        self._go(target_deg, now_s, velocity_deg_s=self.settings["OH"])
        self._zero_after_homing = mode != 0
        self._homing_end_s = self._axis.end_s + _INDEX_SEARCH_S

    def _halt(self, now_s: float, deceleration_deg_s2: float) -> None:
        self._limit_ahead = None
        if self._axis.is_moving(now_s):
            self._axis.stop(now_s, deceleration_deg_s2=deceleration_deg_s2)
        if self._homing_end_s is not None:
            self._homing_end_s = None
            self._faults.append((20, now_s))

    def require_no_homing(self) -> None:
        """Refuse with error 30 while the axis searches its home."""
        if self._homing_end_s is not None:
            raise axis_error(30)

    def _require_ready(self) -> None:
        self.require_no_homing()
        if not self.powered:
            raise axis_error(13)

    def _go(self, target_deg: float, now_s: float, *, velocity_deg_s: float, limit_ahead: int | None = None) -> None:
        """Move to a position of the stage, or as far towards it as the limit switches allow."""
        if abs(target_deg) > self._switches_deg:
            limit_ahead = 4 if target_deg > 0 else 5
            target_deg = math.copysign(self._switches_deg, target_deg)
        self._limit_ahead = limit_ahead
        self._axis.move(
            target_deg,
            now_s,
            velocity_deg_s=velocity_deg_s,
            acceleration_deg_s2=self.settings["AC"],
            deceleration_deg_s2=self.settings["AG"],
        )
