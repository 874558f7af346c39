"""The row of an analyzer that turns during the exposure: the mean of its rows, in closed form."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray


def swept_row(
    polarizer_deg: float,
    polarizer_sweep_deg: float,
    retarder_deg: float,
    retarder_sweep_deg: float,
    retardance_deg: float,
) -> NDArray[np.float64]:
    """The mean row (4,) of a polarizer at psi behind a retarder delta at beta, both of which turn evenly.

    The row is ½ [1, C cos 2psi + D cos(2psi - 4beta), C sin 2psi - D sin(2psi - 4beta), sin delta sin(2psi - 2beta)]
    with C = (1 + cos delta)/2 and D = (1 - cos delta)/2. Each term is a wave of one phase, whose mean over an exposure
    is the wave at its middle, times sin(x)/x with x half of what the phase goes through.

    Parameters
    ----------
    polarizer_deg, retarder_deg : float
        Angles in the middle of the exposure, in degrees.
    polarizer_sweep_deg, retarder_sweep_deg : float
        How far each turns during the exposure, with its sign, in degrees.
    retardance_deg : float
        0 for a polarizer alone.
    """
    psi, beta, delta = (math.radians(angle_deg) for angle_deg in (polarizer_deg, retarder_deg, retardance_deg))
    along, across = (1 + math.cos(delta)) / 2, (1 - math.cos(delta)) / 2
    second = along * _mean_of_wave(polarizer_sweep_deg)
    fourth = across * _mean_of_wave(polarizer_sweep_deg - 2 * retarder_sweep_deg)
    circular = math.sin(delta) * _mean_of_wave(polarizer_sweep_deg - retarder_sweep_deg)
    turned = 2 * psi - 4 * beta
    return 0.5 * np.array(
        [
            1.0,
            second * math.cos(2 * psi) + fourth * math.cos(turned),
            second * math.sin(2 * psi) - fourth * math.sin(turned),
            circular * math.sin(2 * psi - 2 * beta),
        ]
    )


def _mean_of_wave(half_phase_deg: float) -> float:
    """What is left of a wave that is averaged over a phase of this to either side."""
    return float(np.sinc(half_phase_deg / 180.0))
