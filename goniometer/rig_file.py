"""The rig file: which devices a bench has, where they are connected, and what is known about them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from acquisition.section import Section, SectionFault, refuse_all
from goniometer.port_address import LoopbackAddress, Port

Role = Literal["source_arm", "detector_arm", "sample_azimuth"]
ROLES: tuple[Role, ...] = ("source_arm", "detector_arm", "sample_azimuth")
WHEEL_SIZES = (6, 12)
"""Positions of the FW102C and of the FW212C."""


Angle = Annotated[float, Field(ge=-360, le=360)]
Slot = Angle | Literal["open", "blocked"]


class AxisEntry(Section):
    """An axis in its role: how far and how fast it may turn, and when it has arrived."""

    limits_deg: Annotated[tuple[Angle, Angle], Field(strict=False)] = Field(
        description="lowest and highest angle that the axis may be sent to, in degrees"
    )
    velocity_deg_s: float = Field(gt=0, le=1000, description="speed, in degrees per second")
    acceleration_deg_s2: float = Field(gt=0, le=10000, description="acceleration, in degrees per second squared")
    settle_s: float = Field(ge=0, le=60, description="wait after a move until the axis has come to rest, in s")
    tolerance_deg: float = Field(gt=0, le=5, description="how far from its target the axis may stop, in degrees")

    @model_validator(mode="after")
    def _check_limits(self) -> Self:
        low, high = self.limits_deg
        if not low < high:
            refuse_all([(("limits_deg",), f"got [{low:g}, {high:g}]; allowed: the lowest angle, then a higher one")])
        return self


class NewportEsp301Axis(AxisEntry):
    """One axis of a Newport ESP301."""

    axis: int = Field(ge=1, le=3, description="number of the axis on the controller's back")


class OrientalAzAxis(AxisEntry):
    """The axis of an Oriental Motor AZ drive."""

    steps_per_deg: float = Field(gt=0, le=1_000_000, description="motor steps in one degree of the stage")


class NewportEsp301Entry(Section):
    """Newport ESP301 (or ESP300) motion controller with one to three rotation stages."""

    driver: Literal["newport_esp301"] = Field(description="the device's family")
    port: Port = Field(description="COM3, /dev/ttyUSB0, socket://host:port, or simulated")
    baudrate: Literal[19200, 921600] = Field(
        default=19200, description="19200 on RS-232, 921600 on the ESP301's USB; without effect on a socket"
    )
    axes: dict[Role, NewportEsp301Axis] = Field(min_length=1, description="the controller's axes, by role")

    @model_validator(mode="after")
    def _check_axes(self) -> Self:
        numbers = Counter(axis.axis for axis in self.axes.values())
        refuse_all(
            (("axes", role, "axis"), f"got {axis.axis}, which another axis of this controller has too")
            for role, axis in self.axes.items()
            if numbers[axis.axis] > 1
        )
        return self


class OrientalAzEntry(Section):
    """Oriental Motor AZ stepper drive on Modbus RTU."""

    driver: Literal["oriental_az"] = Field(description="the device's family")
    port: Port = Field(description="COM3, /dev/ttyUSB0, socket://host:port, or simulated")
    unit: int = Field(ge=1, le=31, description="Modbus address, as set by the drive's switch")
    baudrate: Literal[9600, 19200, 38400, 57600, 115200, 230400] = Field(
        default=115200, description="as set in the drive; without effect on a socket"
    )
    parity: Literal["even", "odd", "none"] = Field(
        default="even", description="as set in the drive; without effect on a socket"
    )
    axes: dict[Role, OrientalAzAxis] = Field(min_length=1, max_length=1, description="the drive's axis, by role")


class ThorlabsFw102cEntry(Section):
    """Thorlabs FW102C or FW212C filter wheel with polarizers in its slots."""

    driver: Literal["thorlabs_fw102c"] = Field(description="the device's family")
    port: Port = Field(description="COM3, /dev/ttyUSB0, socket://host:port, or simulated")
    baudrate: Literal[9600, 115200] = Field(
        default=115200, description="as set in the wheel; without effect on a socket"
    )
    slots: dict[Annotated[int, Field(ge=1, le=12)], Slot] = Field(
        description="what each of the 6 or 12 slots holds: a polarizer's angle in degrees, open, or blocked"
    )
    offset_deg: float = Field(
        default=0.0,
        ge=-180,
        le=180,
        description="added to every polarizer angle: the analyzer's zero, from the s-direction, in degrees",
    )
    slot_s: float = Field(gt=0, le=10, description="time from one slot to its neighbour, in s")
    settle_s: float = Field(ge=0, le=60, description="wait after the wheel has arrived, in s")

    @model_validator(mode="after")
    def _check_slots(self) -> Self:
        refuse_all(self._slot_faults())
        return self

    def _slot_faults(self) -> Iterator[SectionFault]:
        if sorted(self.slots) not in [list(range(1, size + 1)) for size in WHEEL_SIZES]:
            yield (
                ("slots",),
                f"describes the slots {', '.join(map(str, sorted(self.slots))) or 'none'}; allowed: every slot of the "
                "wheel, 1 to 6 or 1 to 12. Write blocked for a slot that is not used",
            )
        first: dict[float, int] = {}
        for slot, content in self.slots.items():
            if not isinstance(content, str) and first.setdefault(content, slot) != slot:
                yield (
                    ("slots", slot),
                    f"holds {content:g} degrees, as slot {first[content]} does; allowed: each angle once",
                )


class NoiseEntry(Section):
    """The detector's noise, from which every reading gets its weight."""

    read_w: float = Field(gt=0, le=1, description="standard deviation of one sample in the dark, in W")
    shot: bool = Field(description="whether photon noise is added")


class ThorlabsPm100Entry(Section):
    """Thorlabs PM100-family power meter."""

    driver: Literal["thorlabs_pm100"] = Field(description="the device's family")
    port: Port = Field(description="COM3, /dev/ttyUSB0, socket://host:port, or simulated")
    sample_s: float = Field(gt=0, le=10, description="duration of one sample, in s; a reading averages whole samples")
    noise: NoiseEntry = Field(description="the detector's noise")

    @property
    def most_samples(self) -> int:
        """Samples that the meter averages at most."""
        return 3000


DeviceEntry = Annotated[
    NewportEsp301Entry | OrientalAzEntry | ThorlabsFw102cEntry | ThorlabsPm100Entry,
    Field(discriminator="driver"),
]


class Calibration(Section):
    """What turns detector power into reflectance in 1/sr."""

    beam_power_w: float = Field(gt=0, le=1000, description="power of the beam on the sample, in W")
    acceptance_sr: float = Field(gt=0, le=6.2831853, description="solid angle that the detector accepts, in sr")


class Rig(Section):
    """A bench: its devices and its calibration."""

    rig: str = Field(min_length=1, description="name of the bench, for a person")
    devices: dict[str, DeviceEntry] = Field(description="the bench's devices, each under a name of your choice")
    calibration: Calibration = Field(description="what turns detector power into reflectance")
    bench: LoopbackAddress | None = Field(
        default=None,
        description="socket://127.0.0.1:PORT of the bench that goniometer simulate serves in another process",
    )

    @model_validator(mode="after")
    def _check(self) -> Self:
        refuse_all([*self._role_faults(), *self._kind_faults(), *self._port_faults()])
        return self

    def _role_faults(self) -> Iterator[SectionFault]:
        holders: dict[Role, list[str]] = {role: [] for role in ROLES}
        for name, device in self.devices.items():
            if isinstance(device, NewportEsp301Entry | OrientalAzEntry):
                for role in device.axes:
                    holders[role].append(name)
        for role, names in holders.items():
            if not names:
                yield ("devices",), f"no device has the axis {role}; a bench needs {', '.join(ROLES)}, each once"
            for name in names[1:]:
                yield ("devices", name, "axes", role), f"{names[0]} has the axis {role} too; allowed: each axis once"

    def _kind_faults(self) -> Iterator[SectionFault]:
        for kind, what, example in (
            (ThorlabsFw102cEntry, "analyzer", "thorlabs_fw102c"),
            (ThorlabsPm100Entry, "detector", "thorlabs_pm100"),
        ):
            names = [name for name, device in self.devices.items() if isinstance(device, kind)]
            if not names:
                yield ("devices",), f"there is no {what}; a bench needs exactly one, for example driver: {example}"
            for name in names[1:]:
                yield ("devices", name), f"is a second {what} beside {names[0]}; allowed: exactly one"

    def _port_faults(self) -> Iterator[SectionFault]:
        first: dict[str, str] = {}
        for name, device in self.devices.items():
            other = first.setdefault(device.port, name)
            if device.port != "simulated" and other != name:
                yield (
                    ("devices", name, "port"),
                    f"got '{device.port}', which {other} uses too; allowed: one device a port",
                )
        real = sorted(set(first) - {"simulated"})
        for name, device in self.devices.items():
            if device.port == "simulated" and self.bench is not None:
                yield (
                    ("devices", name, "port"),
                    f"got simulated, but the bench at {self.bench} serves the devices; write the address it printed",
                )
            elif device.port == "simulated" and real:
                yield (
                    ("devices", name, "port"),
                    f"got simulated, but {first[real[0]]} is real; allowed: all devices simulated, or none, because a "
                    "simulated device does not see what a real one does",
                )

    @property
    def is_simulated(self) -> bool:
        """Whether this process must simulate the bench."""
        return any(device.port == "simulated" for device in self.devices.values())

    @property
    def analyzer(self) -> ThorlabsFw102cEntry:
        """The bench's analyzer."""
        return next(device for device in self.devices.values() if isinstance(device, ThorlabsFw102cEntry))

    @property
    def detector(self) -> ThorlabsPm100Entry:
        """The bench's detector."""
        return next(device for device in self.devices.values() if isinstance(device, ThorlabsPm100Entry))

    def axes(self) -> dict[Role, AxisEntry]:
        """All axes by role."""
        return {
            role: axis
            for device in self.devices.values()
            if isinstance(device, NewportEsp301Entry | OrientalAzEntry)
            for role, axis in device.axes.items()
        }
