"""What one command needs of a bench, opened: ports held, devices connected, everything stopped on the way out."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import AbstractContextManager, ExitStack, closing, contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import get_args

from acquisition.engine import stopped_afterwards
from acquisition.protocols import Analyzer, Detector
from acquisition.stopping import stop_all
from acquisition.timing import POLL_S
from drivers.axis import Axis
from drivers.clock import Clock, WallClock
from drivers.interlock import Interlock
from drivers.wire.wire_log import WireLog
from goniometer.assembly import connected
from goniometer.bench_commands.port_lock import held_ports
from goniometer.collision_zones import ZoneEntry
from goniometer.errors import ConfigurationError
from goniometer.load_files import load_rig
from goniometer.rig_devices.connecting import Connecting
from goniometer.rig_devices.entry import AxesEntry, Role
from goniometer.rig_file import Rig
from goniometer.signals import Interruption
from goniometer.wire_trace import wire_log
from sim_devices.serving.remote_clock import RemoteClock

Tell = Callable[[str], None]
"""Takes a line for the person who waits."""

_SLICE_S = 0.1
"""Longest time between two checks for an interruption."""


@dataclass(frozen=True)
class OpenAxes:
    """Connected axes; `check` raises ScanInterrupted once the command was asked to end."""

    rig: Rig
    axes: Mapping[str, Axis]
    clock: Clock
    check: Callable[[], None]

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

    def stop(self, clock: Clock) -> list[BaseException]:
        """Stop the axes and see them come to rest; returns what failed."""
        return list(stop_all(list(self.axes.values()), clock).values())


@dataclass(frozen=True)
class OpenBench(OpenAxes):
    """A connected bench: its axes, and what is read."""

    analyzer: Analyzer
    detector: Detector

    def stop(self, clock: Clock) -> list[BaseException]:
        """Stop everything that can move and see it come to rest; returns what failed."""
        return list(stop_all([*self.axes.values(), self.analyzer], clock).values())


@contextmanager
def open_bench(rig_path: Path, note: Tell, trace: Path | None) -> Iterator[OpenBench]:
    """Open the bench of a rig file while the block lasts; whatever ends the block, every device is stopped.

    Parameters
    ----------
    rig_path : Path
        The rig file: of real devices, or as printed by `goniometer simulate`.
    note : callable
        Takes what devices said on connecting.
    trace : Path or None
        Where every byte sent and received is written down.

    Raises
    ------
    ConfigurationError
        When the rig file cannot be used; nothing was opened.
    DeviceError
        When a device fails, another process holds its port, or an axis moves already, which is then not stopped.
    ScanInterrupted
        On Ctrl-C, SIGTERM or SIGHUP.
    """
    rig = reachable_rig(rig_path)
    ports = {name: device.port for name, device in rig.devices.items()}
    with _reached(rig, ports, trace) as (clock, log, check), connected(rig, ports, clock, None, log) as bench:
        _tell(note, bench.notes)
        check()
        turning = {**bench.axes, "polarizer": bench.polarizer, "retarder": bench.retarder}
        if rig.generator is not None:
            turning |= dict(zip(rig.generator.carried_by, bench.of_generator, strict=True))
        axes = {role: axis for role, axis in turning.items() if isinstance(axis, Axis)}  # all are that there are
        opened = OpenBench(rig, axes, clock, check, bench.analyzer, bench.detector)
        with stopped_afterwards(opened, clock):
            yield opened


@contextmanager
def open_axes(
    rig_path: Path, roles: Collection[Role], note: Tell, trace: Path | None, *, to_home: bool = False, alone: bool
) -> Iterator[OpenAxes]:
    """Open what the motion of some axes needs: themselves, and those whose angles decide whether they touch anything.

    Parameters
    ----------
    rig_path, note, trace
        As for `open_bench`, which says what is raised, too.
    roles : collection of str
        The axes that are to move.
    to_home : bool
        Whether they are to be homed, so that an alarm which homing cures does not keep them from being connected.
    alone : bool
        Whether nothing is in their way, so that no other axis is needed.
    """
    rig = reachable_rig(rig_path)
    for role in roles:
        if role not in rig.axes():
            raise ConfigurationError([f"The rig {rig.rig!r} has no axis {role}. Nothing was moved."])
    zones = () if alone else tuple(zone for role in roles for zone in zones_about(rig, role))
    needed = {*roles, *(role for zone in zones for role in zone.roles())}
    devices = {
        name: device.with_only(needed)
        for name, device in rig.devices.items()
        if isinstance(device, AxesEntry) and needed & device.axes.keys()
    }
    ports = {name: device.port for name, device in devices.items()}
    with _reached(rig, ports, trace) as (clock, log, check), ExitStack() as open_devices:
        bench = Connecting(ports, clock, None, open_devices, log, to_home=roles if to_home else ())
        for name, device in devices.items():
            device.connect(name, bench)
        _tell(note, bench.notes)
        check()
        Interlock([zone.zone() for zone in zones], bench.axes)
        opened = OpenAxes(rig, bench.axes, clock, check)
        with stopped_afterwards(opened, clock):
            yield opened


def zones_about(rig: Rig, role: Role) -> list[ZoneEntry]:
    """The collision zones that an axis can enter."""
    return [zone for zone in rig.collision_zones if role in zone.roles()]


def roles_of(rig: Rig) -> list[Role]:
    """The roles of a rig's axes, the arms first."""
    return [role for role in get_args(Role) if role in rig.axes()]


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


@contextmanager
def _reached(
    rig: Rig, ports: Mapping[str, str], trace: Path | None
) -> Iterator[tuple[Clock, WireLog | None, Callable[[], None]]]:
    """The bench's clock, the log of the wire, and the check for an interruption, with the ports held."""
    with (
        Interruption() as interruption,
        held_ports(ports.values()),
        clock_of(rig) as clock,
        wire_log(trace, clock) as log,
    ):
        yield clock, log, interruption.check


def _tell(note: Tell, notes: Collection[str]) -> None:
    for line in notes:
        note(f"note: {line}")
