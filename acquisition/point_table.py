"""Directions as a table of text: a header with the names of the angles, and a direction a line."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from acquisition.exit_angles import MAX_DIRECTIONS, WIDEST_EXIT_DEG

NAMES = ("incidence_deg", "exit_deg", "azimuth_deg", "exit_azimuth_deg")
"""The columns; the last two may be left out, and then are 0."""

_ALLOWED = {
    "incidence_deg": (0.0, 89.0),
    "exit_deg": (-WIDEST_EXIT_DEG, WIDEST_EXIT_DEG),
    "azimuth_deg": (-360, 360),
    "exit_azimuth_deg": (-360, 360),
}
_HEADER = ",".join(NAMES[:3])
_MOST_FAULTS = 20
"""Faults that are listed; behind so many, more tell nothing new."""

LineFault = tuple[int, str]
"""A line of a table, counted from 1, and what is wrong in it."""


@dataclass(frozen=True, eq=False)
class PointTable:
    """The directions (N, 4) of a table in degrees, in the order of `NAMES`, and what is wrong with it."""

    angles_deg: NDArray[np.float64]
    faults: tuple[LineFault, ...]


@lru_cache(maxsize=4)
def point_table(text: str) -> PointTable:
    """Read directions out of the text of a table: comma-separated values below their names.

    Lines that are empty or begin with ``#`` are passed over.

    Parameters
    ----------
    text : str
        ``incidence_deg,exit_deg,azimuth_deg,exit_azimuth_deg``, in any order, and a direction a line; angles in
        degrees.
    """
    lines = [
        (number, stripped)
        for number, line in enumerate(text.splitlines(), start=1)
        if (stripped := line.strip()) and not stripped.startswith("#")
    ]
    if not lines:
        return PointTable(np.empty((0, 4)), ((1, f"holds no table. Begin it with the line '{_HEADER}'"),))
    header_line, header = lines[0]
    names = [name.strip() for name in header.split(",")]
    if faults := tuple((header_line, what) for what in _header_faults(names)):
        return PointTable(np.empty((0, 4)), faults)
    rows, found = [], _Faults()
    for number, line in lines[1:]:
        row = _row(line, names)
        if isinstance(row, str):
            found.add(number, row)
        else:
            rows.append(row)
    if not rows and not found.faults:
        found.add(header_line, "no direction follows. Write one a line below the names")
    if len(rows) > MAX_DIRECTIONS:
        found.add(lines[-1][0], f"is direction {len(rows)}; allowed: at most {MAX_DIRECTIONS}")
    columns = [names.index(name) if name in names else None for name in NAMES]
    table = np.array(rows, np.float64).reshape(len(rows), len(names))
    angles_deg = np.zeros((len(rows), len(NAMES)))
    for place, column in enumerate(columns):
        if column is not None:
            angles_deg[:, place] = table[:, column]
    return PointTable(angles_deg, tuple(found.faults))


class _Faults:
    """The first faults, and how many more there are."""

    def __init__(self) -> None:
        self.faults: list[LineFault] = []

    def add(self, line: int, what: str) -> None:
        if len(self.faults) < _MOST_FAULTS:
            self.faults.append((line, what))
        elif len(self.faults) == _MOST_FAULTS:
            self.faults.append((line, "and further lines are at fault, which are not listed"))


def _header_faults(names: list[str]) -> Iterator[str]:
    if names[0] and all(_is_number(name) for name in names):
        yield f"the names of the columns are missing. Put the line '{_HEADER}' above"
        return
    for name in dict.fromkeys(names):
        if name not in NAMES:
            yield f"column {name!r} is not known; allowed: {', '.join(NAMES)}"
        elif names.count(name) > 1:
            yield f"column {name!r} stands {names.count(name)} times. Leave it once"
    for name in NAMES[:2]:
        if name not in names:
            yield f"there is no column {name!r}. Add it"


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return "_" not in text  # which Python reads over


def _row(line: str, names: list[str]) -> list[float] | str:
    """The numbers of a line, or what is wrong with it."""
    cells = line.split(",")
    if len(cells) != len(names):
        return f"has {len(cells)} values for {len(names)} columns"
    for name, cell in zip(names, cells, strict=True):
        if not _is_number(cell):
            return f"{name} is {cell.strip()!r}; allowed: a number, with a point and without a unit"
    row = [float(cell) for cell in cells]
    for name, angle in zip(names, row, strict=True):
        low, high = _ALLOWED[name]
        if not low <= angle <= high or math.isnan(angle):
            return f"{name} is {angle:g}; allowed: {low:g} to {high:g}"
    return row
