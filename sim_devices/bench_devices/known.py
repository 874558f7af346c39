"""Every type of device that a scene may hold: the project's own, and those that other packages bring."""

from __future__ import annotations

import inspect
import logging
from importlib.metadata import entry_points
from typing import TYPE_CHECKING, Annotated, Any, Union, get_args

from pydantic import Field

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

_log = logging.getLogger(__name__)

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
    """Every type of device; a package whose offer cannot be used is left out with a warning, and stops nobody else."""
    found = list(_OWN)
    for point in entry_points(group=GROUP):
        try:
            kind = point.load()
            fault = _fault(kind)
        except Exception as error:  # noqa: BLE001 (whatever another package does as it is loaded)
            fault = f"cannot be loaded ({error!r})"
        if fault:
            package = point.dist.name if point.dist else point.value
            _log.warning(
                "the package %s offers the device %s, which %s. It is left out: repair or uninstall it.",
                package,
                point.name,
                fault,
            )
        else:
            found.append(kind)
    return tuple(found)


def _fault(kind: object) -> str:
    """Why something that a package offers cannot be used; empty when it can."""
    if not (isinstance(kind, type) and issubclass(kind, SimulatedDevice)):
        return f"is {kind!r} and no SimulatedDevice"
    if inspect.isabstract(kind):
        return f"is {kind!r} and lacks {', '.join(sorted(kind.__abstractmethods__))}"
    if len(get_args(kind.model_fields["type"].annotation)) != 1:
        return "has no name in a scene: it needs type: Literal[...] with one value"
    return ""


if TYPE_CHECKING:
    AnyDevice = SimulatedDevice
else:
    AnyDevice: Any = Annotated[Union[types()], Field(discriminator="type")]  # noqa: UP007 (made as the program starts)
