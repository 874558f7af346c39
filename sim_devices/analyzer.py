"""Analyzers of the simulated bench: what is in the beam at a time, as a row of a Mueller matrix."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from sim_devices.axis import AngleOfTime
from sim_devices.wheel import Wheel

Row = NDArray[np.float64]


class Analyzer(Protocol):
    """What stands before the detector."""

    def row(self, time_s: float) -> Row | None:
        """First row of its Mueller matrix; None while it lets no light through."""
        ...

    def polarizer_deg(self, time_s: float) -> float | None:
        """Where its polarizer stands, which a camera sees when it is no plane plate; None where there is none."""
        ...


class WheelAnalyzer:
    """A wheel whose slots hold polarizers, nothing, or a lid.

    Parameters
    ----------
    slots : mapping of int to float or str
        A polarizer's angle from s in degrees, "open" or "blocked", by slot.
    turns : int
        How often the wheel has turned before.

    Attributes
    ----------
    wheel : Wheel
        What turns.
    rows : dict of int to ndarray or None
        What each slot holds, as `row` has it.
    """

    def __init__(self, slots: Mapping[int, float | Literal["open", "blocked"]], turns: int = 0) -> None:
        self.wheel, self._slots = Wheel(turns), slots
        self.rows = {slot: analyzer_row(holds) for slot, holds in slots.items()}

    def row(self, time_s: float) -> Row | None:
        """The row of the slot in the beam; None while the wheel turns."""
        return self.rows.get(self.wheel.slot(time_s) or 0)

    def polarizer_deg(self, time_s: float) -> float | None:
        """Where the polarizer in the beam stands; None where there is none."""
        held = self._slots.get(self.wheel.slot(time_s) or 0)
        return None if isinstance(held, str) else held


class RotatingPolarizer:
    """A polarizer, perhaps behind a retarder, on rotators or fixed.

    Parameters
    ----------
    polarizer_deg : callable
        Where the polarizer stands at a time, in degrees; at 0 it passes s.
    retarder_deg : callable, optional
        Where the fast axis of the retarder stands; without it there is none.
    retardance_deg : float
        By how much the slow axis comes behind the fast one, in degrees.
    """

    def __init__(
        self, polarizer_deg: AngleOfTime, retarder_deg: AngleOfTime | None = None, retardance_deg: float = 90.0
    ) -> None:
        self._polarizer_deg, self._retarder_deg, self._retardance_deg = polarizer_deg, retarder_deg, retardance_deg

    def row(self, time_s: float) -> Row | None:
        """The row of the polarizer, and of the retarder before it, where they are."""
        row = analyzer_row(self._polarizer_deg(time_s))
        if row is None or self._retarder_deg is None:
            return row
        return behind_retarder(row, self._retarder_deg(time_s), self._retardance_deg)

    def polarizer_deg(self, time_s: float) -> float | None:
        """Where the polarizer stands."""
        return self._polarizer_deg(time_s)


def analyzer_row(slot: float | Literal["open", "blocked"]) -> Row | None:
    """First row of the Mueller matrix of a slot: open, a polarizer (angle in degrees), or None for a lid."""
    if slot == "blocked":
        return None
    if slot == "open":
        return np.array([1.0, 0.0, 0.0, 0.0])
    twice_rad = 2 * math.radians(slot)
    return 0.5 * np.array([1.0, math.cos(twice_rad), math.sin(twice_rad), 0.0])


def behind_retarder(row: Row, angle_deg: float, retardance_deg: float) -> Row:
    """First row of the Mueller matrix of an element behind a retarder whose fast axis stands at `angle_deg`.

    In the retarder's own frame, Ex Ey* = (S2 + i S3)/2 is turned by the phase by which Ey comes behind Ex.
    """
    i, one, two, three = turned(row, -angle_deg)
    phase = math.radians(retardance_deg)
    cos, sin = math.cos(phase), math.sin(phase)
    return turned(np.array([i, one, two * cos - three * sin, two * sin + three * cos]), angle_deg)


def turned(row: Row, angle_deg: float) -> Row:
    """First row of the Mueller matrix of an element that is turned by `angle_deg` from s towards p."""
    twice_rad = 2 * math.radians(angle_deg)
    cos, sin = math.cos(twice_rad), math.sin(twice_rad)
    return np.array([row[0], row[1] * cos - row[2] * sin, row[1] * sin + row[2] * cos, row[3]])
