"""The settings of an SR830, as data: what each command may set, and what it sets at first."""

from __future__ import annotations

from dataclasses import dataclass

from sim_devices.stanford_sr830.parameters import require

# 2, 5, 10 nV ... 1 V, and 10, 30, 100 us ... 30 ks
SENSITIVITIES_V = tuple(float(f"{(1, 2, 5)[place % 3]}e{place // 3 - 9}") for place in range(1, 28))
TIME_CONSTANTS_S = tuple(float(f"{(1, 3)[place % 2]}e{place // 2 - 5}") for place in range(20))
# of the noise that a filter of 1 to 4 stages lets through: 1 / (2 bandwidth), in time constants
NOISE_EXPOSURES = (2.0, 4.0, 16 / 3, 32 / 5)


@dataclass(frozen=True)
class Setting:
    """A number between two limits, of which the device keeps multiples of `step`."""

    default: float
    low: float
    high: float
    step: float

    def take(self, value: float) -> float:
        """What the device makes of a value; refused when it is beyond the limits, or no whole number but a choice."""
        require(self.low <= value <= self.high and not (self.step == 1 and value % 1))
        return round(value / self.step) * self.step


def _choice(default: int, count: int) -> Setting:
    return Setting(default, 0, count - 1, 1)


SETTINGS = {
    "OUTX": _choice(0, 2),
    "PHAS": Setting(0.0, -360.0, 729.99, 0.01),
    "FREQ": Setting(1000.0, 0.001, 102_000.0, 1e-4),
    "SLVL": Setting(1.0, 0.004, 5.0, 0.002),
    "HARM": Setting(1, 1, 19_999, 1),
    "FMOD": _choice(1, 2),
    "RSLP": _choice(0, 3),
    "SENS": _choice(26, 27),
    "OFLT": _choice(8, 20),
    "OFSL": _choice(1, 4),
    "ISRC": _choice(0, 4),
    "IGND": _choice(0, 2),
    "ICPL": _choice(0, 2),
    "ILIN": _choice(0, 4),
    "RMOD": _choice(1, 3),
    "SYNC": _choice(0, 2),
}
AUX_OUTPUT = Setting(0.0, -10.5, 10.5, 0.001)


def wrapped_deg(angle_deg: float) -> float:
    """The same angle above -180 and up to 180 deg."""
    return 180.0 - (180.0 - angle_deg) % 360.0
