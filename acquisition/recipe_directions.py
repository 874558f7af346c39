"""Which directions a recipe measures: a product of angles, or a list of points."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, ValidationInfo, field_validator, model_validator
from pydantic_core import PydanticCustomError

from acquisition.exit_angles import (
    MAX_DIRECTIONS,
    AngleRange,
    Azimuth,
    AzimuthRange,
    ExitAngle,
    ExitAzimuthRange,
    ExitRange,
    Incidence,
    IncidenceRange,
)
from acquisition.point_table import NAMES, point_table
from acquisition.section import Section, SectionFault, refuse_all

MAX_REPEATS = 1000

_SEVERAL = "several angles of incidence or of the sample"


class Point(Section):
    """One direction of an explicit list."""

    incidence_deg: Incidence = Field(description="angle of incidence from the surface normal, in degrees")
    exit_deg: ExitAngle = Field(description="exit angle, in degrees")
    azimuth_deg: Azimuth = Field(default=0.0, description="angle of the sample about its normal, in degrees")
    exit_azimuth_deg: Azimuth = Field(
        default=0.0, description="turn of the detector arm out of the plane of incidence, in degrees"
    )


class RecipeDirections(Section):
    """The directions of a recipe, numbered as they are listed: of a product, the exit angle runs fastest.

    Incidence, sample azimuth, exit azimuth and exit angle may each take several values; every combination is measured.
    Or `points` lists the directions one by one.
    """

    points: (
        Annotated[tuple[Point, ...], Field(strict=False, min_length=1)] | Annotated[str, Field(min_length=1)] | None
    ) = Field(
        default=None,
        description="directions one by one, in place of incidence_deg, exit and the azimuths; or a table of them, "
        "as text like that of points_file",
    )
    points_file: str | None = Field(
        default=None,
        min_length=1,
        description="file with directions, comma-separated below the names incidence_deg,exit_deg,azimuth_deg, and "
        "exit_azimuth_deg where it is needed; a relative path starts at this file's folder",
    )
    incidence_deg: (
        Incidence | Annotated[tuple[Incidence, ...], Field(strict=False, min_length=1)] | IncidenceRange | None
    ) = Field(
        default=None,
        validate_default=True,
        description="angle of incidence from the surface normal, in degrees; or several, as a list or a grid",
    )
    exit: ExitRange | None = Field(default=None, description="exit angles on an even grid; or write exit_deg")
    exit_deg: Annotated[tuple[ExitAngle, ...], Field(strict=False)] | None = Field(
        default=None,
        min_length=1,
        max_length=MAX_DIRECTIONS,
        description="list of exit angles, in degrees; or write exit",
    )
    azimuth_deg: Azimuth | Annotated[tuple[Azimuth, ...], Field(strict=False, min_length=1)] | AzimuthRange = Field(
        default=0.0,
        description="angle of the sample about its normal, in degrees; or several, as a list or a grid",
    )
    exit_azimuth_deg: Azimuth | Annotated[tuple[Azimuth, ...], Field(strict=False, min_length=1)] | ExitAzimuthRange = (
        Field(
            default=0.0,
            description="turn of the detector arm out of the plane of incidence, in degrees, for a rig with the axis "
            "detector_azimuth; or several, as a list or a grid",
        )
    )
    repeats: int = Field(
        default=1,
        ge=1,
        le=MAX_REPEATS,
        description="how often all directions are measured, one time after the other; a direction's readings are "
        "reduced together",
    )

    @field_validator("incidence_deg")
    @classmethod
    def _check_incidence(cls, incidence_deg: object, info: ValidationInfo) -> object:
        if incidence_deg is None and info.data.get("points", ()) is None and info.data.get("points_file", "") is None:
            raise PydanticCustomError("missing", "Field required")
        return incidence_deg

    @model_validator(mode="after")
    def _check_directions(self) -> Self:
        refuse_all(self._point_faults())
        if not self.has_points and (self.exit is None) == (self.exit_deg is None):
            found = "neither" if self.exit is None else "both"
            raise ValueError(
                f"found {found} of the keys exit and exit_deg; write one of them, for example "
                "'exit: {start_deg: 0, stop_deg: 60, step_deg: 1}' or 'exit_deg: [0, 30, 60]'"
            )
        count = self.planes * len(self.exit_angles_deg())
        if count > MAX_DIRECTIONS:
            raise ValueError(f"asks for {count} directions; allowed: at most {MAX_DIRECTIONS}")
        return self

    def _point_faults(self) -> Iterator[SectionFault]:
        if self.points is not None and self.points_file is not None:
            yield ("points_file",), "stands beside points. Leave one of the two out"
        elif self.points_file is not None:
            yield ("points_file",), "was not read, for a file is found beside a recipe file only"
        for key in ("incidence_deg", "exit", "exit_deg", "azimuth_deg", "exit_azimuth_deg"):
            if self.has_points and key in self.model_fields_set:
                yield (key,), "stands beside a list of points, which says all angles. Leave it out"
        if isinstance(self.points, str):
            for line, what in point_table(self.points).faults:
                yield ("points",), f"line {line} of the table {what}"

    @property
    def has_points(self) -> bool:
        """Whether the directions are listed one by one."""
        return self.points is not None or self.points_file is not None

    @property
    def is_one_plane(self) -> bool:
        """Whether only the exit angle takes several values."""
        return not self.has_points and self.planes == 1

    @property
    def planes(self) -> int:
        """How many combinations of angles other than the exit angle a product has; 0 for a list of points."""
        return len(self.incidences_deg()) * len(self.azimuths_deg()) * len(self.exit_azimuths_deg())

    @property
    def several_planes(self) -> str:
        """What of a product with several planes makes them so, in words."""
        return "several exit azimuths" if len(self.exit_azimuths_deg()) > 1 else _SEVERAL

    def incidences_deg(self) -> tuple[float, ...]:
        """Angles of incidence of a product, in degrees, as they are listed; none for a list of points."""
        return _listed(self.incidence_deg)

    def azimuths_deg(self) -> tuple[float, ...]:
        """Angles of the sample of a product, in degrees, as they are listed; none for a list of points."""
        return () if self.has_points else _listed(self.azimuth_deg)

    def exit_azimuths_deg(self) -> tuple[float, ...]:
        """Exit azimuths of a product, in degrees, as they are listed; none for a list of points."""
        return () if self.has_points else _listed(self.exit_azimuth_deg)

    def exit_angles_deg(self) -> tuple[float, ...]:
        """Exit angles of a product, in degrees, as they are listed; none for a list of points."""
        return _listed(self.exit if self.exit is not None else self.exit_deg)

    def directions_deg(self) -> NDArray[np.float64]:
        """Incidence, exit angle, sample and exit azimuth of every direction (N, 4), in degrees, by its number."""
        if isinstance(self.points, str):
            return point_table(self.points).angles_deg
        if self.points is not None:
            return np.array([[getattr(point, name) for name in NAMES] for point in self.points])
        incidence_deg, azimuth_deg, exit_azimuth_deg, exit_deg = np.meshgrid(
            self.incidences_deg(),
            self.azimuths_deg(),
            self.exit_azimuths_deg(),
            self.exit_angles_deg(),
            indexing="ij",
        )
        return np.stack(
            [angle_deg.ravel() for angle_deg in (incidence_deg, exit_deg, azimuth_deg, exit_azimuth_deg)], 1
        )


def _listed(angles_deg: float | tuple[float, ...] | AngleRange | None) -> tuple[float, ...]:
    if angles_deg is None:
        return ()
    if isinstance(angles_deg, AngleRange):
        return angles_deg.angles_deg()
    return angles_deg if isinstance(angles_deg, tuple) else (angles_deg,)
