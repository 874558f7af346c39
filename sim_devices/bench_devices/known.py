"""Every type of device that a scene may hold: the project's own, and those that other packages bring."""

from __future__ import annotations

from importlib.metadata import entry_points
from typing import TYPE_CHECKING, Annotated, Any, Union

from pydantic import Field

from goniometer.errors import ConfigurationError
from sim_devices.bench_devices.entry import SimulatedDevice
from sim_devices.bench_devices.newport_esp301 import NewportEsp301Device
from sim_devices.bench_devices.oriental_az import OrientalAzDevice
from sim_devices.bench_devices.rotating_polarizer import RotatingPolarizerDevice
from sim_devices.bench_devices.smc_lec import SmcLecDevice
from sim_devices.bench_devices.stanford_sr830 import StanfordSr830Device
from sim_devices.bench_devices.thorlabs_apt import ThorlabsAptDevice
from sim_devices.bench_devices.thorlabs_elliptec import ThorlabsElliptecDevice, ThorlabsElliptecSliderDevice
from sim_devices.bench_devices.thorlabs_fw102c import ThorlabsFw102cDevice
from sim_devices.bench_devices.thorlabs_pm100 import ThorlabsPm100Device

GROUP = "goniometer.sim_devices"
"""The entry point group in which another package names its `SimulatedDevice` classes."""

_OWN: tuple[type[SimulatedDevice], ...] = (
    NewportEsp301Device,
    OrientalAzDevice,
    RotatingPolarizerDevice,
    SmcLecDevice,
    StanfordSr830Device,
    ThorlabsAptDevice,
    ThorlabsElliptecDevice,
    ThorlabsElliptecSliderDevice,
    ThorlabsFw102cDevice,
    ThorlabsPm100Device,
)


def types() -> tuple[type[SimulatedDevice], ...]:
    """Every type of device.

    Raises
    ------
    ConfigurationError
        When another package's entry point cannot be loaded or is no device.
    """
    found = list(_OWN)
    for point in entry_points(group=GROUP):
        offer = f"the package {point.dist.name if point.dist else point.value} offers the device {point.name}, which"
        try:
            kind = point.load()
        except Exception as error:
            raise ConfigurationError([f"{offer} cannot be loaded ({error!r}). Repair or uninstall it."]) from error
        if not (isinstance(kind, type) and issubclass(kind, SimulatedDevice)):
            raise ConfigurationError([f"{offer} is {kind!r} and no SimulatedDevice. Repair or uninstall it."])
        found.append(kind)
    return tuple(found)


if TYPE_CHECKING:
    AnyDevice = SimulatedDevice
else:
    AnyDevice: Any = Annotated[Union[types()], Field(discriminator="type")]  # noqa: UP007 (made as the program starts)
