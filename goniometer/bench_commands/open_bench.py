"""A bench opened for one command: its ports held, every device connected, everything stopped on the way out."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, closing, contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import get_args

from acquisition.engine import Bench, stopped_afterwards
from acquisition.protocols import Analyzer
from acquisition.timing import POLL_S
from drivers.axis import Axis
from drivers.clock import Clock, WallClock
from goniometer.assembly import connected
from goniometer.bench_commands.port_lock import held_ports
from goniometer.errors import ConfigurationError
from goniometer.load_files import load_rig
from goniometer.rig_devices.entry import Role
from goniometer.rig_file import Rig
from goniometer.signals import Interruption
from sim_devices.serving.control import RemoteClock

Tell = Callable[[str], None]
"""Takes a line for the person who waits."""

_SLICE_S = 0.1
"""Longest time between two checks for an interruption."""


@dataclass(frozen=True)
class OpenBench:
    """A connected bench; `check` raises ScanInterrupted once the command was asked to end."""

    rig: Rig
    bench: Bench
    clock: Clock
    check: Callable[[], None]

    @property
    def roles(self) -> list[Role]:
        """The roles of the bench's axes, the arms first."""
        return [role for role in get_args(Role) if role in self.rig.axes()]

    def axis(self, role: Role) -> Axis:
        """The axis in a role; raises ConfigurationError for one that the rig does not have."""
        axis = self.bench.polarizer if role == "polarizer" else self.bench.axes[role]
        if axis is None:
            raise ConfigurationError([f"The rig {self.rig.rig!r} has no axis {role}. Nothing was moved."])
        assert isinstance(axis, Axis), "every rig's axis stands above its stage"
        return axis

    def wait(self, duration_s: float) -> None:
        """Let time pass on the bench's clock; raises ScanInterrupted soon after the command was asked to end."""
        while duration_s > 0.0:
            self.check()
            slice_s = min(duration_s, _SLICE_S)
            self.clock.sleep(slice_s)
            duration_s -= slice_s
        self.check()

    def until_at_rest(self, device: Axis | Analyzer, look: Callable[[], None] = lambda: None) -> None:
        """Wait until a device has arrived and settled; `look` is called between any two polls."""
        self.wait(POLL_S)
        while device.is_moving():
            look()
            self.wait(POLL_S)
        self.wait(device.settle_s)


@contextmanager
def open_bench(rig_path: Path, note: Tell) -> Iterator[OpenBench]:
    """Open the bench of a rig file while the block lasts; whatever ends the block, every device is stopped.

    Parameters
    ----------
    rig_path : Path
        The rig file: of real devices, or as printed by `goniometer simulate`.
    note : callable
        Takes what devices said on connecting.

    Raises
    ------
    ConfigurationError
        When the rig file cannot be used; nothing was opened.
    DeviceError
        When a device fails, or another process holds its port.
    ScanInterrupted
        On Ctrl-C, SIGTERM or SIGHUP.
    """
    rig = reachable_rig(rig_path)
    ports = {name: device.port for name, device in rig.devices.items()}
    with ExitStack() as stack:
        interruption = stack.enter_context(Interruption())
        stack.enter_context(held_ports(ports.values()))
        clock = stack.enter_context(clock_of(rig))
        bench = stack.enter_context(connected(rig, ports, clock, None))
        for line in bench.notes:
            note(f"note: {line}")
        interruption.check()
        stack.enter_context(stopped_afterwards(bench, clock))
        yield OpenBench(rig, bench, clock, interruption.check)


def reachable_rig(path: Path) -> Rig:
    """Read a rig file whose devices can be reached from here; raises ConfigurationError."""
    rig = load_rig(path)
    if rig.is_simulated:
        raise ConfigurationError(
            [
                f"{path}: its devices are simulated by whichever program runs a scan, so there is nothing to reach. "
                "Serve a bench with: goniometer simulate SCENE > bench.yaml, and give that file"
            ]
        )
    return rig


def clock_of(rig: Rig) -> AbstractContextManager[Clock]:
    """The clock of a rig's bench: that of the process that serves it, or real time."""
    return nullcontext(WallClock()) if rig.bench is None else closing(RemoteClock(rig.bench))
