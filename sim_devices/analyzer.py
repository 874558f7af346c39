"""Analyzers of the simulated bench: what is in the beam at a time, as a row of a Mueller matrix."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from sim_devices.axis import Axis
from sim_devices.wheel import Wheel

Row = NDArray[np.float64]


class Analyzer(Protocol):
    """What stands before the detector."""

    def row(self, time_s: float) -> Row | None:
        """First row of its Mueller matrix; None while it lets no light through."""
        ...


class WheelAnalyzer:
    """A wheel whose slots hold polarizers, nothing, or a lid.

    Parameters
    ----------
    slots : mapping of int to float or str
        A polarizer's angle from s in degrees, "open" or "blocked", by slot.

    Attributes
    ----------
    wheel : Wheel
        What turns.
    rows : dict of int to ndarray or None
        What each slot holds, as `row` has it.
    """

    def __init__(self, slots: Mapping[int, float | Literal["open", "blocked"]]) -> None:
        self.wheel = Wheel()
        self.rows = {slot: analyzer_row(holds) for slot, holds in slots.items()}

    def row(self, time_s: float) -> Row | None:
        """The row of the slot in the beam; None while the wheel turns."""
        return self.rows.get(self.wheel.slot(time_s) or 0)


class RotatingPolarizer:
    """A polarizer on a rotator; at 0 deg of the axis it passes s."""

    def __init__(self, axis: Axis) -> None:
        self.axis = axis

    def row(self, time_s: float) -> Row | None:
        """The row of the polarizer where it is."""
        return analyzer_row(self.axis.motor_deg(time_s))


def analyzer_row(slot: float | Literal["open", "blocked"]) -> Row | None:
    """First row of the Mueller matrix of a slot: open, a polarizer (angle in degrees), or None for a lid."""
    if slot == "blocked":
        return None
    if slot == "open":
        return np.array([1.0, 0.0, 0.0, 0.0])
    twice_rad = 2 * math.radians(slot)
    return 0.5 * np.array([1.0, math.cos(twice_rad), math.sin(twice_rad), 0.0])


def turned(row: Row, angle_deg: float) -> Row:
    """First row of the Mueller matrix of an element that is turned by `angle_deg` from s towards p."""
    twice_rad = 2 * math.radians(angle_deg)
    cos, sin = math.cos(twice_rad), math.sin(twice_rad)
    return np.array([row[0], row[1] * cos - row[2] * sin, row[1] * sin + row[2] * cos, row[3]])
