"""The rig file: which devices a bench has, where they are connected, and what is known about them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Self

from pydantic import Field, model_validator

from acquisition.imaging.place.holder import HolderEntry
from acquisition.section import Section, SectionFault, refuse_all
from drivers.collision_zones import Zone
from goniometer.collision_zones import ZoneEntry
from goniometer.port_address import LoopbackAddress
from goniometer.rig_devices.entry import (
    PLACING,
    ROLES,
    AnalyzerEntry,
    AxesEntry,
    AxisEntry,
    DetectorEntry,
    DeviceEntry,
    Role,
)
from goniometer.rig_devices.filters import FiltersEntry
from goniometer.rig_devices.known import AnyDevice
from goniometer.rig_devices.rotating_polarizer import RotatingPolarizerEntry


class Calibration(Section):
    """What turns detector power into reflectance in 1/sr."""

    beam_power_w: float = Field(gt=0, le=1000, description="power of the beam on the sample, in W")
    acceptance_sr: float = Field(gt=0, le=6.2831853, description="solid angle that the detector accepts, in sr")


class Rig(Section):
    """A bench: its devices and its calibration."""

    rig: str = Field(min_length=1, description="name of the bench, for a person")
    devices: dict[str, AnyDevice] = Field(description="the bench's devices, each under a name of your choice")
    calibration: Calibration = Field(description="what turns detector power into reflectance")
    holder: HolderEntry | None = Field(
        default=None, description="the markers on the sample's holder, from which a camera knows where the sample is"
    )
    collision_zones: Annotated[tuple[ZoneEntry, ...], Field(strict=False)] = Field(
        default=(), description="angles at which parts of the bench would touch; no path may enter one"
    )
    bench: LoopbackAddress | None = Field(
        default=None,
        description="socket://127.0.0.1:PORT of the bench that goniometer simulate serves in another process",
    )

    @model_validator(mode="after")
    def _check(self) -> Self:
        faults = *self._role_faults(), *self._kind_faults(), *self._port_faults(), *self._zone_faults()
        refuse_all([*faults, *self._turning_faults()])
        return self

    def _role_faults(self) -> Iterator[SectionFault]:
        needed = (*ROLES, *(role for device in self.devices.values() for role in device.carried_by))
        holders: dict[Role, list[str]] = {}
        for name, device in self.devices.items():
            if isinstance(device, AxesEntry):
                for role in device.axes:
                    holders.setdefault(role, []).append(name)
        for role in needed:
            if role not in holders:
                yield ("devices",), f"no device has the axis {role}; a bench needs {', '.join(needed)}, each once"
        for role, names in holders.items():
            for name in names:
                if role not in (*needed, *PLACING):
                    carried = "rotating_generator" if role.startswith("generator") else "rotating_polarizer"
                    yield ("devices", name, "axes", role), f"carries nothing; allowed: with driver: {carried}"
            for name in names[1:]:
                yield ("devices", name, "axes", role), f"{names[0]} has the axis {role} too; allowed: each axis once"

    def _kind_faults(self) -> Iterator[SectionFault]:
        for part, example in (
            ("analyzer", "thorlabs_fw102c"),
            ("detector", "thorlabs_pm100"),
        ):
            names = [name for name, device in self.devices.items() if device.part == part]
            if not names:
                yield ("devices",), f"there is no {part}; a bench needs exactly one, for example driver: {example}"
            for name in names[1:]:
                yield ("devices", name), f"is a second {part} beside {names[0]}; allowed: exactly one"
        generators = [name for name, device in self.devices.items() if device.part == "generator"]
        for name in generators[1:]:
            yield ("devices", name), f"is a second generator beside {generators[0]}; allowed: one, or none"
        wheels = [name for name, device in self.devices.items() if device.part == "filter"]
        for name in wheels[1:]:
            yield ("devices", name), f"is a second wheel of filters beside {wheels[0]}; allowed: at most one"

    def _port_faults(self) -> Iterator[SectionFault]:
        first: dict[tuple[str, str | None], str] = {}
        ports: dict[str, str] = {}
        for name, device in self.devices.items():
            if device.port in ("", "simulated"):
                continue
            neighbour = ports.setdefault(device.port, name)
            other = first.setdefault((device.port, device.place), name)
            if other != name and device.place is not None:
                yield (
                    ("devices", name),
                    f"has {device.place} on port '{device.port}', as {other} has; allowed: one each",
                )
            elif neighbour != name and not self._share(device, self.devices[neighbour]):
                yield (
                    ("devices", name, "port"),
                    f"got '{device.port}', which {neighbour} uses too; allowed: one device a port, unless both have "
                    "addresses on a line of one kind, speed and parity",
                )
        real = sorted(ports)
        for name, device in self.devices.items():
            if device.port == "simulated" and self.bench is not None:
                yield (
                    ("devices", name, "port"),
                    f"got simulated, but the bench at {self.bench} serves the devices; write the address it printed",
                )
            elif device.port == "simulated" and real:
                yield (
                    ("devices", name, "port"),
                    f"got simulated, but {ports[real[0]]} is real; allowed: all devices simulated, or none, because a "
                    "simulated device does not see what a real one does",
                )

    @property
    def is_simulated(self) -> bool:
        """Whether this process must simulate the bench."""
        return any(device.port == "simulated" for device in self.devices.values())

    def _zone_faults(self) -> Iterator[SectionFault]:
        axes = self.axes()
        for number, entry in enumerate(self.collision_zones):
            for role in entry.ranges_deg():
                if role == "detector_azimuth" and role not in axes:
                    yield ("collision_zones", number, role), "is about an axis that no device has; leave it out"
                if role in axes and axes[role].wraps:
                    yield (
                        ("collision_zones", number, role),
                        "wraps, so that its way is not known beforehand; allowed: axes with wraps: false",
                    )
            for role in entry.roles():
                if role in axes and axes[role].home_at_start:
                    yield (
                        ("collision_zones", number),
                        f"leaves no safe way home for {role}: where it goes on that way is not known beforehand. Write "
                        f"home_at_start: false, and before a scan: goniometer home --axis {role}",
                    )

    def _turning_faults(self) -> Iterator[SectionFault]:
        axes = self.axes()
        for name, device in self.devices.items():
            if isinstance(device, RotatingPolarizerEntry):
                yield from ((("devices", name, *place), what) for place, what in device.limit_faults(axes))

    @staticmethod
    def _share(one: DeviceEntry, other: DeviceEntry) -> bool:
        return one.line == other.line and None not in (one.place, other.place)

    @property
    def zones(self) -> tuple[Zone, ...]:
        """What no path may enter."""
        return tuple(entry.zone() for entry in self.collision_zones)

    @property
    def analyzer(self) -> AnalyzerEntry:
        """The bench's analyzer."""
        return next(device for device in self._selectors() if device.part == "analyzer")

    @property
    def generator(self) -> AnalyzerEntry | None:
        """What polarizes the light on the sample; None where it is unpolarized."""
        return next((device for device in self._selectors() if device.part == "generator"), None)

    def _selectors(self) -> Iterator[AnalyzerEntry]:
        return (device for device in self.devices.values() if isinstance(device, AnalyzerEntry))

    @property
    def detector(self) -> DetectorEntry:
        """The bench's detector."""
        return next(device for device in self.devices.values() if isinstance(device, DetectorEntry))

    @property
    def filters(self) -> FiltersEntry | None:
        """What chooses the wavelength; None where the light has one of its own."""
        return next((device for device in self.devices.values() if isinstance(device, FiltersEntry)), None)

    def beam_power_w(self, wavelength_nm: float) -> float:
        """Power of the beam on the sample at a wavelength, in W."""
        filters = {} if self.filters is None else self.filters.filters
        powers_w = {held.wavelength_nm: held.beam_power_w for held in filters.values()}
        return powers_w.get(wavelength_nm) or self.calibration.beam_power_w

    def axes(self) -> dict[Role, AxisEntry]:
        """All axes by role."""
        return {
            role: axis
            for device in self.devices.values()
            if isinstance(device, AxesEntry)
            for role, axis in device.axes.items()
        }
