"""Every kind of device that a rig file may name: the project's own, and those that other packages bring."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, Union

from pydantic import Field

from goniometer.rig_devices.entry import DeviceEntry
from goniometer.rig_devices.filters import ThorlabsFw102cFiltersEntry
from goniometer.rig_devices.genicam_camera import GenicamCameraEntry
from goniometer.rig_devices.http_camera import HttpCameraEntry
from goniometer.rig_devices.newport_esp301 import NewportEsp301Entry
from goniometer.rig_devices.oriental_az import OrientalAzEntry
from goniometer.rig_devices.rotating_generator import RotatingGeneratorEntry
from goniometer.rig_devices.rotating_polarizer import RotatingPolarizerEntry
from goniometer.rig_devices.smc_lec import SmcLecEntry
from goniometer.rig_devices.stanford_sr830 import StanfordSr830Entry
from goniometer.rig_devices.thorlabs_apt import ThorlabsAptEntry
from goniometer.rig_devices.thorlabs_elliptec import ThorlabsElliptecEntry, ThorlabsElliptecSliderEntry
from goniometer.rig_devices.thorlabs_fw102c import ThorlabsFw102cEntry
from goniometer.rig_devices.thorlabs_pm100 import ThorlabsPm100Entry
from goniometer.rig_devices.video_camera import VideoCameraEntry
from sim_devices.bench_devices.offers import names_of, offers

GROUP = "goniometer.drivers"
"""The entry point group in which another package names its `DeviceEntry` classes."""

_OWN: tuple[type[DeviceEntry], ...] = (
    GenicamCameraEntry,
    HttpCameraEntry,
    NewportEsp301Entry,
    OrientalAzEntry,
    RotatingGeneratorEntry,
    RotatingPolarizerEntry,
    SmcLecEntry,
    StanfordSr830Entry,
    ThorlabsAptEntry,
    ThorlabsElliptecEntry,
    ThorlabsElliptecSliderEntry,
    ThorlabsFw102cEntry,
    ThorlabsFw102cFiltersEntry,
    ThorlabsPm100Entry,
    VideoCameraEntry,
)


def kinds() -> tuple[type[DeviceEntry], ...]:
    """Every kind of device; a package whose offer cannot be used is left out with a warning, and stops nobody else."""
    found: dict[str, type[DeviceEntry]] = {driver_of(kind): kind for kind in _OWN}

    def fault(kind: type[DeviceEntry]) -> str:
        if len(names_of(kind, "driver")) != 1:
            return "has no name in a rig file: it needs driver: Literal[...] with one value"
        if found.get(driver_of(kind), kind) is not kind:
            return f"has the name of another, {driver_of(kind)}"
        return ""

    for kind in offers(GROUP, DeviceEntry, "driver", fault):  # type: ignore[type-abstract]  # it makes none of them
        found[driver_of(kind)] = kind
    return tuple(found.values())


def driver_of(kind: type[DeviceEntry]) -> str:
    """The value of `driver` that names a kind of device; raises ValueError when there is not exactly one."""
    (name,) = names_of(kind, "driver")
    return name


if TYPE_CHECKING:
    AnyDevice = DeviceEntry
else:
    AnyDevice: Any = Annotated[Union[kinds()], Field(discriminator="driver")]  # noqa: UP007 (made as the program starts)
