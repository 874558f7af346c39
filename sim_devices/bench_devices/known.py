"""Every type of device that a scene may hold: the project's own, and those that other packages bring."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, Union

from pydantic import Field

from sim_devices.bench_devices.entry import SimulatedDevice
from sim_devices.bench_devices.filters import ThorlabsFw102cFiltersDevice
from sim_devices.bench_devices.http_camera import HttpCameraDevice
from sim_devices.bench_devices.newport_esp301 import NewportEsp301Device
from sim_devices.bench_devices.offers import names_of, offers
from sim_devices.bench_devices.oriental_az import OrientalAzDevice
from sim_devices.bench_devices.rotating_generator import RotatingGeneratorDevice
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
    HttpCameraDevice,
    NewportEsp301Device,
    OrientalAzDevice,
    RotatingGeneratorDevice,
    RotatingPolarizerDevice,
    SmcLecDevice,
    StanfordSr830Device,
    ThorlabsAptDevice,
    ThorlabsElliptecDevice,
    ThorlabsElliptecSliderDevice,
    ThorlabsFw102cDevice,
    ThorlabsFw102cFiltersDevice,
    ThorlabsPm100Device,
)


def types() -> tuple[type[SimulatedDevice], ...]:
    """Every type of device; a package whose offer cannot be used is left out with a warning, and stops nobody else."""

    def fault(kind: type[SimulatedDevice]) -> str:
        is_named = len(names_of(kind, "type")) == 1
        return "" if is_named else "has no name in a scene: it needs type: Literal[...] with one value"

    return (*_OWN, *offers(GROUP, SimulatedDevice, "device", fault))  # type: ignore[type-abstract]  # it makes none


if TYPE_CHECKING:
    AnyDevice = SimulatedDevice
else:
    AnyDevice: Any = Annotated[Union[types()], Field(discriminator="type")]  # noqa: UP007 (made as the program starts)
