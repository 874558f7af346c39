"""A camera whose counts are not in proportion to the charge of its pixels, set right."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from goniometer.errors import ConfigurationError

Map = NDArray[np.float32]


class Linearity:
    """What counts would be if they were in proportion to the charge, from a table, straight between its rows.

    Converter and pixel bend the curve of the whole charge, that of the dark among it. So it is counts as read, black
    level and dark included, that are looked up; dark is subtracted afterwards, from dark frames that were looked up
    likewise.

    Parameters
    ----------
    table : sequence of tuple of float
        Rows of (counts read, true counts), both rising from row to row; from 0 counts read up to saturation.

    Raises
    ------
    ConfigurationError
        When it has less than two rows, begins above 0, or does not rise.
    """

    def __init__(self, table: Sequence[tuple[float, float]]) -> None:
        self.table = tuple((float(read), float(true)) for read, true in table)
        rows = np.array(self.table, np.float64).reshape(-1, 2)
        faults = [] if len(rows) > 1 else [f"linearity: {len(rows)} rows say nothing of a curve; give two or more."]
        if len(rows) and not rows[0, 0] <= 0.0:
            faults.append(f"linearity: begins at {rows[0, 0]:g} counts read; let it begin at 0.")
        falls = np.flatnonzero(~(np.diff(rows, axis=0) > 0.0).all(axis=1))
        for place in falls:
            faults.append(
                f"linearity: row {place + 2} {self.table[place + 1]} does not rise above row {place + 1} "
                f"{self.table[place]}; both columns must, or counts have no one meaning."
            )
        if faults:
            raise ConfigurationError(faults)

    @property
    def largest_counts(self) -> float:
        """Counts read up to which it goes."""
        return self.table[-1][0]

    @cached_property
    def _true(self) -> Map:
        read, true = np.array(self.table).T
        return np.asarray(np.interp(np.arange(1 << 16), read, true), np.float32)

    @cached_property
    def _slopes_squared(self) -> Map:
        return np.asarray(np.gradient(self._true) ** 2, np.float32)

    def true_counts(self, counts: NDArray[np.uint16]) -> Map:
        """True counts of counts read."""
        return np.asarray(self._true[counts])

    def true_level(self, counts: float) -> float:
        """True counts of a level that is a mean of counts read."""
        return float(np.interp(counts, *np.array(self.table).T))

    def slope_squared(self, counts: NDArray[np.uint16]) -> Map:
        """By how much the variance that the converter adds grows on the way."""
        return np.asarray(self._slopes_squared[counts])
