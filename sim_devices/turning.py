"""What an analyzer passes that turns while the detector collects light."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from sim_devices.analyzer import Row
from sim_devices.axis import AngleOfTime
from sim_devices.effects.measurement import Moment

_PARTS = 0.5, 0.25, 0.75, 0.0, 1.0
"""Moments of an exposure at which it is looked whether something turns: who stands at all of them stands."""

_DEG_PER_NODE, _FEWEST = 15.0, 6
"""A wave of four times the angle is known to rounding errors from nodes so close together."""


class TurningRow:
    """Averages the row of an analyzer over an exposure; where nothing turns it is the row at its middle.

    It is the mean of the rows at Gauss-Legendre nodes, whatever the motion.

    Parameters
    ----------
    angles_deg : sequence of callable
        Where each element that can turn stands at a time.
    """

    def __init__(self, angles_deg: Sequence[AngleOfTime]) -> None:
        self._angles_deg = tuple(angles_deg)

    def __call__(self, row: Callable[[float], Row | None], moment: Moment) -> Row | None:
        """The mean of `row`, or None where no light is let through."""
        sweep_deg = self._sweep_deg(moment)
        if not sweep_deg:
            return row(moment.middle_s)
        nodes, weights = np.polynomial.legendre.leggauss(_FEWEST + math.ceil(sweep_deg / _DEG_PER_NODE))
        rows = [row(moment.middle_s + node * moment.exposure_s / 2) for node in nodes]
        passing = [(weight / 2, one) for weight, one in zip(weights, rows, strict=True) if one is not None]
        return sum((weight * one for weight, one in passing), np.zeros(4)) if passing else None

    def _sweep_deg(self, moment: Moment) -> float:
        times_s = [moment.middle_s + (part - 0.5) * moment.exposure_s for part in _PARTS]
        at_deg = [[angle_deg(time_s) for time_s in times_s] for angle_deg in self._angles_deg]
        return max((max(of_one) - min(of_one) for of_one in at_deg), default=0.0)
