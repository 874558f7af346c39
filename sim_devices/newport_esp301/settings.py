"""The settings of one ESP301 axis: speeds, accelerations, limits, and the unit they are told in."""

from __future__ import annotations

import math

from sim_devices.newport_esp301.parameter import axis_error, to_choice, to_number

_LARGEST_JERK = 1e5
_DEGREES = 7

# degrees, and their derivatives; the numbers of a URS stage
DEFAULTS = {
    "VU": 20.0,
    "AU": 320.0,
    "VA": 20.0,
    "AC": 80.0,
    "AG": 80.0,
    "AE": 320.0,
    "JK": 800.0,
    "OH": 5.0,
    "JH": 10.0,
    "JW": 2.0,
    "SL": -170.0,
    "SR": 170.0,
    "FE": 1.0,
}
# a setting that may not exceed another, and the error if it would
_CEILINGS = {
    "VA": ("VU", 10),
    "OH": ("VU", 10),
    "JH": ("VU", 10),
    "JW": ("VU", 10),
    "AC": ("AU", 11),
    "AG": ("AU", 11),
    "AE": ("AU", 11),
}
_SPEEDS = ("VU", "VA", "OH", "JH", "JW")


class Esp301Settings:
    """The settings as they are after power-on, in degrees whatever the unit is.

    Parameters
    ----------
    step_deg : float
        One encoder count.
    top_deg_s : float
        How fast the stage turns at most.
    """

    def __init__(self, step_deg: float, top_deg_s: float) -> None:
        slower = {name: min(DEFAULTS[name], top_deg_s) for name in _SPEEDS}
        self._values_deg = {**DEFAULTS, **slower, "VU": top_deg_s}
        self._unit = _DEGREES
        # a rotation stage has no unit of length
        self._units_deg = {
            0: step_deg,
            1: step_deg,
            _DEGREES: 1.0,
            8: 0.9,
            9: math.degrees(1),
            10: math.degrees(1e-3),
            11: math.degrees(1e-6),
        }

    def __getitem__(self, mnemonic: str) -> float:
        """A setting in degrees."""
        return self._values_deg[mnemonic]

    @property
    def deg_per_unit(self) -> float:
        """One unit."""
        return self._units_deg[self._unit]

    def text(self, degrees: float) -> str:
        """Degrees as the controller tells them, in its unit."""
        return f"{round(degrees / self.deg_per_unit, 6) + 0.0:.6f}"

    def unit(self, _: str, parameter: str, now_s: float) -> str | None:
        """Run SN."""
        if parameter == "?":
            return str(self._unit)
        unit = to_choice(parameter, range(12))
        if unit not in self._units_deg:
            raise axis_error(1)
        self._unit = unit
        return None

    def setting(self, mnemonic: str, parameter: str, now_s: float) -> str | None:
        """Run a command that tells or changes a setting."""
        if parameter == "?":
            return self.text(self[mnemonic])
        value_deg = to_number(parameter) * self.deg_per_unit
        if mnemonic in _CEILINGS:
            ceiling, error = _CEILINGS[mnemonic]
            # one part in 1e12 for what a change of unit and back does to a number
            if value_deg > self[ceiling] * (1 + 1e-12):
                raise axis_error(error)
        if mnemonic == "JK" and value_deg > _LARGEST_JERK:
            raise axis_error(15)
        if mnemonic not in ("SL", "SR") and value_deg <= 0:
            raise axis_error(24 if mnemonic in _SPEEDS else 1)
        if (mnemonic == "SL" and value_deg > self["SR"]) or (mnemonic == "SR" and value_deg < self["SL"]):
            raise axis_error(1)
        self._values_deg[mnemonic] = value_deg
        return None
