"""The rotators among the Elliptec modules: ELL8, ELL14 and ELL18."""

from __future__ import annotations

import numpy as np

from sim_devices.axis import Axis
from sim_devices.thorlabs_elliptec.module import (
    LONGEST_DRIVE_S,
    MECHANICAL_TIMEOUT,
    NOT_SUPPORTED,
    Drive,
    ElliptecError,
)

ELL8, ELL14, ELL18 = 0x08, 0x0E, 0x12
PULSES_PER_TURN = {ELL8: 262_144, ELL14: 143_360, ELL18: 143_360}
STEP_DEG = 360.0 / PULSES_PER_TURN[ELL14]

_TOP_DEG_S, _TOP_DEG_S2 = 430.0, 8600.0
_SETTLE_S = 0.04
_ENDLESS_DEG = 360.0 * 100_000


class ElliptecRotator:
    """A rotator on an axis; home is at 0 deg of it. Positions count on over full turns.

    Parameters
    ----------
    axis : Axis
        What it turns.
    type_code : int
        `ELL8`, `ELL14` or `ELL18`.
    spread : int
        Most pulses by which it misses a target.
    seed : int
        Of the misses.
    turns : int
        How often it has turned before.
    """

    travel, motors = 360, 2

    def __init__(self, axis: Axis, type_code: int = ELL14, *, spread: int = 5, seed: int = 0, turns: int = 0) -> None:
        self.type_code, self.pulses = type_code, PULSES_PER_TURN[type_code]
        self._axis, self._spread, self._step_deg = axis, spread, 360.0 / self.pulses
        self._random = np.random.default_rng(seed)
        for _ in range(turns):
            self._miss()
        self._zero_deg = 0.0
        self._zero_from_s, self._next_zero_deg = float("inf"), 0.0
        self._jog_pulses, self._home_offset = self.pulses // 8, 0

    def power_cycle(self, now_s: float) -> None:
        """Stop, and count from here."""
        self.stop(now_s)
        self._zero_deg = self._axis.target_deg
        self._jog_pulses, self._home_offset = self.pulses // 8, 0

    def position(self, now_s: float) -> int:
        """Position in pulses."""
        self._finish_homing(now_s)
        return round((self._axis.position_deg(now_s) - self._zero_deg) / self._step_deg)

    def drive(self, command: str, value: int | None, now_s: float, *, percent: int) -> Drive:
        """Begin one of the motions ho, ma, mr, fw, bw; raises ElliptecError, and then nothing has moved."""
        if command in ("fw", "bw"):
            sign = 1 if command == "fw" else -1
            if not self._jog_pulses:
                self._move(sign * _ENDLESS_DEG, now_s, percent)
                return Drive(float("inf"), can_be_stopped=True)
            return self._go(self.position(now_s) + sign * self._jog_pulses, now_s, percent)
        if value is None:
            raise ElliptecError(NOT_SUPPORTED)
        if command == "ho":
            return self._home(value, now_s, percent)
        return self._go(value + (self.position(now_s) if command == "mr" else 0), now_s, percent)

    def stop(self, now_s: float) -> float:
        """Stop; when it rests."""
        self._zero_from_s = float("inf")
        self._axis.stop(now_s, deceleration_deg_s2=_TOP_DEG_S2)
        return self._axis.end_s + _SETTLE_S

    def setting(self, command: str, value: int | None) -> int:
        """Set or get jog step (sj, gj; 0 turns without end) or home offset (so, go); raises ElliptecError."""
        if command in ("sj", "so") and value is None:
            raise ElliptecError(NOT_SUPPORTED)
        if command == "sj" and value is not None:
            self._jog_pulses = value
        if command == "so" and value is not None:
            self._home_offset = value
        return self._jog_pulses if command in ("sj", "gj") else self._home_offset

    def _go(self, target: int, now_s: float, percent: int) -> Drive:
        return self._turn(self._zero_deg + (target + self._miss()) * self._step_deg, now_s, percent)

    def _home(self, direction: int, now_s: float, percent: int) -> Drive:
        """Turn one way, 0 towards lower positions, to the offset behind the mark at 0 deg, and count from there."""
        if direction not in (0, 1):
            raise ElliptecError(NOT_SUPPORTED)
        sign, start_deg = 1 if direction else -1, self._axis.motor_deg(now_s)
        mark_deg = self._home_offset * self._step_deg
        # as near to home as it can tell, it does not turn once round
        tolerance_deg = (2 * self._spread + 1) * self._step_deg
        way_deg = (sign * (mark_deg - start_deg) + tolerance_deg) % 360.0 - tolerance_deg
        self._next_zero_deg = start_deg + sign * way_deg
        drive = self._turn(self._next_zero_deg + self._miss() * self._step_deg, now_s, percent)
        self._zero_from_s = drive.end_s if not drive.status else float("inf")
        return drive

    def _turn(self, target_deg: float, now_s: float, percent: int) -> Drive:
        self._move(target_deg, now_s, percent)
        if self._axis.end_s - now_s > LONGEST_DRIVE_S:
            self._axis.stop(now_s + LONGEST_DRIVE_S, deceleration_deg_s2=_TOP_DEG_S2)
            return Drive(self._axis.end_s + _SETTLE_S, MECHANICAL_TIMEOUT)
        return Drive(self._axis.end_s + _SETTLE_S)

    def _move(self, target_deg: float, now_s: float, percent: int) -> None:
        self._finish_homing(now_s)
        self._axis.move(
            target_deg,
            now_s,
            # at 0 percent the motor turns so slowly that it runs into its limit of time
            velocity_deg_s=_TOP_DEG_S * max(percent, 0.1) / 100,
            acceleration_deg_s2=_TOP_DEG_S2,
            deceleration_deg_s2=_TOP_DEG_S2,
        )

    def _finish_homing(self, now_s: float) -> None:
        if now_s >= self._zero_from_s:
            self._zero_deg, self._zero_from_s = self._next_zero_deg, float("inf")

    def _miss(self) -> int:
        return int(self._random.integers(-self._spread, self._spread + 1))
