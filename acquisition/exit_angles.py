"""Angles as a recipe lists them: on even grids, each axis within what it can mean."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Annotated, ClassVar, Self

from pydantic import Field, model_validator

from acquisition.section import Section, SectionFault, refuse_all

WIDEST_EXIT_DEG = 85
ExitAngle = Annotated[float, Field(ge=-WIDEST_EXIT_DEG, le=WIDEST_EXIT_DEG)]
Incidence = Annotated[float, Field(ge=0, le=89)]
Azimuth = Annotated[float, Field(ge=-360, le=360)]

MAX_DIRECTIONS = 1_000_000
"""More exit angles than any scan has: a step that was mistyped is found before memory is full."""

_GRID_TOLERANCE_DEG = 1e-9


class AngleRange(Section):
    """Angles on an even grid."""

    start_deg: float = Field(description="first angle, in degrees")
    stop_deg: float = Field(description="last angle, in degrees; measured when it lies on the grid")
    step_deg: float = Field(gt=0, description="distance of neighbouring angles, in degrees")
    _named: ClassVar[str] = "angles"

    @model_validator(mode="after")
    def _check(self) -> Self:
        refuse_all(self._faults())
        return self

    def _faults(self) -> Iterator[SectionFault]:
        steps = (self.stop_deg - self.start_deg) / self.step_deg
        if steps < 0:
            yield ("stop_deg",), f"got {self.stop_deg:g}; allowed: start_deg, which is {self.start_deg:g}, or above"
        elif steps >= MAX_DIRECTIONS:
            yield (
                ("step_deg",),
                f"got {self.step_deg:g}, which makes {steps:.3g} {self._named}; allowed: at most {MAX_DIRECTIONS} "
                "angles",
            )

    def angles_deg(self) -> tuple[float, ...]:
        """All angles, each computed from the first so that no error builds up."""
        steps = (self.stop_deg - self.start_deg) / self.step_deg
        last = round(steps)
        if abs(self.start_deg + last * self.step_deg - self.stop_deg) <= _GRID_TOLERANCE_DEG:
            return (*(self.start_deg + i * self.step_deg for i in range(last)), self.stop_deg)
        return tuple(self.start_deg + i * self.step_deg for i in range(math.floor(steps) + 1))


class ExitRange(AngleRange):
    """Exit angles on an even grid; negative angles lie on the source's side of the surface normal."""

    start_deg: ExitAngle = Field(description="first exit angle, in degrees")
    stop_deg: ExitAngle = Field(description="last exit angle, in degrees; measured when it lies on the grid")
    step_deg: float = Field(gt=0, description="distance of neighbouring exit angles, in degrees")
    _named: ClassVar[str] = "exit angles"


class IncidenceRange(AngleRange):
    """Angles of incidence on an even grid."""

    start_deg: Incidence = Field(description="first angle of incidence, in degrees")
    stop_deg: Incidence = Field(description="last angle of incidence, in degrees; measured when it lies on the grid")
    _named: ClassVar[str] = "angles of incidence"


class AzimuthRange(AngleRange):
    """Angles of the sample about its normal on an even grid."""

    start_deg: Azimuth = Field(description="first angle of the sample, in degrees")
    stop_deg: Azimuth = Field(description="last angle of the sample, in degrees; measured when it lies on the grid")
    _named: ClassVar[str] = "angles of the sample"


class ExitAzimuthRange(AngleRange):
    """Turns of the detector arm out of the plane of incidence on an even grid."""

    start_deg: Azimuth = Field(description="first exit azimuth, in degrees")
    stop_deg: Azimuth = Field(description="last exit azimuth, in degrees; measured when it lies on the grid")
    _named: ClassVar[str] = "exit azimuths"
