"""What lies in the sample plane before a camera: a plate with materials, markers and pictures of them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from goniometer.errors import ConfigurationError
from sim_devices.camera.gray_picture import gray_picture
from sim_devices.camera.layers import Cells, Disk, Layer, Surroundings
from sim_devices.camera.layout import DARKNESS, Ink, Lambertian, Layout, Rough, Roughness
from sim_devices.camera.markers import Markers
from sim_devices.sample import Sample
from sim_devices.scene_part import ScenePart

Millimetres = Annotated[float, Field(ge=-1000, le=1000)]
Gray = Annotated[int, Field(ge=0, le=65535, strict=False)]


class Patch(Sample):
    """A part of the plate with a surface of its own, in a rectangle or a disk."""

    rectangle_mm: Annotated[tuple[Millimetres, Millimetres, Millimetres, Millimetres], Field(strict=False)] | None = (
        Field(default=None, description="left, bottom, right and top edge; or write disk_mm")
    )
    disk_mm: Annotated[tuple[Millimetres, Millimetres, Millimetres], Field(strict=False)] | None = Field(
        default=None, description="x and y of the centre, and radius; or write rectangle_mm"
    )

    @model_validator(mode="after")
    def _has_one_shape(self) -> Patch:
        if (self.rectangle_mm is None) == (self.disk_mm is None):
            raise ValueError("a patch needs rectangle_mm or disk_mm, and exactly one of the two")
        if self.rectangle_mm is not None:
            left, bottom, right, top = self.rectangle_mm
            if left >= right or bottom >= top:
                raise ValueError("rectangle_mm is left, bottom, right, top: left of right, and bottom below top")
        if self.disk_mm is not None and self.disk_mm[2] <= 0:
            raise ValueError("disk_mm is x, y, radius, and the radius is above 0")
        return self

    def layer(self, ink: int) -> Layer:
        """Where it lies."""
        if self.disk_mm is not None:
            return Disk(*self.disk_mm, ink)
        assert self.rectangle_mm is not None
        return Cells.rectangle(*self.rectangle_mm, ink)

    def sample(self) -> Sample:
        """Its surface alone."""
        return Sample(**{name: getattr(self, name) for name in Sample.model_fields})


class MaterialMap(ScenePart):
    """A picture whose gray values say which surface the plate has where; its middle is the plate's."""

    image: str = Field(min_length=1, description="gray picture; a relative path starts at the scene file's folder")
    pixel_mm: float = Field(gt=0, le=100, description="size of its pixels on the plate")
    values: dict[Gray, Sample] = Field(min_length=1, description="the surface of each gray value in it")

    def load(self, folder: Path, inks: Mapping[int, int]) -> Cells:
        """The picture in the inks of its gray values."""
        picture = gray_picture(folder / self.image)
        if unknown := sorted({int(gray) for gray in np.unique(picture)} - set(inks)):
            raise ConfigurationError(
                [
                    f"{folder / self.image}: has the gray values {unknown[:8]}, for which the material map names no "
                    f"surface; named are {sorted(inks)}"
                ]
            )
        table = np.zeros(max(inks) + 1, np.int16)
        table[list(inks)] = list(inks.values())
        return _centred(table[picture], self.pixel_mm)


class RoughnessMap(ScenePart):
    """A picture whose gray values say how rough the plate, beside its patches, is where; its middle is the plate's."""

    image: str = Field(min_length=1, description="gray picture; a relative path starts at the scene file's folder")
    pixel_mm: float = Field(gt=0, le=100, description="size of its pixels on the plate")
    sigma: Annotated[
        tuple[Annotated[float, Field(ge=1e-5, le=2)], Annotated[float, Field(ge=1e-5, le=2)]], Field(strict=False)
    ] = Field(description="sigma of black and of white, in between in proportion to the gray value")

    def load(self, folder: Path, size_mm: tuple[float, float]) -> Roughness:
        """The picture as sigma; it has to cover the plate."""
        picture = gray_picture(folder / self.image)
        place = _centred(np.zeros(picture.shape, np.int16), self.pixel_mm)
        if place.width_mm < size_mm[0] or place.height_mm < size_mm[1]:
            raise ConfigurationError(
                [
                    f"{folder / self.image}: covers {place.width_mm:g} x {place.height_mm:g} mm of a plate of "
                    f"{size_mm[0]:g} x {size_mm[1]:g} mm; how rough the rest is is not known; raise pixel_mm"
                ]
            )
        lowest, highest = self.sigma
        return Roughness(place, lowest + (highest - lowest) * picture / np.iinfo(picture.dtype).max)


class Plate(ScenePart):
    """A plate in the sample plane, its middle where the goniometer's axes meet; around it is darkness.

    Where nothing else lies it has the scene's `sample`. Upon that lies the material map, then the patches, a later one
    on an earlier one, then the markers. The roughness map takes the place of sigma where no patch lies.
    """

    size_mm: Annotated[
        tuple[Annotated[float, Field(gt=0, le=1000)], Annotated[float, Field(gt=0, le=1000)]], Field(strict=False)
    ] = Field(description="width and height")
    patches: Annotated[tuple[Patch, ...], Field(strict=False)] = Field(
        default=(), description="parts with a surface of their own; a later one lies on an earlier one"
    )
    material_map: MaterialMap | None = Field(default=None, description="a picture of which surface is where")
    roughness_map: RoughnessMap | None = Field(default=None, description="a picture of how rough the plate is where")
    markers: Markers | None = Field(default=None, description="ArUco markers printed on the plate")

    @model_validator(mode="after")
    def _holds_its_markers(self) -> Plate:
        if self.markers is not None:
            reach = self.markers.whole_mm / 2
            width, height = self.size_mm
            for number, (x, y) in self.markers.at_mm.items():
                if abs(x) + reach > width / 2 or abs(y) + reach > height / 2:
                    raise ValueError(
                        f"marker {number} with its white margin is {2 * reach:g} mm wide, and at {x:g}, {y:g} it "
                        f"reaches over the edge of the plate of {width:g} x {height:g} mm; move it, or make it smaller"
                    )
        return self

    def load(self, folder: Path, default: Sample) -> Layout:
        """The plate as it is drawn.

        Parameters
        ----------
        folder : Path
            Where relative paths of pictures start.
        default : Sample
            What the plate is made of where nothing lies on it.

        Raises
        ------
        ConfigurationError
            If a picture cannot be had, does not fit, or a surface sends light of several bounces.
        """
        mapped = self.roughness_map is not None
        inks: list[Ink] = [Rough(default, mapped), DARKNESS]
        layers: list[Layer] = []

        def number(ink: Ink) -> int:
            if ink not in inks:
                inks.append(ink)
            return inks.index(ink)

        if self.material_map is not None:
            kinds = {gray: number(Rough(sample, mapped)) for gray, sample in self.material_map.values.items()}
            layers.append(self.material_map.load(folder, kinds))
        layers += [patch.layer(number(Rough(patch.sample()))) for patch in self.patches]
        if self.markers is not None:
            white, black = (number(Lambertian(albedo)) for albedo in (self.markers.white, self.markers.black))
            layers += self.markers.layers(white, black)
        width, height = self.size_mm
        layers.append(Surroundings(-width / 2, width / 2, -height / 2, height / 2, inks.index(DARKNESS)))
        _require_single_bounces(inks)
        return Layout(
            tuple(inks), tuple(layers), self.roughness_map.load(folder, self.size_mm) if self.roughness_map else None
        )


def _centred(inks: NDArray[np.int16], pixel_mm: float) -> Cells:
    rows, columns = inks.shape
    width, height = columns * pixel_mm, rows * pixel_mm
    return Cells(inks, -width / 2, height / 2, width, height)


def _require_single_bounces(inks: Iterable[Ink]) -> None:
    for ink in inks:
        if isinstance(ink, Rough) and ink.sample.bounces > 1:
            raise ConfigurationError(
                [
                    f"a surface on the plate follows {ink.sample.bounces} bounces, whose light has a pole in the "
                    "mirror direction, and a camera's pixel looks in a single direction; take bounces: 1"
                ]
            )
