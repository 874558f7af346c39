"""Every kind of device that a rig file may name: the project's own, and those that other packages bring."""

from __future__ import annotations

from importlib.metadata import entry_points
from typing import TYPE_CHECKING, Annotated, Any, Union

from pydantic import Field

from goniometer.errors import ConfigurationError
from goniometer.rig_devices.entry import DeviceEntry
from goniometer.rig_devices.newport_esp301 import NewportEsp301Entry
from goniometer.rig_devices.oriental_az import OrientalAzEntry
from goniometer.rig_devices.rotating_polarizer import RotatingPolarizerEntry
from goniometer.rig_devices.smc_lec import SmcLecEntry
from goniometer.rig_devices.stanford_sr830 import StanfordSr830Entry
from goniometer.rig_devices.thorlabs_apt import ThorlabsAptEntry
from goniometer.rig_devices.thorlabs_elliptec import ThorlabsElliptecEntry, ThorlabsElliptecSliderEntry
from goniometer.rig_devices.thorlabs_fw102c import ThorlabsFw102cEntry
from goniometer.rig_devices.thorlabs_pm100 import ThorlabsPm100Entry

GROUP = "goniometer.drivers"
"""The entry point group in which another package names its `DeviceEntry` classes."""

_OWN: tuple[type[DeviceEntry], ...] = (
    NewportEsp301Entry,
    OrientalAzEntry,
    RotatingPolarizerEntry,
    SmcLecEntry,
    StanfordSr830Entry,
    ThorlabsAptEntry,
    ThorlabsElliptecEntry,
    ThorlabsElliptecSliderEntry,
    ThorlabsFw102cEntry,
    ThorlabsPm100Entry,
)


def kinds() -> tuple[type[DeviceEntry], ...]:
    """Every kind of device.

    Raises
    ------
    ConfigurationError
        When another package's entry point cannot be loaded or is no device.
    """
    found: dict[str, type[DeviceEntry]] = {driver_of(kind): kind for kind in _OWN}
    for point in entry_points(group=GROUP):
        offer = f"the package {point.dist.name if point.dist else point.value} offers the driver {point.name}, which"
        try:
            kind = point.load()
        except Exception as error:
            raise ConfigurationError([f"{offer} cannot be loaded ({error!r}). Repair or uninstall it."]) from error
        if not (isinstance(kind, type) and issubclass(kind, DeviceEntry)):
            raise ConfigurationError([f"{offer} is {kind!r} and no DeviceEntry. Repair or uninstall it."])
        if found.setdefault(driver_of(kind), kind) is not kind:
            raise ConfigurationError([f"{offer} has the name of another, {driver_of(kind)}. Rename it there."])
    return tuple(found.values())


def driver_of(kind: type[DeviceEntry]) -> str:
    """The value of `driver` that names a kind of device."""
    (name,) = kind.model_fields["driver"].annotation.__args__  # type: ignore[union-attr]
    return str(name)


if TYPE_CHECKING:
    AnyDevice = DeviceEntry
else:
    AnyDevice: Any = Annotated[Union[kinds()], Field(discriminator="driver")]  # noqa: UP007 (made as the program starts)
