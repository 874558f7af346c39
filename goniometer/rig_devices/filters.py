"""Wheels of filters before the sample, in a rig file: a Thorlabs FW102C or FW212C."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Mapping
from typing import Annotated, ClassVar, Literal, Self

from pydantic import Field, model_validator

from acquisition.filters import Filters
from acquisition.section import Section, SectionFault, refuse_all
from acquisition.timing import WheelTiming
from drivers.thorlabs_fw102c import ThorlabsFw102c
from goniometer.rig_devices.connecting import Connecting
from goniometer.rig_devices.entry import DeviceEntry, SettleTime, SlotTime
from sim_devices.bench_devices.entry import SimulatedDevice
from sim_devices.bench_devices.filters import ThorlabsFw102cFiltersDevice


class FilterEntry(Section):
    """A filter, by the light behind it."""

    wavelength_nm: float = Field(ge=200, le=2500, description="wavelength of the light behind it, in nm")
    beam_power_w: float | None = Field(
        default=None,
        gt=0,
        le=1000,
        description="power of the beam on the sample behind it, in W; that of calibration if left out",
    )


class FiltersEntry(DeviceEntry):
    """A wheel that chooses the wavelength of the light by the filters in its slots."""

    part: ClassVar[str] = "filter"

    filters: Annotated[dict[Annotated[int, Field(ge=1, le=12)], FilterEntry], Field(min_length=1)] = Field(
        description="the filter in each slot that has one; the other slots are never brought into the beam"
    )

    @model_validator(mode="after")
    def _check_filters(self) -> Self:
        refuse_all(self._filter_faults())
        return self

    def _filter_faults(self) -> Iterator[SectionFault]:
        first: dict[float, int] = {}
        for slot, held in self.filters.items():
            if first.setdefault(held.wavelength_nm, slot) != slot:
                yield (
                    ("filters", slot, "wavelength_nm"),
                    f"got {held.wavelength_nm:g}, as slot {first[held.wavelength_nm]} has; allowed: each once",
                )

    @property
    def slots(self) -> Mapping[float, int]:
        """Which slot has the filter of a wavelength in nm."""
        return {held.wavelength_nm: slot for slot, held in self.filters.items()}

    @property
    @abstractmethod
    def timing(self) -> WheelTiming:
        """How long it takes from one slot to another."""


class ThorlabsFw102cFiltersEntry(FiltersEntry):
    """Thorlabs FW102C or FW212C filter wheel with filters in its slots, between lamp and sample."""

    driver: Literal["thorlabs_fw102c_filters"] = Field(description="the device's family")
    baudrate: Literal[9600, 115200] = Field(
        default=115200, description="as set in the wheel; without effect on a socket"
    )
    positions: Literal[6, 12] = Field(default=6, description="slots all round: 6 in an FW102C, 12 in an FW212C")
    slot_s: SlotTime
    settle_s: SettleTime

    def _filter_faults(self) -> Iterator[SectionFault]:
        yield from super()._filter_faults()
        for slot in self.filters:
            if slot > self.positions:
                yield ("filters", slot), f"is no slot of a wheel with so few positions; allowed: 1 to {self.positions}"

    @property
    def timing(self) -> WheelTiming:
        """The wheel goes the shorter way round."""
        return WheelTiming(self.positions, self.slot_s, self.settle_s)

    def connect(self, name: str, bench: Connecting) -> None:
        """Connect the wheel."""
        wheel = ThorlabsFw102c(
            bench.link(name, baudrate=self.baudrate),
            bench.clock,
            name=name,
            slots=self.positions,
            slot_s=self.slot_s,
            settle_s=self.settle_s,
        )
        bench.add(name, wheel)
        bench.filters = Filters(wheel, {slot: held.wavelength_nm for slot, held in self.filters.items()})

    def unlike(self, simulated: SimulatedDevice) -> Iterator[SectionFault]:
        """Whether the wheels are of one size, with filters of the same wavelengths in the same slots."""
        assert isinstance(simulated, ThorlabsFw102cFiltersDevice)
        if simulated.positions != self.positions:
            yield ("positions",), f"got {simulated.positions}; allowed: {self.positions}"
        held = {slot: one.wavelength_nm for slot, one in self.filters.items()}
        there = {slot: one.wavelength_nm for slot, one in simulated.filters.items()}
        if there != held:
            told = ", ".join(f"{wavelength_nm:g} nm in slot {slot}" for slot, wavelength_nm in sorted(held.items()))
            yield ("filters",), f"are others than the rig says; allowed: {told}"
