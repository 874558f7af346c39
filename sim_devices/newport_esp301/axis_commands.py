"""The commands of an ESP301 that are addressed to one axis."""

from __future__ import annotations

from collections.abc import Callable

from sim_devices.newport_esp301.axis import Esp301Axis
from sim_devices.newport_esp301.parameter import Esp301Error, require_query, to_choice, to_number
from sim_devices.newport_esp301.settings import DEFAULTS

AxisCommand = Callable[[Esp301Axis, str, str, float], str | None]


def _move_absolute(axis: Esp301Axis, _: str, parameter: str, now_s: float) -> str | None:
    if parameter == "?":
        return axis.settings.text(axis.target_deg)
    axis.move_to(to_number(parameter) * axis.settings.deg_per_unit, now_s)
    return None


def _move_relative(axis: Esp301Axis, _: str, parameter: str, now_s: float) -> None:
    axis.move_to(axis.target_deg + to_number(parameter) * axis.settings.deg_per_unit, now_s)


def _move_indefinitely(axis: Esp301Axis, mnemonic: str, parameter: str, now_s: float) -> None:
    if parameter not in ("+", "-"):
        raise Esp301Error(7 if parameter else 38)
    run = axis.run_to_switch if mnemonic == "MT" else axis.run
    run(1 if parameter == "+" else -1, now_s)


def _home(axis: Esp301Axis, _: str, parameter: str, now_s: float) -> None:
    axis.search_home(to_choice(parameter, range(7)) if parameter else axis.home_mode, now_s)


def _home_mode(axis: Esp301Axis, _: str, parameter: str, now_s: float) -> str | None:
    if parameter == "?":
        return str(axis.home_mode)
    axis.home_mode = to_choice(parameter, range(7))
    return None


def _motor(axis: Esp301Axis, mnemonic: str, parameter: str, now_s: float) -> str | None:
    if parameter == "?":
        return str(int(axis.powered))
    if parameter:
        raise Esp301Error(7)
    if mnemonic == "MO":
        axis.powered = True
    else:
        axis.power_off(now_s)
    return None


def _define_position(axis: Esp301Axis, _: str, parameter: str, now_s: float) -> None:
    axis.require_no_homing()
    position = to_number(parameter) if parameter else 0.0
    axis.define(position * axis.settings.deg_per_unit, now_s)


def _is_done(axis: Esp301Axis, _: str, parameter: str, now_s: float) -> str:
    require_query(parameter)
    return str(int(not axis.is_busy(now_s)))


def _position(axis: Esp301Axis, _: str, parameter: str, now_s: float) -> str:
    require_query(parameter or "?")
    return axis.settings.text(axis.encoder_deg(now_s))


def _desired_position(axis: Esp301Axis, _: str, parameter: str, now_s: float) -> str:
    require_query(parameter)
    return axis.settings.text(axis.desired_deg(now_s))


def _velocity(axis: Esp301Axis, _: str, parameter: str, now_s: float) -> str:
    require_query(parameter or "?")
    return axis.settings.text(axis.velocity_deg_s(now_s))


def _stage(axis: Esp301Axis, _: str, parameter: str, now_s: float) -> str:
    require_query(parameter)
    return f"{axis.stage.model}, SN1234"


def _motor_type(axis: Esp301Axis, _: str, parameter: str, now_s: float) -> str:
    require_query(parameter)
    return "1"


def _resolution(axis: Esp301Axis, _: str, parameter: str, now_s: float) -> str:
    require_query(parameter)
    return f"{axis.step_deg / axis.settings.deg_per_unit:.7g}"


def _unit(axis: Esp301Axis, mnemonic: str, parameter: str, now_s: float) -> str | None:
    return axis.settings.unit(mnemonic, parameter, now_s)


def _setting(axis: Esp301Axis, mnemonic: str, parameter: str, now_s: float) -> str | None:
    return axis.settings.setting(mnemonic, parameter, now_s)


# what runs a command, given the axis, the mnemonic, what follows it and the time; it returns the answer, if there is
# one, and raises Esp301Error when the command is refused, which changes nothing
AXIS_COMMANDS: dict[str, AxisCommand] = {
    "PA": _move_absolute,
    "PR": _move_relative,
    "MV": _move_indefinitely,
    "MT": _move_indefinitely,
    "OR": _home,
    "OM": _home_mode,
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
    "SN": _unit,
    **dict.fromkeys(DEFAULTS, _setting),
}
