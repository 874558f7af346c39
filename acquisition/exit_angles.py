"""Exit angles as a recipe lists them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Annotated, Self

from pydantic import Field, model_validator

from acquisition.section import Section, SectionFault, refuse_all

WIDEST_EXIT_DEG = 85
ExitAngle = Annotated[float, Field(ge=-WIDEST_EXIT_DEG, le=WIDEST_EXIT_DEG)]

MAX_DIRECTIONS = 1_000_000
"""More exit angles than any scan has: a step that was mistyped is found before memory is full."""

_GRID_TOLERANCE_DEG = 1e-9


class ExitRange(Section):
    """Exit angles on an even grid; negative angles lie on the source's side of the surface normal."""

    start_deg: ExitAngle = Field(description="first exit angle, in degrees")
    stop_deg: ExitAngle = Field(description="last exit angle, in degrees; measured when it lies on the grid")
    step_deg: float = Field(gt=0, description="distance of neighbouring exit angles, in degrees")

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
                f"got {self.step_deg:g}, which makes {steps:.3g} exit angles; allowed: at most {MAX_DIRECTIONS} angles",
            )

    def angles_deg(self) -> tuple[float, ...]:
        """All angles, each computed from the first so that no error builds up."""
        steps = (self.stop_deg - self.start_deg) / self.step_deg
        last = round(steps)
        if abs(self.start_deg + last * self.step_deg - self.stop_deg) <= _GRID_TOLERANCE_DEG:
            return (*(self.start_deg + i * self.step_deg for i in range(last)), self.stop_deg)
        return tuple(self.start_deg + i * self.step_deg for i in range(math.floor(steps) + 1))
