"""What goes wrong with the markers on the plate before a camera."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

from pydantic import Field

from sim_devices.faults.entry import DeviceFault, Random
from sim_devices.faults.hooks import TakesPictures

if TYPE_CHECKING:
    from sim_devices.camera.layout import Layout
    from sim_devices.camera.markers import Markers
    from sim_devices.camera.plate import Plate
    from sim_devices.faults.switchboard import Switchboard

_CLOTH_ALBEDO = 0.3


class MarkerFault(DeviceFault):
    """A fault of what a camera sees of the markers."""

    needs: ClassVar[tuple[type, ...]] = (TakesPictures,)

    for_s: float = Field(default=1e9, gt=0, le=1e9, description="how long it lasts, in s; for ever if not given")

    def strike(self, board: Switchboard, random: Random, time_s: float) -> None:
        """Lay something upon them, and take it away again."""
        from sim_devices.camera.light import PlateLight

        device, plate = board.device(self.device), board.world.scene.plate
        assert isinstance(device, TakesPictures)
        assert plate is not None
        assert plate.markers is not None
        light, markers = device.camera.light, plate.markers
        assert isinstance(light, PlateLight)

        def cover(layout: Layout) -> Layout:
            return self.covered(layout, markers)

        light.cover(cover)
        board.at(time_s + self.for_s, lambda _: light.uncover(cover))

    @abstractmethod
    def covered(self, layout: Layout, markers: Markers) -> Layout:
        """What there is to be seen then."""


class MarkersHidden(MarkerFault):
    """A gray cloth over some of the markers."""

    fault: Literal["markers_hidden"] = Field(description="the fault's name")
    markers: Annotated[tuple[int, ...], Field(strict=False, min_length=1)] = Field(description="the markers' numbers")

    def objections_of(self, plate: Plate | None) -> tuple[str, ...]:
        """Say so where there are no such markers."""
        return _not_there(self.fault, self.markers, plate)

    def covered(self, layout: Layout, markers: Markers) -> Layout:
        """Lay a square of it upon each of them."""
        from sim_devices.camera.layers import Cells
        from sim_devices.camera.layout import Lambertian

        half_mm, cloth = markers.whole_mm / 2, len(layout.inks)
        places_mm = [markers.at_mm[number] for number in self.markers]
        cloths = [
            Cells.rectangle(x_mm - half_mm, y_mm - half_mm, x_mm + half_mm, y_mm + half_mm, cloth)
            for x_mm, y_mm in places_mm
        ]
        return replace(layout, inks=(*layout.inks, Lambertian(_CLOTH_ALBEDO)), layers=(*layout.layers, *cloths))


class MarkerMisprinted(MarkerFault):
    """A marker that shows another one's pattern."""

    fault: Literal["marker_misprinted"] = Field(description="the fault's name")
    marker: int = Field(description="the marker's number")
    shows: int = Field(ge=0, le=999, description="the number of the marker whose pattern it shows")

    def objections_of(self, plate: Plate | None) -> tuple[str, ...]:
        """Say so where there is no such marker, or no such pattern."""
        if found := _not_there(self.fault, [self.marker], plate):
            return found
        assert plate is not None
        assert plate.markers is not None
        _, patterns = plate.markers.dictionary.split("_")
        if self.shows >= int(patterns):
            return (f"{self.fault}: the dictionary {plate.markers.dictionary} has no marker {self.shows}",)
        return ()

    def covered(self, layout: Layout, markers: Markers) -> Layout:
        """Lay the other one's pattern upon it."""
        from sim_devices.camera.layout import Lambertian

        white = len(layout.inks)
        wrong = markers.model_copy(update={"at_mm": {self.shows: markers.at_mm[self.marker]}})
        inks = Lambertian(markers.white), Lambertian(markers.black)
        return replace(layout, inks=(*layout.inks, *inks), layers=(*layout.layers, *wrong.layers(white, white + 1)))


def _not_there(fault: str, numbers: Iterable[int], plate: Plate | None) -> tuple[str, ...]:
    on_plate = plate.markers.at_mm if plate is not None and plate.markers is not None else {}
    listed = ", ".join(map(str, on_plate)) or "none"
    return tuple(
        f"{fault}: there is no marker {number} on the plate, whose markers are: {listed}"
        for number in numbers
        if number not in on_plate
    )
