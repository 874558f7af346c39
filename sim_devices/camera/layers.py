"""What lies on a plate, layer upon layer, each of one ink or of cells of several."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
Inks = NDArray[np.int16]
Mask = NDArray[np.bool_]

NOTHING = -1
"""The ink of places where a layer has none, so that the layers below it show."""


class Boxes(NamedTuple):
    """Rectangles on the plate in mm, (N,) each.

    Those that reach the horizon are infinite, and those past it NaN.
    """

    left: FloatArray
    right: FloatArray
    bottom: FloatArray
    top: FloatArray

    def some(self, which: NDArray[np.intp]) -> Boxes:
        """Some of them."""
        return Boxes(*(edge[which] for edge in self))

    def middles(self) -> tuple[FloatArray, FloatArray]:
        """Their middles' x and y."""
        return (self.left + self.right) / 2, (self.bottom + self.top) / 2

    def over(self, left: float, right: float, bottom: float, top: float) -> Mask:
        """Which have a part of a rectangle in them."""
        return (self.right > left) & (self.left < right) & (self.top > bottom) & (self.bottom < top)

    def inside(self, left: float, right: float, bottom: float, top: float) -> Mask:
        """Which lie wholly in a rectangle."""
        return (self.left >= left) & (self.right <= right) & (self.bottom >= bottom) & (self.top <= top)

    def farthest(self, x_mm: float, y_mm: float) -> FloatArray:
        """How far from a point a box reaches."""
        return np.hypot(
            np.maximum(x_mm - self.left, self.right - x_mm), np.maximum(y_mm - self.bottom, self.top - y_mm)
        )

    def nearest(self, x_mm: float, y_mm: float) -> FloatArray:
        """How near to a point a box comes; 0 if the point is in it."""
        across = np.maximum(np.maximum(self.left - x_mm, x_mm - self.right), 0.0)
        return np.hypot(across, np.maximum(np.maximum(self.bottom - y_mm, y_mm - self.top), 0.0))


class Layer(Protocol):
    """Something that lies on the plate."""

    def over(self, boxes: Boxes) -> tuple[Mask, Mask]:
        """Which boxes it has a part in, and which of these it fills with one ink; rather too few of the latter."""

    def ink_at(self, x_mm: FloatArray, y_mm: FloatArray) -> Inks:
        """Its ink at points, or NOTHING."""


@dataclass(frozen=True)
class Disk:
    """A disk of one ink."""

    x_mm: float
    y_mm: float
    radius_mm: float
    ink: int

    def over(self, boxes: Boxes) -> tuple[Mask, Mask]:
        """See `Layer`."""
        return (
            boxes.nearest(self.x_mm, self.y_mm) < self.radius_mm,
            boxes.farthest(self.x_mm, self.y_mm) <= self.radius_mm,
        )

    def ink_at(self, x_mm: FloatArray, y_mm: FloatArray) -> Inks:
        """See `Layer`."""
        return np.where(np.hypot(x_mm - self.x_mm, y_mm - self.y_mm) < self.radius_mm, self.ink, NOTHING).astype(
            np.int16
        )


@dataclass(frozen=True)
class Surroundings:
    """All that lies outside a rectangle."""

    left_mm: float
    right_mm: float
    bottom_mm: float
    top_mm: float
    ink: int

    def over(self, boxes: Boxes) -> tuple[Mask, Mask]:
        """See `Layer`."""
        edges = self.left_mm, self.right_mm, self.bottom_mm, self.top_mm
        return ~boxes.inside(*edges), ~boxes.over(*edges)

    def ink_at(self, x_mm: FloatArray, y_mm: FloatArray) -> Inks:
        """See `Layer`; a point past the horizon, whose coordinates are NaN, is outside."""
        inside = (x_mm >= self.left_mm) & (x_mm <= self.right_mm) & (y_mm >= self.bottom_mm) & (y_mm <= self.top_mm)
        return np.where(inside, NOTHING, self.ink).astype(np.int16)


@dataclass(frozen=True, eq=False)
class Cells:
    """A rectangle divided into cells, each of one ink.

    Parameters
    ----------
    inks : ndarray of int16
        (rows, columns), the upper row first.
    left_mm, top_mm : float
        Its upper left corner.
    width_mm, height_mm : float
        Of the whole.
    """

    inks: Inks
    left_mm: float
    top_mm: float
    width_mm: float
    height_mm: float

    @classmethod
    def rectangle(cls, left_mm: float, bottom_mm: float, right_mm: float, top_mm: float, ink: int) -> Cells:
        """A rectangle of one ink."""
        return cls(np.array([[ink]], np.int16), left_mm, top_mm, right_mm - left_mm, top_mm - bottom_mm)

    def over(self, boxes: Boxes) -> tuple[Mask, Mask]:
        """See `Layer`."""
        edges = self.left_mm, self.left_mm + self.width_mm, self.top_mm - self.height_mm, self.top_mm
        touched, filled = boxes.over(*edges), boxes.inside(*edges)
        which = np.flatnonzero(filled)
        first_row, last_row, first_column, last_column = self.cells(boxes.some(which))
        changes_right, changes_down = self._changes
        filled[which] = (
            sums(changes_right, first_row, last_row + 1, first_column, last_column)
            + sums(changes_down, first_row, last_row, first_column, last_column + 1)
        ) == 0
        return touched, filled

    def cells(self, boxes: Boxes) -> tuple[NDArray[np.intp], ...]:
        """First and last row and first and last column of the cells that boxes within it touch."""
        rows, columns = self.inks.shape
        down, right = rows / self.height_mm, columns / self.width_mm
        return (
            _cell((self.top_mm - boxes.top) * down, rows),
            _cell((self.top_mm - boxes.bottom) * down, rows),
            _cell((boxes.left - self.left_mm) * right, columns),
            _cell((boxes.right - self.left_mm) * right, columns),
        )

    def ink_at(self, x_mm: FloatArray, y_mm: FloatArray) -> Inks:
        """See `Layer`."""
        rows, columns = self.inks.shape
        right, down = (x_mm - self.left_mm) / self.width_mm, (self.top_mm - y_mm) / self.height_mm
        inside = (right >= 0.0) & (right < 1.0) & (down >= 0.0) & (down < 1.0)
        found = np.full(x_mm.shape, NOTHING, np.int16)
        found[inside] = self.inks[_cell(down[inside] * rows, rows), _cell(right[inside] * columns, columns)]
        return found

    @cached_property
    def _changes(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """How many cells differ from the next one, to the right and below, summed over all that lie above and left."""
        return tuple(summed(np.diff(self.inks, axis=axis) != 0) for axis in (1, 0))  # type: ignore[return-value]


def summed(values: NDArray[np.generic]) -> FloatArray:
    """Sums of an image over the rectangles from its upper left corner, (rows + 1, columns + 1)."""
    return np.pad(np.asarray(values, np.float64).cumsum(0).cumsum(1), ((1, 0), (1, 0)))


def sums(
    table: FloatArray,
    top: NDArray[np.intp],
    bottom: NDArray[np.intp],
    left: NDArray[np.intp],
    right: NDArray[np.intp],
) -> FloatArray:
    """Sums of an image over rectangles, from the table that `summed` makes; the last row and column do not count."""
    return np.asarray(table[bottom, right] - table[top, right] - table[bottom, left] + table[top, left])


def _cell(position: FloatArray, count: int) -> NDArray[np.intp]:
    return np.clip(np.floor(position), 0, count - 1).astype(np.intp)
