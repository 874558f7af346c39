"""From a rig file to connected drivers in their roles."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager

from acquisition.engine import Bench
from drivers.clock import Clock
from drivers.interlock import Interlock
from drivers.wire.wire_log import WireLog
from goniometer.rig_devices.connecting import Connecting
from goniometer.rig_devices.entry import PLACING
from goniometer.rig_file import Rig


@contextmanager
def connected(
    rig: Rig, ports: Mapping[str, str], clock: Clock, wavelength_nm: float | None, wire_log: WireLog | None = None
) -> Iterator[Bench]:
    """Connect every device of a rig, and close them all afterwards; nothing moves.

    Parameters
    ----------
    rig : Rig
        The rig file.
    ports : mapping of str to str
        The port of each device, by the device's name.
    clock : Clock
        The bench's clock.
    wavelength_nm : float or None
        Told to detectors whose response depends on it; None leaves them the one that they have.
    wire_log : WireLog, optional
        Where every byte is written down.

    Raises
    ------
    DeviceError
        When a device does not answer, or is not what the rig file says.
    """
    with ExitStack() as open_devices:
        bench = Connecting(ports, clock, wavelength_nm, open_devices, wire_log)
        # a rotating analyzer is carried by an axis that another device turns
        for name, entry in sorted(rig.devices.items(), key=lambda item: item[1].part != "axes"):
            entry.connect(name, bench)
        (analyzer,), (detector,) = bench.analyzers.values(), bench.detectors.values()
        axes = bench.axes
        yield Bench(
            axes["source_arm"],
            axes["detector_arm"],
            axes["sample_azimuth"],
            analyzer,
            detector,
            tuple(bench.notes),
            Interlock(rig.zones, {role: axes[role] for role in PLACING if role in axes}),
            axes.get("polarizer"),
            tuple(axes[role] for role, axis in rig.axes().items() if axis.home_at_start),
            axes.get("retarder"),
            bench.identities,
            {role: axis.position_retries for role, axis in rig.axes().items()},
            axes.get("detector_azimuth"),
            next(iter(bench.generators.values()), None),
            tuple(axes[role] for role in rig.generator.carried_by) if rig.generator else (),
            bench.filters,
        )
