"""From a rig file to connected drivers in their roles."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager

from acquisition.engine import Bench
from acquisition.protocols import RotaryAxis
from drivers.clock import Clock
from drivers.link import Link
from drivers.newport_esp301 import NewportEsp301
from drivers.oriental_az import OrientalAz
from drivers.thorlabs_fw102c import ThorlabsFw102c
from drivers.thorlabs_pm100 import ThorlabsPm100
from goniometer.rig_file import NewportEsp301Entry, OrientalAzEntry, Rig, ThorlabsFw102cEntry, ThorlabsPm100Entry


@contextmanager
def connected(rig: Rig, ports: Mapping[str, str], clock: Clock, wavelength_nm: float) -> Iterator[Bench]:
    """Connect every device of a rig, and close them all afterwards; nothing moves.

    Parameters
    ----------
    rig : Rig
        The rig file.
    ports : mapping of str to str
        The port of each device, by the device's name.
    clock : Clock
        The bench's clock.
    wavelength_nm : float
        Told to detectors whose response depends on it.

    Raises
    ------
    DeviceError
        When a device does not answer, or is not what the rig file says.
    """
    with ExitStack() as open_devices:
        axes: dict[str, RotaryAxis] = {}
        notes: list[str] = []
        for name, entry in rig.devices.items():
            port = ports[name]
            match entry:
                case NewportEsp301Entry():
                    axes |= _connect_esp301(open_devices, name, entry, port, clock, notes)
                case OrientalAzEntry():
                    axes |= _connect_az(open_devices, name, entry, port, clock)
                case ThorlabsFw102cEntry():
                    analyzer = ThorlabsFw102c(
                        Link(port, device=name, baudrate=entry.baudrate),
                        clock,
                        name=name,
                        slots=len(entry.slots),
                        slot_s=entry.slot_s,
                        settle_s=entry.settle_s,
                    )
                    open_devices.callback(analyzer.close)
                    analyzer.connect()
                case ThorlabsPm100Entry():
                    detector = ThorlabsPm100(Link(port, device=name), clock, name=name, sample_s=entry.sample_s)
                    open_devices.callback(detector.close)
                    notes += _left_over(name, detector.connect())
                    detector.set_wavelength_nm(wavelength_nm)
        yield Bench(axes["source_arm"], axes["detector_arm"], axes["sample_azimuth"], analyzer, detector, tuple(notes))


def _connect_esp301(
    open_devices: ExitStack, name: str, entry: NewportEsp301Entry, port: str, clock: Clock, notes: list[str]
) -> dict[str, RotaryAxis]:
    controller = NewportEsp301(Link(port, device=name, baudrate=entry.baudrate, rtscts=True), clock)
    open_devices.callback(controller.close)
    notes += _left_over(name, controller.connect())
    axes: dict[str, RotaryAxis] = {}
    for role, axis in entry.axes.items():
        driver = controller.axis(
            axis.axis,
            name=role,
            limits_deg=axis.limits_deg,
            velocity_deg_s=axis.velocity_deg_s,
            acceleration_deg_s2=axis.acceleration_deg_s2,
            settle_s=axis.settle_s,
            tolerance_deg=axis.tolerance_deg,
        )
        driver.connect()
        axes[role] = driver
    return axes


def _connect_az(
    open_devices: ExitStack, name: str, entry: OrientalAzEntry, port: str, clock: Clock
) -> dict[str, RotaryAxis]:
    axes: dict[str, RotaryAxis] = {}
    for role, axis in entry.axes.items():
        driver = OrientalAz(
            port,
            clock,
            name=role,
            unit=entry.unit,
            steps_per_deg=axis.steps_per_deg,
            limits_deg=axis.limits_deg,
            velocity_deg_s=axis.velocity_deg_s,
            acceleration_deg_s2=axis.acceleration_deg_s2,
            settle_s=axis.settle_s,
            tolerance_deg=axis.tolerance_deg,
            baudrate=entry.baudrate,
            parity=entry.parity[0].upper(),
        )
        open_devices.callback(driver.close)
        driver.connect()
        axes[role] = driver
    return axes


def _left_over(name: str, errors: tuple[str, ...]) -> list[str]:
    return [f"{name}: an error was left in its queue from earlier use: {error}" for error in errors]
