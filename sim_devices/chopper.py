"""A chopper before the lamp of the simulated bench, as the detector sees it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from sim_devices.effects.measurement import ExpectedMeasurement

if TYPE_CHECKING:
    from sim_devices.world import World

_DUTY = 0.5


class Chopper:
    """A chopper that is open half of the time; stray light does not go through it.

    Parameters
    ----------
    world : World
        The bench whose lamp is chopped. Its detector's effects act on what it sees at any time, open or closed.
    """

    def __init__(self, world: World) -> None:
        self._world = world

    def open_w(self, time_s: float, exposure_s: float) -> float:
        """Mean while the chopper is open, without noise; infinite when the detector is saturated."""
        return self._expected_w(time_s, exposure_s, 1.0)

    def closed_w(self, time_s: float, exposure_s: float) -> float:
        """Mean while the chopper is closed, without noise."""
        return self._expected_w(time_s, exposure_s, 0.0)

    def noise_w(self, time_s: float, exposure_s: float) -> float:
        """Noise of the mean over an exposure; that of counting photons is of the mean light. None beyond saturation."""
        noisy_w = self._world.signal_w(self._world.next_measurement(time_s, exposure_s, _DUTY))
        expected_w = self._expected_w(time_s, exposure_s, _DUTY)
        return noisy_w - expected_w if math.isfinite(noisy_w) and math.isfinite(expected_w) else 0.0

    def _expected_w(self, time_s: float, exposure_s: float, lit: float) -> float:
        return self._world.signal_w(ExpectedMeasurement(time_s + exposure_s / 2, exposure_s, lit))
