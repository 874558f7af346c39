"""The recipe's section `imaging`: which maps are made of a camera's pictures, and what they go through on the way."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import TYPE_CHECKING, Annotated, Literal, Self

from pydantic import Field, model_validator

from acquisition.imaging.place.map_grid import MapGrid
from acquisition.section import Section, SectionFault, refuse_all

if TYPE_CHECKING:
    from acquisition.recipe import Recipe

MOST_EXPOSURES = 8
MOST_MAP_PIXELS = 100_000_000
_WHOLE = 1e-6
"""By how much the sides of an area may differ from whole pixels, in pixels."""

Coordinate = Annotated[float, Field(ge=-1000, le=1000)]


class SampleArea(Section):
    """A rectangle on the sample, in its own coordinates, and the pixels that it is cut into."""

    x_mm: Annotated[tuple[Coordinate, Coordinate], Field(strict=False)] = Field(
        description="from where to where along the s-direction, to the right in the picture, in mm"
    )
    y_mm: Annotated[tuple[Coordinate, Coordinate], Field(strict=False)] = Field(
        description="from where to where in the plane of incidence, rising towards the source, in mm"
    )
    pixel_mm: float = Field(gt=0, le=100, description="size of a pixel of the maps, in mm")

    @model_validator(mode="after")
    def _check_size(self) -> Self:
        refuse_all(self._faults())
        return self

    def _faults(self) -> Iterator[SectionFault]:
        for key, (low, high) in (("x_mm", self.x_mm), ("y_mm", self.y_mm)):
            if not low < high:
                yield (key,), f"got [{low:g}, {high:g}]; allowed: the lower end, then the higher one"
            elif abs((pixels := (high - low) / self.pixel_mm) - round(pixels)) > _WHOLE or round(pixels) < 1:
                yield (key,), f"is {high - low:g} mm long, {pixels:g} pixels of pixel_mm; allowed: a whole number"
        if (pixels := self.grid.width * self.grid.height) > MOST_MAP_PIXELS:
            yield ("pixel_mm",), f"makes maps of {pixels} pixels; allowed: at most {MOST_MAP_PIXELS}"

    @property
    def grid(self) -> MapGrid:
        """Its pixels."""
        (left_mm, right_mm), (bottom_mm, top_mm) = self.x_mm, self.y_mm
        width, height = (round(side / self.pixel_mm) for side in (right_mm - left_mm, top_mm - bottom_mm))
        return MapGrid(left_mm, top_mm, self.pixel_mm, width, height)


class MaterialMaps(Section):
    """Maps of what `fit` leaves free, each pixel of them fitted by itself."""

    bin_px: int = Field(default=4, ge=1, le=1000, description="so many map pixels, each way, are fitted as one")


class Imaging(Section):
    """Maps of Stokes parameters, and what the pictures go through; what is left out is not done."""

    exposures: Annotated[tuple[Annotated[float, Field(gt=0, le=1)], ...], Field(strict=False)] = Field(
        default=(1.0,),
        min_length=1,
        max_length=MOST_EXPOSURES,
        description="exposures of every reading over exposure_s, from 1 downwards, such as [1, 0.1]: each pixel is "
        "made of those in which it is not saturated",
    )
    registration: Literal["phase", "ecc"] | None = Field(
        default=None,
        description="how the shift of the picture from one analyzer position to the next is found; leave out where "
        "polarizers have no wedge",
    )
    area: SampleArea | None = Field(
        default=None,
        description="what of the sample the maps show, in its own coordinates, which the markers of the rig's holder "
        "give; leave out for maps in the camera's pixels",
    )
    material: MaterialMaps | None = Field(
        default=None, description="maps of the parameters that fit leaves free; needs area; leave out for none"
    )

    @model_validator(mode="after")
    def _check(self) -> Self:
        refuse_all(self._faults())
        return self

    def _faults(self) -> Iterator[SectionFault]:
        if self.exposures[0] != 1 or any(later >= one for one, later in pairwise(self.exposures)):
            listed = ", ".join(f"{ratio:g}" for ratio in self.exposures)
            yield ("exposures",), f"got [{listed}]; allowed: 1 first, each further one shorter than the one before"
        if self.material is not None and self.area is None:
            yield ("material",), "needs area: a pixel is fitted at one place on the sample, seen from all directions"


def imaging_faults(recipe: Recipe) -> Iterator[SectionFault]:
    """What a recipe asks beside maps that cannot be had with them."""
    if recipe.imaging is None:
        return
    for key, what in (
        ("generator_deg", "a generator before the sample"),
        ("analyzer_rotation", "an analyzer that turns while it is read"),
    ):
        if getattr(recipe, key) is not None:
            yield ("imaging",), f"makes no maps behind {what}; leave {key} out, or imaging"
    if len(recipe.wavelengths_nm()) > 1:
        yield ("imaging",), "makes maps at one wavelength; write one wavelength_nm, or leave imaging out"
    if recipe.imaging.material is not None and not recipe.fit.free_names:
        yield ("imaging", "material"), "maps what fit leaves free, and nothing is free in it"
