"""One short scan through faults, with the drivers, the engine, the reduction and the journal of a real scan."""

from __future__ import annotations

import functools
import logging
import signal
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from unittest import mock

from benches import short_scan
from struck import Struck, watched

from acquisition.engine import Engine, stopped_afterwards
from acquisition.events import Event, ReadingStored, ScanDoubted, ScanEnded
from acquisition.imaging.frame_files import FOLDER, load_frame
from acquisition.journal import Journal
from acquisition.pipeline import Pipeline
from acquisition.readings import Reading
from acquisition.time_left import TimeLeft
from drivers.camera.frame import Frame
from drivers.clock import Deadline
from drivers.wire.link import Link
from goniometer import assembly
from goniometer.imaging.photographing import photographing
from goniometer.planning import course, plan, reduction
from goniometer.rig_devices.camera import CameraEntry
from sim_devices.bench import Bench
from sim_devices.serving.clock import VirtualClock

PATIENCE_S = 0.04
"""Real seconds that a driver waits for an answer here: the simulated bench answers within one millisecond."""

LONGEST_REAL_S = 20.0
LONGEST_BENCH_S = 10_000.0

IN_MEMORY = Path("/dev/shm")
"""Where the runs are kept, if the system has it: what a disk takes for journals and pictures is most of the time."""

REST_S = 1.0
"""How long an axis that was told to stop may decelerate."""


class ImpatientLink(Link):
    """A link whose driver waits for no longer than `PATIENCE_S`."""

    def __init__(self, port: str, **options: Any) -> None:
        super().__init__(port, **options | {"reply_timeout_s": PATIENCE_S})


class Hang(BaseException):
    """A scan has taken too long."""


@dataclass
class Outcome:
    """How a scan ended: what is stored, what was shown, what failed, which axes still move, and which faults struck.

    `frames` are each reading's pictures, as they come out of their files again; `stray_files` are those of no reading.
    `doubts` are what a person is told of the light at the end of a scan.
    """

    rows: tuple[Reading, ...] = ()
    frames: tuple[tuple[Frame, ...], ...] = ()
    stray_files: set[str] = field(default_factory=set)
    shown: list[Reading] = field(default_factory=list)
    doubts: list[str] = field(default_factory=list)
    error: BaseException | None = None
    moving: list[str] = field(default_factory=list)
    struck: Struck = field(default_factory=set)
    duration_s: float = 0.0


def scanned(name: str, faults: Sequence[dict[str, Any]], seed: int) -> Outcome:
    """Scan on the bench of that name, through faults."""
    scan, outcome, clock = short_scan(name), Outcome(), VirtualClock()
    scene = scan.scene(list(faults), seed)
    bench = Bench(scene, clock)

    def show(event: Event) -> None:
        if isinstance(event, ReadingStored):
            outcome.shown.append(event.reading)
        elif isinstance(event, ScanDoubted):
            outcome.doubts += event.doubts

    def check() -> None:
        if clock.now() > LONGEST_BENCH_S:
            raise Hang("bench time")

    kept_in = IN_MEMORY if IN_MEMORY.is_dir() else None
    with tempfile.TemporaryDirectory(prefix="faults", dir=kept_in) as folder, bench:
        with Journal.create(Path(folder) / "journal.sqlite", {}) as journal, watched(scene) as outcome.struck:
            pipeline = Pipeline(reduction(scan.recipe, scan.rig), None, [show])
            time_left = TimeLeft(clock, sum(step.duration_s for step in plan(scan.recipe, scan.rig)))
            way = course(scan.recipe, scan.rig, clock, pipeline.publish, time_left.step_done)
            try:
                with assembly.connected(scan.rig, scan.ports(bench), clock, 550.0) as devices:
                    if isinstance(scan.rig.detector, CameraEntry):
                        devices = photographing(devices, scan.recipe)
                    engine = Engine(devices, clock, journal, pipeline.publish, check, time_left)
                    with stopped_afterwards(devices, clock):
                        engine.home()
                        while steps := way.next(pipeline.points):
                            engine.run(steps, way.ahead)
                            pipeline.end_point()
                    pipeline.publish(ScanEnded(way.reason, engine.readings_taken, clock.now(), as_asked=True))
            except (Exception, Hang) as error:  # noqa: BLE001 (judged afterwards)
                outcome.error = error
        with Journal.open(journal.path) as journal:
            outcome.rows, stored = journal.readings(), journal.frames()
        outcome.frames = tuple(tuple(load_frame(Path(folder), one) for one in each) for each in stored)
        files = {f"{FOLDER}/{path.name}" for path in (Path(folder) / FOLDER).glob("*")}
        outcome.stray_files = files - {one.file for each in stored for one in each}
        outcome.duration_s = clock.now()
        clock.sleep(REST_S)
        now_s = clock.now()
        outcome.moving = [role for role, axis in bench.world.axes.items() if axis.velocity_deg_s(now_s) != 0.0]
    return outcome


@functools.cache
def without_faults(name: str) -> Outcome:
    """The same scan without faults."""
    outcome = scanned(name, [], 1)
    if outcome.error is not None:
        raise outcome.error
    return outcome


@contextmanager
def time_limit() -> Iterator[None]:
    """Raise Hang when the block takes too long in real time."""

    def give_up(number: int, frame: Any) -> None:
        raise Hang("real time")

    signal.signal(signal.SIGALRM, give_up)
    signal.setitimer(signal.ITIMER_REAL, LONGEST_REAL_S)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)


def make_impatient() -> None:
    """Let drivers wait as long as a simulated bench needs, and no longer; in this process, for good."""
    logging.disable(logging.WARNING)
    mock.patch("goniometer.rig_devices.connecting.Link", ImpatientLink).start()
    mock.patch("drivers.modbus.port.Link", ImpatientLink).start()
    mock.patch.object(Deadline, "_REAL_GRACE_S", 0.0).start()
