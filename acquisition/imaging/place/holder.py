"""The sample holder: which markers it bears, and where."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import combinations
from typing import Annotated, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, field_validator, model_validator

from acquisition.section import Section, SectionFault, refuse_all

FEWEST_MARKERS = 2
"""Fewer do not show that one of them was misread."""

_IDS = {
    **{f"DICT_{bits}X{bits}_{count}": count for bits in (4, 5, 6, 7) for count in (50, 100, 250, 1000)},
    "DICT_ARUCO_ORIGINAL": 1024,
    "DICT_APRILTAG_16h5": 30,
    "DICT_APRILTAG_25h9": 35,
    "DICT_APRILTAG_36h10": 2320,
    "DICT_APRILTAG_36h11": 587,
}
_SQUARE = np.array([[-0.5, 0.5], [0.5, 0.5], [0.5, -0.5], [-0.5, -0.5]])

Size = Annotated[float, Field(gt=0.0)]
Place = Annotated[tuple[float, float], Field(strict=False)]


@dataclass(frozen=True)
class Board:
    """A ChArUco board: a chessboard with markers 0, 1, 2 … in its white squares, as OpenCV draws it.

    Parameters
    ----------
    columns, rows : int
        How many squares there are.
    square_mm, marker_mm : float
        Their sides and those of the markers in them.
    left_mm, bottom_mm : float
        Its lower left corner on the plate.
    """

    columns: int
    rows: int
    square_mm: float
    marker_mm: float
    left_mm: float
    bottom_mm: float

    @property
    def markers(self) -> int:
        """How many it bears."""
        return self.columns * self.rows // 2

    def corner_mm(self, number: int) -> tuple[float, float]:
        """A corner between four squares, counted from the upper left one, row by row."""
        row, column = divmod(number, self.columns - 1)
        return self.left_mm + (column + 1) * self.square_mm, self.bottom_mm + (self.rows - 1 - row) * self.square_mm


@dataclass(frozen=True)
class Holder:
    """ArUco markers in the plane of the sample, upright along the plate's y.

    Parameters
    ----------
    dictionary : str
        OpenCV's name of the set that they are from.
    marker_mm : float
        Side of a marker's black square.
    centres_mm : mapping
        Of every single marker by its number, (x, y) on the plate.
    board : Board, optional
        One beside or instead of them.
    """

    dictionary: str
    marker_mm: float
    centres_mm: Mapping[int, tuple[float, float]] = field(default_factory=dict)
    board: Board | None = None

    def corners_mm(self, marker: int) -> NDArray[np.float64]:
        """(4, 2): of a single marker's black square, clockwise from the upper left one."""
        return np.asarray(np.array(self.centres_mm[marker]) + self.marker_mm * _SQUARE)


class BoardEntry(Section):
    """A ChArUco board on the holder."""

    columns: int = Field(ge=3, description="squares from left to right")
    rows: int = Field(ge=3, description="squares from top to bottom")
    square_mm: Size = Field(description="side of a square")
    marker_mm: Size = Field(description="side of a marker's black square")
    corner_mm: Place = Field(description="x and y of the board's lower left corner on the plate")

    @model_validator(mode="after")
    def _check_marker(self) -> Self:
        if self.marker_mm >= self.square_mm:
            refuse_all(
                [
                    (
                        ("marker_mm",),
                        f"{self.marker_mm:g} does not fit into squares of {self.square_mm:g} mm; measure both",
                    )
                ]
            )
        return self


class HolderEntry(Section):
    """What a rig file says of the markers on the sample holder."""

    dictionary: str = Field("DICT_4X4_50", description="OpenCV's name of the set of markers")
    marker_mm: Size | None = Field(None, description="side of a single marker's black square")
    markers: dict[int, Place] = Field(
        default_factory=dict, description="x and y of every single marker's centre on the plate, in mm, by its number"
    )
    board: BoardEntry | None = Field(None, description="a ChArUco board beside or instead of single markers")

    @field_validator("dictionary")
    @classmethod
    def _check_dictionary(cls, name: str) -> str:
        if name not in _IDS:
            refuse_all([((), f"{name} is no set of markers; there are {', '.join(_IDS)}")])
        return name

    @model_validator(mode="after")
    def _check_markers(self) -> Self:
        refuse_all([*self._number_faults(), *self._overlap_faults()])
        return self

    def _number_faults(self) -> Iterator[SectionFault]:
        known = _IDS[self.dictionary]
        if self.board is None and len(self.markers) < FEWEST_MARKERS:
            yield (
                ("markers",),
                f"{len(self.markers)} given; at least {FEWEST_MARKERS} are needed, or a board: one alone does not show "
                "when it is misread",
            )
        if self.markers and self.marker_mm is None:
            yield ("marker_mm",), "is missing; state the side of the markers' black squares"
        for number in self.markers:
            if not 0 <= number < known:
                yield ("markers", number), f"{self.dictionary} has the markers 0 to {known - 1}"
        if self.board is None:
            return
        borne = self.board.columns * self.board.rows // 2
        if borne > known:
            yield ("board",), f"bears {borne} markers, and {self.dictionary} has {known}; take a larger set"
        for number in sorted(n for n in self.markers if 0 <= n < borne):
            yield ("markers", number), f"is also on the board, which bears 0 to {borne - 1}; take another number"

    def _overlap_faults(self) -> Iterator[SectionFault]:
        side = self.marker_mm or 0.0
        for (one, (x1, y1)), (other, (x2, y2)) in combinations(self.markers.items(), 2):
            if max(abs(x1 - x2), abs(y1 - y2)) < side:
                yield ("markers", other), f"overlaps marker {one}, as both are {side:g} mm wide; measure their centres"
        if self.board is None:
            return
        (left, bottom), square = self.board.corner_mm, self.board.square_mm
        right, top = left + self.board.columns * square, bottom + self.board.rows * square
        for number, (x, y) in self.markers.items():
            if left - side / 2 < x < right + side / 2 and bottom - side / 2 < y < top + side / 2:
                yield ("markers", number), "lies on the board; measure its centre and the board's corner"

    def holder(self) -> Holder:
        """What the entry describes."""
        board = None
        if self.board is not None:
            entry = self.board
            board = Board(entry.columns, entry.rows, entry.square_mm, entry.marker_mm, *entry.corner_mm)
        return Holder(self.dictionary, self.marker_mm or 0.0, dict(self.markers), board)
