"""ArUco markers printed on the plate, by which a picture shows where the plate is."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated

import numpy as np
from pydantic import Field, model_validator

from sim_devices.camera.layers import Cells
from sim_devices.scene_part import ScenePart

Place = Annotated[
    tuple[Annotated[float, Field(ge=-1000, le=1000)], Annotated[float, Field(ge=-1000, le=1000)]], Field(strict=False)
]


class Markers(ScenePart):
    """ArUco markers, upright at azimuth 0, each with a white margin of one of its cells around its black border."""

    dictionary: str = Field(
        pattern="^[4-7]x[4-7]_(50|100|250|1000)$", description="which markers: 4x4_50, 5x5_100, 6x6_250 ..."
    )
    size_mm: float = Field(gt=0, le=1000, description="side of the black square")
    at_mm: dict[Annotated[int, Field(ge=0, le=999, strict=False)], Place] = Field(
        min_length=1, description="x and y of the middle of each marker, by its number"
    )
    white: float = Field(default=0.8, ge=0, le=1, description="albedo of the paper")
    black: float = Field(default=0.04, ge=0, le=1, description="albedo of the ink")

    @model_validator(mode="after")
    def _are_in_the_dictionary(self) -> Markers:
        cells, count = self.dictionary.split("_")
        if cells[0] != cells[-1]:
            raise ValueError(f"{self.dictionary} is no dictionary of ArUco markers, which are square: 4x4_50, 5x5_50 …")
        if beyond := [number for number in self.at_mm if number >= int(count)]:
            raise ValueError(f"the dictionary {self.dictionary} has markers 0 to {int(count) - 1}, and not {beyond}")
        return self

    @property
    def cells(self) -> int:
        """How many cells a marker is wide, with border and margin."""
        return int(self.dictionary[0]) + 4

    @property
    def whole_mm(self) -> float:
        """Side of a marker with its margin."""
        return self.size_mm * self.cells / (self.cells - 2)

    def layers(self, white: int, black: int) -> Iterator[Cells]:
        """The markers in these two inks."""
        import cv2

        dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, f"DICT_{self.dictionary.upper()}"))
        for number, (x, y) in self.at_mm.items():
            printed = np.pad(dictionary.generateImageMarker(number, self.cells - 2) > 0, 1, constant_values=True)
            inks = np.where(printed, white, black).astype(np.int16)
            yield Cells(inks, x - self.whole_mm / 2, y + self.whole_mm / 2, self.whole_mm, self.whole_mm)
