"""Thorlabs Elliptec modules in a rig file: rotators, and sliders of polarizers."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from acquisition.section import SectionFault, refuse_all
from acquisition.timing import AnalyzerTiming, AxisTiming, SliderTiming
from drivers.thorlabs_elliptec.bus import ElliptecBus
from drivers.thorlabs_elliptec.rotator import ElliptecRotator
from drivers.thorlabs_elliptec.slider import ElliptecSlider
from goniometer.rig_devices.connecting import Connecting
from goniometer.rig_devices.entry import (
    AnalyzerEntry,
    AxesEntry,
    AxisEntry,
    HomeOffset,
    Role,
    SettleTime,
    Slot,
    SlotTime,
    slot_faults,
)
from sim_devices.bench_devices.entry import SimulatedDevice
from sim_devices.bench_devices.thorlabs_elliptec import ThorlabsElliptecDevice, ThorlabsElliptecSliderDevice

Address = Annotated[str, Field(pattern="^[0-9A-F]$", description="the module's address, one hexadecimal digit")]

SLIDER_SIZES = (2, 4)
"""Positions of the ELL6 and of the ELL9."""

_LINE = "elliptec"
_EXCHANGE_S = 0.019
"""A question of 3 characters and an answer of 13, at 9600 baud."""

_SLIDER_S = _EXCHANGE_S + 0.012
"""Where a slider is, and its state: 5 characters more."""

_PAUSE_S = 0.1
"""A module is left alone for so long before it is told to move."""

_LOOKS_S = 0.03
"""Its packets are sent and taken every 20 ms: each of three comes 10 ms late on average."""

_STEP_S = _PAUSE_S + 2 * _EXCHANGE_S + _LOOKS_S


def bus_of(name: str, bench: Connecting) -> ElliptecBus:
    """The line of a module, which others may share."""
    return bench.shared(name, lambda _: ElliptecBus(bench.link(name, baudrate=9600), bench.clock))


class ThorlabsElliptecAxis(AxisEntry):
    """The axis of a rotator."""

    home_offset_deg: HomeOffset = None


class ThorlabsElliptecEntry(AxesEntry):
    """Thorlabs ELL14 or ELL18 rotator; up to 16 modules share a port."""

    driver: Literal["thorlabs_elliptec"] = Field(description="the device's family")
    address: Address = "0"
    axes: dict[Role, ThorlabsElliptecAxis] = Field(min_length=1, max_length=1, description="what it turns, by role")

    reports_in_motion = False
    exchange_s = _EXCHANGE_S
    # besides the pause: whether it is homed before and after, the move's own packets, and its own settling
    start_s = _PAUSE_S + 2 * _EXCHANGE_S + 0.08 + _LOOKS_S

    @property
    def place(self) -> str | None:
        """Its address on the line."""
        return f"address {self.address}"

    @property
    def line(self) -> str:
        """The bus, for modules of all kinds."""
        return _LINE

    def connect(self, name: str, bench: Connecting) -> None:
        """Connect the module."""
        for role, axis in self.axes.items():
            stage = ElliptecRotator(
                bus_of(name, bench),
                int(self.address, 16),
                name=role,
                velocity_deg_s=axis.velocity_deg_s,
                acceleration_deg_s2=axis.acceleration_deg_s2,
                home_offset_deg=axis.home_offset_deg,
            )
            bench.add_axis(name, role, stage, axis.travel)

    def unlike(self, simulated: SimulatedDevice) -> Iterator[SectionFault]:
        """Whether address and axis are the same."""
        assert isinstance(simulated, ThorlabsElliptecDevice)
        if simulated.address != self.address:
            yield ("address",), f"got {simulated.address}; allowed: {self.address}"
        if simulated.axis not in self.axes:
            yield ("axis",), f"got {simulated.axis}; allowed: {', '.join(self.axes)}"


class ThorlabsElliptecSliderEntry(AnalyzerEntry):
    """Thorlabs ELL9 (four slots) or ELL6 (two) with polarizers in its slots."""

    driver: Literal["thorlabs_elliptec_slider"] = Field(description="the device's family")
    address: Address = "0"
    slots: dict[Annotated[int, Field(ge=1, le=4)], Slot] = Field(
        description="what each of the 2 or 4 slots holds: a polarizer's angle in degrees, open, or blocked"
    )
    slot_s: SlotTime
    settle_s: SettleTime

    @model_validator(mode="after")
    def _check_slots(self) -> Self:
        refuse_all(slot_faults(self.slots, SLIDER_SIZES, "slider"))
        return self

    @property
    def place(self) -> str | None:
        """Its address on the line."""
        return f"address {self.address}"

    @property
    def line(self) -> str:
        """The bus, for modules of all kinds."""
        return _LINE

    def contents(self) -> Mapping[int, Slot]:
        """What each slot holds."""
        return self.slots

    def timing(self, axes: Mapping[Role, AxisTiming]) -> AnalyzerTiming:
        """A slider goes from slot to slot."""
        return SliderTiming(self.slot_s + _STEP_S, self.settle_s, _SLIDER_S)

    def connect(self, name: str, bench: Connecting) -> None:
        """Connect the module."""
        slider = ElliptecSlider(
            bus_of(name, bench), int(self.address, 16), name=name, slots=len(self.slots), settle_s=self.settle_s
        )
        bench.add(name, slider)
        bench.analyzers[name] = slider

    def unlike(self, simulated: SimulatedDevice) -> Iterator[SectionFault]:
        """Whether address and number of slots are the same."""
        assert isinstance(simulated, ThorlabsElliptecSliderDevice)
        if simulated.address != self.address:
            yield ("address",), f"got {simulated.address}; allowed: {self.address}"
        if len(simulated.slots) != len(self.slots):
            yield ("slots",), f"hold {len(simulated.slots)} slots; allowed: {len(self.slots)}"
