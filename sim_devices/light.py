"""What a simulated detector sees of the world."""

from __future__ import annotations

from typing import Protocol


class Light(Protocol):
    """The light at the detector, as a function of time."""

    def power_w(self, time_s: float) -> float:
        """Power at `time_s`, before any effect of the detector."""
        ...

    def measure_w(self, time_s: float, exposure_s: float) -> float:
        """One measurement that begins at `time_s`, through the detector's effects; infinite when it is saturated."""
        ...
