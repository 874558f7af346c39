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


class ChoppedLight(Protocol):
    """What a detector tells of light that a chopper lets through half of the time.

    Exposures begin at `time_s` and last over many turns of the chopper.
    """

    def open_w(self, time_s: float, exposure_s: float) -> float:
        """Mean while the chopper is open, without noise; infinite when the detector is saturated."""
        ...

    def closed_w(self, time_s: float, exposure_s: float) -> float:
        """Mean while the chopper is closed, without noise: the dark current, and light that is not the lamp's."""
        ...

    def noise_w(self, time_s: float, exposure_s: float) -> float:
        """Noise of the mean over an exposure, drawn anew each time."""
        ...
