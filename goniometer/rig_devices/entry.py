"""What the rig file's devices have in common: a driver, a port, and a part to play on the bench."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, Literal, Self

from pydantic import Field, model_validator

from acquisition.analyzer_matrix import AnalyzerState
from acquisition.detector_noise import NoiseModel
from acquisition.measured_time import time_fault
from acquisition.section import Section, SectionFault, refuse_all
from acquisition.timing import AnalyzerTiming, AxisTiming, DetectorTiming
from drivers.travel import Travel
from goniometer.port_address import Port
from goniometer.rig_devices.connecting import Connecting
from sim_devices.bench_devices.entry import SimulatedDevice

Role = Literal[
    "source_arm",
    "detector_arm",
    "sample_azimuth",
    "detector_azimuth",
    "polarizer",
    "retarder",
    "generator_polarizer",
    "generator_retarder",
]
"""What an axis turns; polarizer and retarder are those of a rotating analyzer, or of a generator in the source arm.

`detector_azimuth` carries the detector arm out of the plane of incidence, about the sample's normal.
"""

ROLES: tuple[Role, ...] = ("source_arm", "detector_arm", "sample_azimuth")
"""The axes that every bench has."""

PLACING: tuple[Role, ...] = (*ROLES, "detector_azimuth")
"""The axes that bring a bench to a direction, in the order of `Target.axes_deg`; not every bench has the last one."""

Angle = Annotated[float, Field(ge=-360, le=360)]
Slot = Angle | Literal["open", "blocked"]
SlotTime = Annotated[float, Field(gt=0, le=10, description="time from one slot to its neighbour, in s")]
HomeOffset = Annotated[
    float | None,
    Field(
        ge=-360,
        le=360,
        description="how far beyond its switch or mark the device must have its zero, in degrees; not checked if "
        "left out",
    ),
]
SettleTime = Annotated[float, Field(ge=0, le=60, description="wait after the analyzer has arrived, in s")]


@dataclass(frozen=True)
class Greeting:
    """A question that changes nothing, what only this device's answer has in it, and how its serial port is set up."""

    question: bytes
    answer: bytes
    baudrate: int = 115200
    parity: Literal["N", "E", "O"] = "N"
    rtscts: bool = False


class DeviceEntry(Section, ABC):
    """A device; a subclass names its family in `driver`, a literal with one value."""

    part: ClassVar[str]
    """What it does on the bench: "axes", "analyzer", "generator" or "detector"."""

    greeting: ClassVar[Greeting | None] = None
    """How `goniometer devices` finds out whether it is there; the project's own families have other questions."""

    opened_by: ClassVar[str] = ""
    """What opens its port, where that is nothing that bytes are sent to."""

    driver: str
    port: Port = Field(
        description="COM3, /dev/ttyUSB0, socket://host:port, modbus-tcp://host:502 for Modbus TCP, or simulated"
    )

    @property
    def place(self) -> str | None:
        """Its address where several devices share the port; None for a device that needs a port of its own."""
        return None

    @property
    def line(self) -> str:
        """What devices that share a port must have in common: the line's protocol, and how its port is set up."""
        return self.driver

    @property
    def carried_by(self) -> tuple[Role, ...]:
        """Axes of other devices that carry it; none for a device that turns by itself, or not at all."""
        return ()

    @abstractmethod
    def connect(self, name: str, bench: Connecting) -> None:
        """Connect the device and give `bench` what it drives; nothing moves."""

    def unlike(self, simulated: SimulatedDevice) -> Iterator[SectionFault]:
        """Where a simulated device of the same family is set up otherwise, and what it should be."""
        return iter(())


class AxisEntry(Section):
    """An axis in its role: how far and how fast it may turn, and when it has arrived."""

    limits_deg: Annotated[tuple[Angle, Angle], Field(strict=False)] = Field(
        description="lowest and highest angle that the axis may be sent to, in degrees"
    )
    velocity_deg_s: float = Field(gt=0, le=1000, description="speed, in degrees per second")
    acceleration_deg_s2: float = Field(gt=0, le=10000, description="acceleration, in degrees per second squared")
    settle_s: float = Field(ge=0, le=60, description="wait after a move until the axis has come to rest, in s")
    tolerance_deg: float = Field(gt=0, le=5, description="how far from its target the axis may stop, in degrees")
    zero_deg: float = Field(
        default=0.0, ge=-360, le=360, description="what the stage reads where the axis is at 0, in degrees"
    )
    zero_stderr_deg: float = Field(
        default=0.0, ge=0, le=5, description="standard error of zero_deg, in degrees; 0: none that a fit should know of"
    )
    zero_measured: str | None = Field(
        default=None, description="when zero_deg was measured, in ISO 8601 with the time zone, in quotes"
    )
    backlash_deg: float = Field(
        default=0.0, ge=0, le=10, description="play of the gear: each target is approached upwards from so far below"
    )
    wraps: bool = Field(
        default=False, description="whether the stage may turn for ever, so that the axis takes the shorter way round"
    )
    position_retries: int = Field(
        default=2,
        ge=0,
        le=10,
        description="how often the axis is sent again when it stops outside its tolerance, by ten tolerances at most; "
        "then the scan ends",
    )
    home_at_start: bool = Field(
        default=False,
        description="whether every scan first searches the home position, for stages that forget it; the axis may turn "
        "all the way round",
    )

    @model_validator(mode="after")
    def _check_limits(self) -> Self:
        refuse_all([*self._limit_faults(), *self._zero_faults()])
        return self

    def _zero_faults(self) -> Iterator[SectionFault]:
        if self.zero_measured is not None and (fault := time_fault(self.zero_measured)):
            yield ("zero_measured",), fault

    def _limit_faults(self) -> Iterator[SectionFault]:
        low, high = self.limits_deg
        if not low < high:
            yield ("limits_deg",), f"got [{low:g}, {high:g}]; allowed: the lowest angle, then a higher one"
        elif self.wraps and high - low < 360:
            yield (
                ("wraps",),
                f"is true, but limits_deg [{low:g}, {high:g}] leave out a part of the turn that the shorter way round "
                "may lead through; allowed: false, or limits 360 degrees apart",
            )
        elif not self.travel.reachable_deg[0] < high:
            yield (
                ("backlash_deg",),
                f"got {self.backlash_deg:g}, which leaves nothing of limits_deg [{low:g}, {high:g}]",
            )

    @property
    def travel(self) -> Travel:
        """How the axis may be moved."""
        return Travel(self.limits_deg, self.settle_s, self.tolerance_deg, self.zero_deg, self.backlash_deg, self.wraps)

    @property
    def timing(self) -> AxisTiming:
        """How long its stage moves, one way."""
        return AxisTiming(self.velocity_deg_s, self.acceleration_deg_s2, self.settle_s)


class AxesEntry(DeviceEntry):
    """A controller of one or more axes."""

    part: ClassVar[str] = "axes"
    exchange_s: ClassVar[float] = 0.01
    """Time of a question and its answer, for planning."""

    start_s: ClassVar[float] = 0.03
    """Time of a move that is neither motion nor the settling that the rig file states, for planning."""

    reports_in_motion: ClassVar[bool] = True
    """Whether it says where its axes are while they move."""

    axes: Mapping[Role, AxisEntry]

    def with_only(self, roles: Collection[Role]) -> Self:
        """The same device with no other axes than these."""
        return self.model_copy(update={"axes": {role: axis for role, axis in self.axes.items() if role in roles}})

    def timing(self) -> dict[Role, AxisTiming]:
        """How long moves of its axes take, by role, with all that belongs to them."""
        return {
            role: replace(axis.timing, exchange_s=self.exchange_s, start_s=self.start_s, backlash_deg=axis.backlash_deg)
            for role, axis in self.axes.items()
        }


class AnalyzerEntry(DeviceEntry):
    """An analyzer with numbered slots."""

    part: ClassVar[str] = "analyzer"

    offset_deg: float = Field(
        default=0.0,
        ge=-180,
        le=180,
        description="added to every angle of polarizer and retarder: the analyzer's zero, from the s-direction, in "
        "degrees",
    )

    @abstractmethod
    def contents(self) -> Mapping[int, Slot]:
        """What each slot holds: a polarizer's angle in degrees, open, or blocked; a retarder's slots left out."""

    def retarded(self) -> Mapping[int, AnalyzerState]:
        """What the slots with a retarder are, their angles as the rig file names them; none if there is no retarder."""
        return {}

    @abstractmethod
    def timing(self, axes: Mapping[Role, AxisTiming]) -> AnalyzerTiming:
        """How long it takes from one slot to another, given the timing of the bench's axes."""


class DetectorEntry(DeviceEntry):
    """A detector of optical power that averages whole samples."""

    part: ClassVar[str] = "detector"
    averages_evenly: ClassVar[bool] = True
    """Whether a reading is the mean of the light over its exposure, which begins at once."""

    sees_whole_spot: ClassVar[bool] = True
    """Whether all of the lit spot is in its field of view, as `Radiometry` has it."""

    sample_s: float = Field(gt=0, le=10, description="duration of one sample, in s; a reading averages whole samples")

    @property
    @abstractmethod
    def most_samples(self) -> int:
        """Samples that one reading averages at most."""

    @abstractmethod
    def noise_model(self, wavelength_nm: float) -> NoiseModel:
        """The noise of its readings."""

    @property
    def timing(self) -> DetectorTiming:
        """How long a reading takes."""
        return DetectorTiming()


class NoiseEntry(Section):
    """The detector's noise, from which every reading gets its weight."""

    read_w: float = Field(gt=0, le=1, description="standard deviation of one sample in the dark, in W")
    shot: bool = Field(description="whether photon noise is added")


class MeterEntry(DetectorEntry):
    """A detector whose noise is stated as it is: of one sample, in watts."""

    noise: NoiseEntry = Field(description="the detector's noise")

    def noise_model(self, wavelength_nm: float) -> NoiseModel:
        """The noise that the rig file states."""
        return NoiseModel(self.noise.read_w, self.sample_s, self.noise.shot, wavelength_nm)


def slot_faults(slots: Mapping[int, Slot], sizes: Sequence[int], whole: str) -> Iterator[SectionFault]:
    """What is wrong with the slots of a wheel or slider, which comes in some sizes: all are to be given."""
    if sorted(slots) not in [list(range(1, size + 1)) for size in sizes]:
        yield (
            ("slots",),
            f"describes the slots {', '.join(map(str, sorted(slots))) or 'none'}; allowed: every slot of the {whole}, "
            f"{' or '.join(f'1 to {size}' for size in sizes)}. Write blocked for a slot that is not used",
        )
    yield from angle_faults(slots)


def angle_faults(slots: Mapping[int, Slot]) -> Iterator[SectionFault]:
    """Polarizer angles that more than one slot holds."""
    first: dict[float, int] = {}
    for slot, content in slots.items():
        if not isinstance(content, str) and first.setdefault(content, slot) != slot:
            yield (
                ("slots", slot),
                f"holds {content:g} degrees, as slot {first[content]} does; allowed: each angle once",
            )
