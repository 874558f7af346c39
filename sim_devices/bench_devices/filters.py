"""A Thorlabs wheel of filters on the bench."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

from pydantic import Field, model_validator

from sim_devices.bench_devices.entry import SimulatedDevice
from sim_devices.device import Device
from sim_devices.filters import Filter, Filters
from sim_devices.thorlabs_fw102c import ThorlabsFw102c

if TYPE_CHECKING:
    from sim_devices.world import World


class FilterDevice(SimulatedDevice):
    """What chooses the wavelength of the light, by filters in slots."""

    part: ClassVar[str] = "filter"

    filters: Annotated[dict[Annotated[int, Field(ge=1, le=12)], Filter], Field(min_length=1)] = Field(
        description="the filter in each slot that has one; the others let nothing through"
    )


class ThorlabsFw102cFiltersDevice(FilterDevice):
    """A Thorlabs wheel with filters between lamp and sample."""

    type: Literal["thorlabs_fw102c_filters"] = Field(description="the device's family")
    positions: Literal[6, 12] = Field(default=6, description="slots all round: 6 in an FW102C, 12 in an FW212C")

    @model_validator(mode="after")
    def _fit_into_the_wheel(self) -> ThorlabsFw102cFiltersDevice:
        if max(self.filters) > self.positions:
            raise ValueError(f"slot {max(self.filters)} has a filter, and the wheel has {self.positions} slots")
        return self

    def install(self, world: World) -> Device:
        """Put the wheel between lamp and sample."""
        world.filters = filters = Filters(self.filters)
        return ThorlabsFw102c(filters.wheel, range(1, self.positions + 1))
