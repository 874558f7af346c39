"""A motor of a simulated APT controller with its stage: motions, home, counters and status bits."""

from __future__ import annotations

from dataclasses import dataclass

from sim_devices.axis import Axis
from sim_devices.thorlabs_apt.limits import AptLimits
from sim_devices.thorlabs_apt.models import AptModel

_ABRUPT_DEG_S2 = 1e5
_STRUCK_DEG = 0.5

_CLOCKWISE, _COUNTER_CLOCKWISE, _TO_JOGGING = 0x10, 0x20, 2
_CONNECTED, _HOMING, _HOMED, _SETTLED, _POWER_OK, _ENABLED = 0x100, 0x200, 0x400, 0x2000, 0x1000_0000, 0x8000_0000
_OVERLOADED = 0x100_0000 | 0x4000_0000


@dataclass(eq=False)
class Motion:
    """What a motor does until `end_s`; a home search makes the place it ends at the counters' zero."""

    end_s: float
    is_forward: bool = True
    is_jog: bool = False
    home_deg: float | None = None
    is_cut_short: bool = False


class AptMotor:
    """A motor; enabled and not homed after power-on. Speeds are in the controller's words.

    A stepper's position is what its motor was told; a servo's is what its encoder tells.

    Parameters
    ----------
    axis : Axis
        What it turns.
    model : AptModel
        The stage's scales.

    Attributes
    ----------
    limits : AptLimits
        What ends its travel.
    """

    def __init__(self, axis: Axis, model: AptModel) -> None:
        self._axis, self._model = axis, model
        self.power_cycle(float("-inf"))

    def power_cycle(self, now_s: float) -> None:
        """Lose home and counters; a motion ends at once."""
        self.motion = Motion(float("-inf"))
        self.limits = AptLimits(self._model)
        self._is_enabled, self._is_homed, self._is_overloaded = True, False, False
        # a limit switch that was met unforeseen: its status bit, and where
        self._struck: tuple[int, float] | None = None
        if self._axis.is_moving(now_s):
            self._axis.stop(now_s, deceleration_deg_s2=_ABRUPT_DEG_S2)
        self._zero_deg = self._encoder_zero_deg = self._axis.target_deg

    def is_moving(self, now_s: float) -> bool:
        """Whether a motion has not ended."""
        return now_s < self.motion.end_s

    @property
    def is_enabled(self) -> bool:
        """Whether it has power."""
        return self._is_enabled

    def enable(self, now_s: float, *, is_on: bool) -> None:
        """Give it power, which ends an overload, or take it, which ends a motion at once."""
        if is_on:
            self._is_overloaded = False
        elif self.is_moving(now_s):
            self.stop(now_s, acceleration=None)
        self._is_enabled = is_on

    def overload(self, now_s: float) -> None:
        """Lose power until it is enabled again."""
        self.enable(now_s, is_on=False)
        self._is_overloaded = True

    def hit_limit(self, now_s: float) -> None:
        """Meet a limit switch in the way, which ends the motion at once."""
        self.stop(now_s, acceleration=None)
        self._struck = self.limits.switch_bit(is_forward=self.motion.is_forward), self._axis.target_deg

    def lose_home(self, now_s: float) -> None:
        """Count from 0 where it stands."""
        self.stop(now_s, acceleration=None)
        self._is_homed = False
        self._zero_deg = self._encoder_zero_deg = self._axis.target_deg

    def position(self, now_s: float) -> int:
        """The position counter."""
        self._finish_homing(now_s)
        told_deg = self._axis.position_deg if self._model.is_servo else self._axis.motor_deg
        return self._counts(told_deg(now_s) - self._zero_deg)

    def encoder(self, now_s: float) -> int:
        """The encoder counter."""
        self._finish_homing(now_s)
        return self._counts(self._axis.position_deg(now_s) - self._encoder_zero_deg)

    def set_position(self, counts: int, now_s: float) -> None:
        """Let the position counter be `counts` here."""
        self._finish_homing(now_s)
        self._zero_deg = self._axis.motor_deg(now_s) - counts * self._model.step_deg

    def set_encoder(self, counts: int, now_s: float) -> None:
        """Let the encoder counter be `counts` here."""
        self._finish_homing(now_s)
        self._encoder_zero_deg = self._axis.motor_deg(now_s) - counts * self._model.step_deg

    def speed_word(self, now_s: float) -> int:
        """How fast the stage turns."""
        return round(abs(self._axis.velocity_deg_s(now_s)) * self._model.velocity_scale)

    def status_bits(self, now_s: float) -> int:
        """The 32 status bits."""
        self._finish_homing(now_s)
        here_deg = self._axis.motor_deg(now_s)
        bits = _CONNECTED | _POWER_OK | self.limits.bits(here_deg, self._zero_deg)
        bits |= (_HOMED if self._is_homed else 0) | (_ENABLED if self._is_enabled else 0)
        bits |= _OVERLOADED if self._is_overloaded else 0
        if self._struck is not None and abs(here_deg - self._struck[1]) <= _STRUCK_DEG:
            bits |= self._struck[0]
        if not self.is_moving(now_s):
            return bits | _SETTLED
        velocity_deg_s = self._axis.velocity_deg_s(now_s)
        is_forward = velocity_deg_s > 0 if velocity_deg_s else self.motion.is_forward
        direction = _CLOCKWISE if is_forward == self._model.forward_is_clockwise else _COUNTER_CLOCKWISE
        bits |= direction << (_TO_JOGGING if self.motion.is_jog else 0)
        return bits | (_HOMING if self.motion.home_deg is not None else 0)

    def move_to(self, counts: int, now_s: float, *, velocity: int, acceleration: int, is_jog: bool = False) -> Motion:
        """Go where the position counter is `counts`, or as far as its limits let it, from whatever is under way."""
        self._finish_homing(now_s)
        return self._move(self._zero_deg + counts * self._model.step_deg, now_s, velocity, acceleration, is_jog)

    def run(self, sign: int, now_s: float, *, velocity: int, acceleration: int, is_jog: bool = False) -> Motion:
        """Turn until stopped, or until a limit or the counter's end."""
        self._finish_homing(now_s)
        end_deg = self._zero_deg + sign * 360.0 * self._model.turn_limit
        return self._move(end_deg, now_s, velocity, acceleration, is_jog)

    def home(self, sign: int, offset: int, now_s: float, *, velocity: int, acceleration: int) -> Motion:
        """Turn to the switch, whatever else it is for, then by `offset` to where the counters shall be zero."""
        self._turn(self.limits.switch_from(self._axis.motor_deg(now_s), sign), now_s, velocity, acceleration)
        home_deg = self._axis.target_deg + offset * self._model.step_deg
        self._turn(home_deg, self._axis.end_s, velocity, acceleration)
        self._is_homed, self._struck = False, None
        self.motion = Motion(self._axis.end_s, sign > 0, home_deg=self._axis.target_deg)
        return self.motion

    def stop(self, now_s: float, *, acceleration: int | None) -> Motion:
        """Stop, at once when no acceleration is given."""
        self._finish_homing(now_s)
        deceleration_deg_s2 = _ABRUPT_DEG_S2 if acceleration is None else self._acceleration_deg_s2(acceleration)
        self._axis.stop(now_s, deceleration_deg_s2=deceleration_deg_s2)
        self.motion = Motion(self._axis.end_s, self.motion.is_forward, self.motion.is_jog)
        return self.motion

    def _move(self, target_deg: float, now_s: float, velocity: int, acceleration: int, is_jog: bool) -> Motion:
        start_deg = self._axis.motor_deg(now_s)
        barrier = self.limits.barrier(start_deg, target_deg, self._zero_deg)
        is_forward, self._struck = target_deg > start_deg, None
        if barrier is None or not barrier.is_abrupt:
            self._turn(barrier.at_deg if barrier else target_deg, now_s, velocity, acceleration)
        else:
            self._turn(target_deg, now_s, velocity, acceleration)
            passes_s = self._axis.passes_at(barrier.at_deg, now_s)
            assert passes_s is not None
            self._axis.stop(passes_s, deceleration_deg_s2=_ABRUPT_DEG_S2)
        self.motion = Motion(self._axis.end_s, is_forward, is_jog, is_cut_short=barrier is not None)
        return self.motion

    def _turn(self, target_deg: float, start_s: float, velocity: int, acceleration: int) -> None:
        acceleration_deg_s2 = self._acceleration_deg_s2(acceleration)
        self._axis.move(
            target_deg,
            start_s,
            velocity_deg_s=min(max(velocity, 1) / self._model.velocity_scale, self._model.velocity_deg_s),
            acceleration_deg_s2=acceleration_deg_s2,
            deceleration_deg_s2=acceleration_deg_s2,
        )

    def _acceleration_deg_s2(self, word: int) -> float:
        return max(word, 1) / self._model.acceleration_scale

    def _counts(self, way_deg: float) -> int:
        # the counters are 32 bits wide
        return (round(way_deg * self._model.counts_per_deg) + (1 << 31)) % (1 << 32) - (1 << 31)

    def _finish_homing(self, now_s: float) -> None:
        if self.motion.home_deg is not None and not self.is_moving(now_s):
            self._zero_deg = self._encoder_zero_deg = self.motion.home_deg
            self.motion.home_deg = None
            self._is_homed = True
