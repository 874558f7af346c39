"""One axis of the simulated ESP301: its motions, its limits and the commands that are addressed to it."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import ClassVar

from sim_devices.axis import Axis
from sim_devices.newport_esp301.parameter import Esp301Error, axis_error, require_query, to_choice, to_number
from sim_devices.newport_esp301.settings import DEFAULTS, Esp301Settings

_STAGE = "URS150CC, SN1234"
_HARDWARE_LIMIT_DEG = 175.0
_INDEX_SEARCH_S = 2.0


class Esp301Axis:
    """What the controller knows of one axis. Without power until it is switched on.

    Positions of the controller are those of the stage less `_zero_deg`, in the unit of SN.
    """

    def __init__(self, axis: Axis) -> None:
        self._axis = axis
        self._zero_deg = 0.0
        self.powered = False
        self._set_defaults()

    def _set_defaults(self) -> None:
        self._settings = Esp301Settings(self._axis.step_deg)
        self._home_mode = 1
        self._homing_end_s: float | None = None
        self._zero_after_homing = False
        self._limit_ahead: int | None = None
        self._faults: list[tuple[int, float]] = []

    def run(self, mnemonic: str, parameter: str, now_s: float) -> str | None:
        """Run one command and return its answer, if it has one.

        Raises
        ------
        Esp301Error
            If the command is refused; nothing has changed then.
        """
        return self.COMMANDS[mnemonic](self, mnemonic, parameter, now_s)

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
        self._halt(now_s, self._settings["AG"])

    def power_off(self, now_s: float) -> None:
        """Emergency stop, and power off."""
        self.powered = False
        self._halt(now_s, self._settings["AE"])

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
        self._zero_deg = self._axis.position_deg(now_s)

    def passes_at(self, parameter: str, now_s: float) -> float:
        """When the motion under way passes a position; error 1 when it never does."""
        position_deg = to_number(parameter) * self._settings.deg_per_unit + self._zero_deg
        time_s = self._axis.passes_at(position_deg, now_s)
        if time_s is None:
            raise axis_error(1)
        return time_s

    def _halt(self, now_s: float, deceleration_deg_s2: float) -> None:
        self._limit_ahead = None
        if self._axis.is_moving(now_s):
            self._axis.stop(now_s, deceleration_deg_s2=deceleration_deg_s2)
        if self._homing_end_s is not None:
            self._homing_end_s = None
            self._faults.append((20, now_s))

    def _require_ready(self) -> None:
        if self._homing_end_s is not None:
            raise axis_error(30)
        if not self.powered:
            raise axis_error(13)

    def _go(self, target_deg: float, now_s: float, *, velocity_deg_s: float, limit_ahead: int | None = None) -> None:
        """Move to a position of the stage, or as far towards it as the limit switches allow."""
        if abs(target_deg) > _HARDWARE_LIMIT_DEG:
            limit_ahead = 4 if target_deg > 0 else 5
            target_deg = math.copysign(_HARDWARE_LIMIT_DEG, target_deg)
        self._limit_ahead = limit_ahead
        self._axis.move(
            target_deg,
            now_s,
            velocity_deg_s=velocity_deg_s,
            acceleration_deg_s2=self._settings["AC"],
            deceleration_deg_s2=self._settings["AG"],
        )

    def _move_to(self, position_deg: float, now_s: float) -> None:
        self._require_ready()
        if position_deg > self._settings["SR"]:
            raise axis_error(6)
        if position_deg < self._settings["SL"]:
            raise axis_error(7)
        self._go(position_deg + self._zero_deg, now_s, velocity_deg_s=self._settings["VA"])

    def _move_absolute(self, _: str, parameter: str, now_s: float) -> str | None:
        if parameter == "?":
            return self._settings.text(self._axis.target_deg - self._zero_deg)
        self._move_to(to_number(parameter) * self._settings.deg_per_unit, now_s)
        return None

    def _move_relative(self, _: str, parameter: str, now_s: float) -> None:
        way_deg = to_number(parameter) * self._settings.deg_per_unit
        self._move_to(self._axis.target_deg - self._zero_deg + way_deg, now_s)

    def _move_indefinitely(self, mnemonic: str, parameter: str, now_s: float) -> None:
        """MV runs until the software limit, MT until the limit switch."""
        if parameter not in ("+", "-"):
            raise Esp301Error(7 if parameter else 38)
        self._require_ready()
        forward = parameter == "+"
        if mnemonic == "MT":
            target_deg, limit = math.copysign(_HARDWARE_LIMIT_DEG, 1 if forward else -1), 4 if forward else 5
        else:
            target_deg, limit = self._settings["SR" if forward else "SL"] + self._zero_deg, 6 if forward else 7
        self._go(target_deg, now_s, velocity_deg_s=self._settings["VA"], limit_ahead=limit)

    def _home(self, _: str, parameter: str, now_s: float) -> None:
        mode = to_choice(parameter, range(7)) if parameter else self._home_mode
        if self._homing_end_s is not None:
            raise axis_error(30)
        if not self.powered:
            raise axis_error(20)
        target_deg = self._zero_deg if mode == 0 else 0.0
        if mode >= 3:
            target_deg = _HARDWARE_LIMIT_DEG if mode in (3, 5) else -_HARDWARE_LIMIT_DEG
        self._go(target_deg, now_s, velocity_deg_s=self._settings["OH"])
        self._zero_after_homing = mode != 0
        self._homing_end_s = self._axis.end_s + _INDEX_SEARCH_S

    def _home_mode_setting(self, _: str, parameter: str, now_s: float) -> str | None:
        if parameter == "?":
            return str(self._home_mode)
        self._home_mode = to_choice(parameter, range(7))
        return None

    def _motor(self, mnemonic: str, parameter: str, now_s: float) -> str | None:
        if parameter == "?":
            return str(int(self.powered))
        if parameter:
            raise Esp301Error(7)
        if mnemonic == "MO":
            self.powered = True
        else:
            self.power_off(now_s)
        return None

    def _define_position(self, _: str, parameter: str, now_s: float) -> None:
        if self._homing_end_s is not None:
            raise axis_error(30)
        position = to_number(parameter) if parameter else 0.0
        self._zero_deg = self._axis.position_deg(now_s) - position * self._settings.deg_per_unit

    def _is_done(self, _: str, parameter: str, now_s: float) -> str:
        require_query(parameter)
        return str(int(not self.is_busy(now_s)))

    def _position(self, _: str, parameter: str, now_s: float) -> str:
        require_query(parameter or "?")
        step_deg = self._axis.step_deg
        return self._settings.text(round((self._axis.position_deg(now_s) - self._zero_deg) / step_deg) * step_deg)

    def _desired_position(self, _: str, parameter: str, now_s: float) -> str:
        require_query(parameter)
        return self._settings.text(self._axis.position_deg(now_s) - self._zero_deg)

    def _velocity(self, _: str, parameter: str, now_s: float) -> str:
        require_query(parameter or "?")
        return self._settings.text(self._axis.velocity_deg_s(now_s))

    def _stage(self, _: str, parameter: str, now_s: float) -> str:
        require_query(parameter)
        return _STAGE

    def _motor_type(self, _: str, parameter: str, now_s: float) -> str:
        require_query(parameter)
        return "1"

    def _resolution(self, _: str, parameter: str, now_s: float) -> str:
        require_query(parameter)
        return f"{self._axis.step_deg / self._settings.deg_per_unit:.7g}"

    def _unit_setting(self, mnemonic: str, parameter: str, now_s: float) -> str | None:
        return self._settings.unit(mnemonic, parameter, now_s)

    def _setting(self, mnemonic: str, parameter: str, now_s: float) -> str | None:
        return self._settings.setting(mnemonic, parameter, now_s)

    COMMANDS: ClassVar[dict[str, Callable[[Esp301Axis, str, str, float], str | None]]] = {
        "PA": _move_absolute,
        "PR": _move_relative,
        "MV": _move_indefinitely,
        "MT": _move_indefinitely,
        "OR": _home,
        "OM": _home_mode_setting,
        "MO": _motor,
        "MF": _motor,
        "DH": _define_position,
        "MD": _is_done,
        "TP": _position,
        "DP": _desired_position,
        "TV": _velocity,
        "ID": _stage,
        "QM": _motor_type,
        "SU": _resolution,
        "SN": _unit_setting,
        **dict.fromkeys(DEFAULTS, _setting),
    }
