"""An S120C photodiode head at its meter: ranges, over-range, and the zero that is taken in the dark."""

from __future__ import annotations

import math

from sim_devices.light import Light
from sim_devices.thorlabs_pm100.scpi import ScpiError
from sim_devices.timeline import Timeline

_ZERO_S = 2.001
RANGES_W = (5e-8, 5e-7, 5e-6, 5e-5, 5e-4, 5e-3, 5e-2)
OVER_RANGE = 9.9e37


class PhotodiodeHead:
    """A head that looks at a light; its range is chosen for it.

    Attributes
    ----------
    range_w : float or None
        Upper end of the range; None where it is chosen automatically.
    """

    def __init__(self, light: Light) -> None:
        self._light = light
        self._zero = Timeline(0.0)
        self._zero_end_s = -math.inf
        self.range_w: float | None = None

    def set_range(self, wanted_w: float) -> None:
        """The smallest range that holds a power."""
        self.range_w = _holding(wanted_w)

    def present_range_w(self, now_s: float) -> float:
        """The range in use."""
        return _holding(self._light.power_w(now_s)) if self.range_w is None else self.range_w

    def measure_w(self, now_s: float, exposure_s: float) -> float:
        """One measurement, no zero subtracted; OVER_RANGE when there is more light than range or detector take."""
        upper_w = RANGES_W[-1] if self.range_w is None else self.range_w
        if self._light.power_w(now_s + exposure_s / 2) > upper_w:
            return OVER_RANGE
        return min(self._light.measure_w(now_s, exposure_s), OVER_RANGE)

    def zero_w(self, now_s: float) -> float:
        """What is to be subtracted."""
        return self._zero.at(now_s)

    def collects_zero(self, now_s: float) -> bool:
        """Whether the collection of the zero is under way."""
        return now_s < self._zero_end_s

    def collect_zero(self, now_s: float) -> None:
        """Take what reaches the detector now for its dark signal, once the collection is over."""
        zero_w = self.measure_w(now_s, _ZERO_S)
        if zero_w == OVER_RANGE:
            raise ScpiError(-200)
        self._zero_end_s = now_s + _ZERO_S
        self._zero.add(self._zero_end_s, zero_w)

    def abort_zero(self, now_s: float) -> None:
        """Keep the zero as it is."""
        if self.collects_zero(now_s):
            self._zero_end_s = now_s
            self._zero.add(now_s, self._zero.at(now_s))


def _holding(power_w: float) -> float:
    return next(range_w for range_w in RANGES_W if range_w >= min(power_w, RANGES_W[-1]))
