"""The piezo motors of an Elliptec module: the periods that drive them, kept through power-off once saved."""

from __future__ import annotations

from sim_devices.thorlabs_elliptec.module import NOT_SUPPORTED, OUT_OF_RANGE, ElliptecError

_CURRENT, _RAMP = 0x0300, 0xFFFF
_FORWARD, _BACKWARD = 0x00B8, 0x008D
_IS_PERIOD = 0x8000


class ElliptecMotors:
    """Motors 1 to `count`, each with a period forwards and one backwards, in 1/14.74 us."""

    def __init__(self, count: int) -> None:
        self._saved = dict.fromkeys(range(1, count + 1), (_FORWARD, _BACKWARD))
        self.restore()

    def save(self) -> None:
        """Keep the periods."""
        self._saved = dict(self._periods)

    def restore(self) -> None:
        """Return to the periods that were kept."""
        self._periods = dict(self._saved)

    def require(self, motor: int) -> None:
        """Raise ElliptecError when there is no such motor."""
        if motor not in self._periods:
            raise ElliptecError(NOT_SUPPORTED)

    def describe(self, motor: int) -> str:
        """Loop and motor on, current, ramps up and down, periods forwards and backwards."""
        forward, backward = self._periods[motor]
        return f"11{_CURRENT:04X}{_RAMP:04X}{_RAMP:04X}{forward:04X}{backward:04X}"

    def set_period(self, motor: int, period: int, *, forward: bool) -> None:
        """Set a period; the highest bit, which says that it is one, may be missing."""
        period &= ~_IS_PERIOD
        if not period:
            raise ElliptecError(OUT_OF_RANGE)
        other_way = self._periods[motor][1 if forward else 0]
        self._periods[motor] = (period, other_way) if forward else (other_way, period)
