"""What turns the lamp's light into light of a known polarization, before it falls on the sample."""

from __future__ import annotations

import math

import numpy as np

from sim_devices.axis import AngleOfTime
from sim_devices.effects.measurement import Stokes


class RotatingGenerator:
    """A polarizer, perhaps before a retarder, on rotators or fixed.

    Parameters
    ----------
    polarizer_deg : callable
        Where the polarizer stands at a time, in degrees; at 0 it passes s.
    retarder_deg : callable, optional
        Where the fast axis of the retarder behind it stands; without it there is none.
    retardance_deg : float
        By how much the slow axis comes behind the fast one, in degrees.
    """

    def __init__(
        self, polarizer_deg: AngleOfTime, retarder_deg: AngleOfTime | None = None, retardance_deg: float = 90.0
    ) -> None:
        self._polarizer_deg, self._retarder_deg, self._retardance_deg = polarizer_deg, retarder_deg, retardance_deg

    def stokes(self, time_s: float, lamp: Stokes) -> Stokes:
        """Light (4,) of the lamp behind it; of an unpolarized lamp as bright, and of another on the average of a turn.

        The polarizer leaves a field along its direction. In the retarder's axes, turned there by -beta, the component
        along the slow one falls behind by the retardance: S2 + i S3 = 2 Ex Ey* is multiplied by exp(-i delta), for
        Ey* loses what Ey gains, exp(i delta), in time that runs as exp(-i omega t).
        """
        psi = math.radians(self._polarizer_deg(time_s))
        passed = float(lamp[0] + math.cos(2 * psi) * lamp[1] + math.sin(2 * psi) * lamp[2])
        if self._retarder_deg is None:
            return passed * np.array([1.0, math.cos(2 * psi), math.sin(2 * psi), 0.0])
        beta, delta = math.radians(self._retarder_deg(time_s)), math.radians(self._retardance_deg)
        along, across = math.cos(psi - beta), math.sin(psi - beta)
        s1, mixed = along**2 - across**2, 2 * along * across * np.exp(-1j * delta)
        linear = (s1 + 1j * mixed.real) * np.exp(2j * beta)
        return passed * np.array([1.0, linear.real, linear.imag, mixed.imag])
