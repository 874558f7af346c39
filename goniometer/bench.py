"""The bench a scan runs on: simulated here, served by another process, or real hardware."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager
from dataclasses import dataclass
from numbers import Real
from pathlib import Path
from typing import Literal

from drivers.clock import Clock, LaterClock, WallClock
from goniometer.bench_commands.port_lock import held_ports
from goniometer.errors import ConfigurationError
from goniometer.load_files import BenchSetup, load_scene
from goniometer.rig_file import Rig
from sim_devices.bench import Bench as SimulatedBench
from sim_devices.past import Past
from sim_devices.scene import Scene
from sim_devices.serving.clock import ScaledClock, VirtualClock
from sim_devices.serving.remote_clock import RemoteClock

Speed = float | Literal["max"]


@dataclass(frozen=True)
class BenchAccess:
    """How to reach a bench: its clock, the ports of its devices and, when simulated, the text of its scene."""

    clock: Clock
    ports: Mapping[str, str]
    scene_text: str


@dataclass(frozen=True)
class LeftOff:
    """How a process has left a bench: when on the bench's clock, how long ago, and what it had been through."""

    ended_s: float
    ago_s: float
    past: Past


@contextmanager
def simulate(
    scene: Scene | str | Path, speed: Speed = 1.0, left_off: LeftOff | None = None, folder: Path | None = None
) -> Iterator[SimulatedBench]:
    """Serve a scene as a simulated bench on loopback while the block lasts.

    Parameters
    ----------
    scene : Scene, str or Path
        The scene, or the file that holds it.
    speed : float or "max"
        Seconds of the bench in a second of real time; "max" is virtual time, where whoever waits moves the clock on.
    left_off : LeftOff, optional
        How a process has left the bench. Virtual time begins at zero all the same, and other time where it was.
    folder : Path, optional
        Where the pictures lie that the scene names; the file's own if not given.

    Yields
    ------
    sim_devices.bench.Bench
        Its `addresses` say where each device listens, its `clock` is the bench's time.

    Raises
    ------
    ConfigurationError
        When the scene cannot be used, or the speed is neither a positive number nor "max".
    """
    if not isinstance(scene, Scene):
        folder = folder or Path(scene).parent
        scene = load_scene(Path(scene)).scene
    clock, past = (_clock(speed), Past()) if left_off is None else (_clock(speed, left_off.ended_s), left_off.past)
    bench = SimulatedBench(scene, clock, past, folder or Path())
    bench.start()
    try:
        yield bench
    finally:
        bench.stop()


def _clock(speed: Speed, begin_s: float = 0.0) -> VirtualClock | ScaledClock:
    if speed == "max":
        return VirtualClock()
    if not (isinstance(speed, Real) and 0 < speed < math.inf):
        raise ConfigurationError(
            [f"got the speed {speed!r}; allowed: a number, its seconds in a real one, or 'max' for virtual time"]
        )
    return ScaledClock(speed, begin_s)


@contextmanager
def access(setup: BenchSetup, speed: Speed | None, left_off: LeftOff | None = None) -> Iterator[BenchAccess]:
    """The bench that a recipe's rig asks for, while the block lasts; its time goes on where a process has left off.

    Raises
    ------
    ConfigurationError
        When a speed is asked of a bench that this process does not simulate, or of an analyzer that turns while it is
        read: delays of the computer would count as much more time of the bench, and put its readings at wrong angles.
    NotConnectedError
        When a bench served elsewhere does not answer, or another process holds a port.
    """
    rig = setup.rig
    ports = {name: device.port for name, device in rig.devices.items() if device.port}
    if rig.bench is not None:
        _refuse_speed(speed, setup, "the bench is served by another process: give --speed to goniometer simulate")
        with held_ports(ports.values()), closing(RemoteClock(rig.bench)) as clock:
            _refuse_haste(setup, clock.speed)
            behind_s = 0.0 if left_off is None or clock.speed == "max" else left_off.ended_s - clock.now()
            yield BenchAccess(LaterClock(clock, behind_s) if behind_s > 0 else clock, ports, clock.scene_text)
    elif rig.is_simulated:
        assert setup.scene is not None, "a simulated rig is only accepted with a scene"
        _refuse_haste(setup, speed)
        folder = None if setup.scene_path is None else setup.scene_path.parent
        with simulate(setup.scene, 1.0 if speed is None else speed, left_off, folder) as bench:
            yield BenchAccess(bench.clock, served_ports(rig, bench), setup.scene_text)
    else:
        _refuse_speed(speed, setup, "real devices keep their own time")
        with held_ports(ports.values()):
            ahead_s = 0.0 if left_off is None else left_off.ended_s + left_off.ago_s
            yield BenchAccess(LaterClock(WallClock(), ahead_s), ports, "")


def served_ports(rig: Rig, bench: SimulatedBench) -> dict[str, str]:
    """The ports of a rig's devices, with the bench's addresses for those that are simulated."""
    return {
        name: bench.addresses[name].tcp if device.port == "simulated" else device.port
        for name, device in rig.devices.items()
        if device.port
    }


def _refuse_haste(setup: BenchSetup, speed: float | str | None) -> None:
    if setup.is_read_turning and isinstance(speed, float | int) and speed > 1:
        raise ConfigurationError(
            [
                f"{setup.recipe_path}: the analyzer turns while it is read (analyzer_rotation), and at --speed "
                f"{speed:g} what this computer is late by would put readings at wrong angles. Nothing was moved. Say "
                "--speed max, or leave it out."
            ]
        )


def _refuse_speed(speed: Speed | None, setup: BenchSetup, reason: str) -> None:
    if speed is not None:
        raise ConfigurationError([f"{setup.rig_path}: --speed {speed} cannot be kept: {reason}. Nothing was moved."])
