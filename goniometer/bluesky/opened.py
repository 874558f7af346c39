"""Opens what Bluesky is to use: a bench of real devices, one served elsewhere, or a scene simulated here."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

from acquisition.engine import Bench, stopped_afterwards
from drivers.axis import Axis
from drivers.clock import Clock
from goniometer.assembly import connected
from goniometer.bench import Speed, served_ports, simulate
from goniometer.bench_commands.open_bench import clock_of, reachable_rig
from goniometer.bench_commands.port_lock import held_ports
from goniometer.errors import ConfigurationError
from goniometer.load_files import SceneSetup, Setup, load_file
from goniometer.rig_devices.entry import Role
from goniometer.rig_file import Rig


@dataclass(frozen=True)
class Opened:
    """A connected bench with its clock and its rig."""

    rig: Rig
    bench: Bench
    clock: Clock

    def axis(self, role: Role) -> Axis:
        """The axis in a role."""
        axis = self.bench.axes[role]
        assert isinstance(axis, Axis), "every rig's axis stands above its stage"
        return axis


@contextmanager
def opened_bench(path: Path, speed: Speed | None, wavelength_nm: float | None) -> Iterator[Opened]:
    """Open the bench of a rig or scene while the block lasts; whatever ends the block, every device is stopped.

    Raises
    ------
    ConfigurationError
        When the file is neither, or a speed is given for a bench that is not simulated here.
    DeviceError
        When a device fails, or another process holds its port.
    """
    loaded = load_file(path)
    if isinstance(loaded, Setup):
        raise ConfigurationError([f"{path}: this is a recipe, and a rig or a scene is needed here"])
    with ExitStack() as stack:
        clock: Clock
        if isinstance(loaded, SceneSetup):
            folder = loaded.scene_path.parent
            served = simulate(loaded.scene, 1.0 if speed is None else speed, folder=folder)
            rig, simulated = loaded.rig, stack.enter_context(served)
            clock, ports = simulated.clock, served_ports(rig, simulated)
        else:
            if speed is not None:
                raise ConfigurationError([f"{path}: speed {speed} cannot be kept, for it is no scene simulated here"])
            rig = reachable_rig(path)
            ports = {name: device.port for name, device in rig.devices.items()}
            stack.enter_context(held_ports(ports.values()))
            clock = stack.enter_context(clock_of(rig))
        bench = stack.enter_context(connected(rig, ports, clock, wavelength_nm))
        stack.enter_context(stopped_afterwards(bench, clock))
        yield Opened(rig, bench, clock)
