"""How do short scans end through which one to three faults strike, at random moments.

Run with:   python benchmarks/fault_schedules.py RUNS [--first SEED] [--processes N]

Every run must end with the data of the scan without faults, or with an error that names what failed; without a wrong
reading, a hang, an axis that moves on unsaid, or a reading lost from the journal. Whatever is else is a violation: its
schedule is printed, and the exit code is 1. The same seed makes the same schedule.
"""

from __future__ import annotations

import argparse
import functools
import itertools
import logging
import multiprocessing
import random
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from unittest import mock

import yaml

from acquisition.engine import Engine, stopped_afterwards
from acquisition.events import Event, ReadingStored
from acquisition.journal import Journal
from acquisition.readings import Reading
from acquisition.recipe import Recipe
from drivers.clock import Deadline
from drivers.wire.link import Link
from goniometer import assembly
from goniometer.bench import served_ports
from goniometer.errors import DeviceError
from goniometer.planning import plan
from goniometer.rig_file import Rig
from sim_devices.bench import Bench
from sim_devices.scene import Scene
from sim_devices.serving.clock import VirtualClock

ROOT = Path(__file__).resolve().parents[1]
AXES = ("source_arm", "detector_arm", "sample_azimuth")
DEVICES = ("arms", "sample_stage", "analyzer", "meter")
RECIPE = {
    "recipe": "three directions",
    "rig": "simulated.yaml",
    "wavelength_nm": 550,
    "incidence_deg": 30,
    "exit_deg": [0, 20, 30],
    "azimuth_deg": 15,
    "analyzer_deg": [0, 45, 90],
    "readings": 2,
    "exposure_s": 0.03,
    "fit": {"lobes": ["specular"], "free": {"sigma": [0.02, 1.0]}, "fixed": {"n": 2.9, "k": 3.0}},
}
PATIENCE_S = 0.06
"""Real seconds that a driver waits for an answer here: the simulated bench answers within one millisecond."""

LONGEST_REAL_S = 20.0
LONGEST_EXTRA_S = 120.0
"""How much longer than without faults a scan may take on the bench's clock: some of the drivers' deadlines in a row."""


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
    """How a scan ended: what is stored, what was shown, what failed, and which axes still move."""

    rows: tuple[Reading, ...] = ()
    shown: list[Reading] = field(default_factory=list)
    error: BaseException | None = None
    moving: list[str] = field(default_factory=list)
    duration_s: float = 0.0


@functools.cache
def rig() -> Rig:
    return Rig.model_validate(yaml.safe_load((ROOT / "rigs" / "simulated.yaml").read_text()))


def scene(faults: list[dict[str, Any]], seed: int) -> Scene:
    document = yaml.safe_load((ROOT / "scenes" / "iron_noise_free.yaml").read_text())
    return Scene.model_validate(document | {"faults": faults, "seed": seed})


def scanned(faults: list[dict[str, Any]], seed: int) -> Outcome:
    """Scan through faults, with the drivers, the engine and the journal of a real scan."""
    outcome, clock = Outcome(), VirtualClock()
    bench = Bench(scene(faults, seed), clock)
    steps = plan(Recipe.model_validate(RECIPE), rig())

    def show(event: Event) -> None:
        if isinstance(event, ReadingStored):
            outcome.shown.append(event.reading)

    def check() -> None:
        if clock.now() > 10_000:
            raise Hang("bench time")

    with tempfile.TemporaryDirectory(prefix="faults") as folder, bench:
        with Journal.create(Path(folder) / "journal.sqlite", {}) as journal:
            try:
                with assembly.connected(rig(), served_ports(rig(), bench), clock, 550.0) as devices:
                    engine = Engine(devices, clock, journal, show, check, sum(step.duration_s for step in steps))
                    with stopped_afterwards(devices, clock):
                        engine.run(steps)
            except (Exception, Hang) as error:  # noqa: BLE001 (judged afterwards)
                outcome.error = error
        with Journal.open(journal.path) as journal:
            outcome.rows = journal.readings()
        outcome.duration_s = clock.now()
        clock.sleep(REST_S)
        now_s = clock.now()
        outcome.moving = [role for role in AXES if bench.world.axes[role].velocity_deg_s(now_s) != 0.0]
    return outcome


@functools.cache
def without_faults() -> Outcome:
    outcome = scanned([], 1)
    assert outcome.error is None, outcome.error
    return outcome


def schedule(seed: int) -> list[dict[str, Any]]:
    """One to three faults of any kind, at any moment of the scan."""
    chance, end_s = random.Random(seed), without_faults().duration_s
    return [
        {**chance.choice(KINDS)(chance), "at_s": round(chance.uniform(0.0, end_s), 4)}
        for _ in range(chance.choice((1, 1, 2, 3)))
    ]


def of_replies(name: str, devices: tuple[str, ...] = DEVICES, **keys: Any) -> Any:
    def make(chance: random.Random) -> dict[str, Any]:
        replies = chance.choice((1, 1, 1, 2, 3, 10))
        drawn = {key: draw(chance) for key, draw in keys.items()}
        return {"fault": name, "device": chance.choice(devices), "replies": replies} | drawn

    return make


def of_device(name: str, devices: tuple[str, ...] = DEVICES, **keys: Any) -> Any:
    def make(chance: random.Random) -> dict[str, Any]:
        drawn = {key: draw(chance) for key, draw in keys.items()}
        return {"fault": name, "device": chance.choice(devices)} | drawn

    return make


def of_axis(name: str, axes: tuple[str, ...] = AXES, **keys: Any) -> Any:
    def make(chance: random.Random) -> dict[str, Any]:
        drawn = {key: draw(chance) for key, draw in keys.items()}
        return {"fault": name, "axis": chance.choice(axes)} | drawn

    return make


def seconds(least: float, most: float) -> Any:
    return lambda chance: round(chance.uniform(least, most), 3)


KINDS = (
    of_replies("late", late_s=seconds(0.01, 4.0)),
    of_replies("slow_drip"),
    of_replies("split", apart_s=seconds(0.001, 1.0)),
    of_replies("merged"),
    of_replies("short", lost_bytes=lambda chance: chance.randint(1, 12)),
    of_replies("duplicated"),
    of_replies("missing"),
    of_replies("garbled", bits=lambda chance: chance.choice((1, 1, 2, 8))),
    of_replies("crc_error", ("sample_stage",)),
    of_replies("modbus_exception", ("sample_stage",), code=lambda chance: chance.choice((1, 2, 3, 4, 6))),
    of_device("noise", noise_bytes=lambda chance: chance.choice((1, 5, 50, 5000))),
    of_device("stray_prompt", text=lambda chance: chance.choice(("> ", "\r\n", "\n", "pos?\r3\r> ", "1\r\n", "0.1\n"))),
    of_device("endless_output", for_s=seconds(0.01, 20.0)),
    of_device("busy", for_s=seconds(0.01, 10.0)),
    of_device("cable_pulled", for_s=seconds(0.1, 20.0)),
    of_device("power_cycle", off_s=seconds(0.1, 6.0)),
    of_axis("reset_in_motion", into_motion_s=seconds(0.0, 1.0)),
    of_axis("stall", into_motion_s=seconds(0.0, 1.0)),
    of_axis("limit_hit", into_motion_s=seconds(0.0, 1.0)),
    of_axis("lost_home"),
    of_device("wheel_by_hand", ("analyzer",)),
    lambda chance: {"fault": "detector_saturated", "for_s": round(chance.uniform(0.01, 2.0), 3)},
)


def values(reading: Reading) -> tuple[Any, ...]:
    """All of a reading but its time and its angles, which are judged by the axes' tolerance."""
    return reading.point, reading.kind, reading.repeat, reading.slot, reading.exposure_s, reading.power_w


def is_same(reading: Reading, expected: Reading) -> bool:
    axes = rig().axes()
    angles = (
        ("source_arm", reading.incidence_deg - expected.incidence_deg),
        ("detector_arm", reading.exit_deg - expected.exit_deg),
        ("sample_azimuth", reading.azimuth_deg - expected.azimuth_deg),
    )
    return values(reading) == values(expected) and all(abs(off) <= axes[role].tolerance_deg for role, off in angles)


def errors_in(error: BaseException) -> list[BaseException]:
    return (
        [one for each in error.exceptions for one in errors_in(each)]
        if isinstance(error, BaseExceptionGroup)
        else [error]
    )


def violations(outcome: Outcome) -> Iterator[str]:
    """What must not have happened."""
    expected = without_faults()
    if isinstance(outcome.error, Hang) or outcome.duration_s > expected.duration_s + LONGEST_EXTRA_S:
        yield f"hang: {outcome.duration_s:.1f} s of the bench's time"
    if list(outcome.rows) != outcome.shown:
        yield f"{len(outcome.shown)} readings were shown and {len(outcome.rows)} are stored"
    for reading, right in itertools.zip_longest(outcome.rows, expected.rows[: len(outcome.rows)]):
        if right is None or not is_same(reading, right):
            yield f"wrong reading {reading}"
    if outcome.error is None and len(outcome.rows) != len(expected.rows):
        yield f"{len(outcome.rows)} readings of {len(expected.rows)}, and no error"
    failures = errors_in(outcome.error) if outcome.error is not None else []
    names = (*AXES, *DEVICES)
    for failure in failures:
        if not (isinstance(failure, DeviceError) and failure.device in names and failure.happened and failure.to_do):
            yield f"an error that names no device: {failure!r}"
    if outcome.moving and not any("may still be moving" in str(failure) for failure in failures):
        yield f"{' and '.join(outcome.moving)} moves on, and nothing says so"


def judged(seed: int) -> tuple[int, list[str], str, list[str], float, float]:
    """Seed, names of the faults, outcome, violations, real and bench seconds."""
    faults = schedule(seed)
    start_s = time.monotonic()
    with time_limit():
        outcome = scanned(faults, seed)
    ending = "same data" if outcome.error is None else type(errors_in(outcome.error)[0]).__name__
    if outcome.moving:
        ending = "not stopped, and said so"
    wrong = list(violations(outcome))
    if wrong:
        wrong += [f"{faults}", f"{outcome.error!r}"]
    return seed, [fault["fault"] for fault in faults], ending, wrong, time.monotonic() - start_s, outcome.duration_s


@contextmanager
def time_limit() -> Iterator[None]:
    def give_up(number: int, frame: Any) -> None:
        raise Hang("real time")

    signal.signal(signal.SIGALRM, give_up)
    signal.setitimer(signal.ITIMER_REAL, LONGEST_REAL_S)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)


def prepare() -> None:
    """Take the time of the scan without faults with patient drivers, then make them impatient."""
    logging.disable(logging.WARNING)
    without_faults()
    mock.patch("goniometer.rig_devices.connecting.Link", ImpatientLink).start()
    mock.patch("drivers.modbus.port.Link", ImpatientLink).start()
    mock.patch.object(Deadline, "_REAL_GRACE_S", 0.0).start()


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("runs", type=int)
    parser.add_argument("--first", type=int, default=0, metavar="SEED")
    parser.add_argument("--processes", type=int, default=2)
    asked = parser.parse_args()
    endings: Counter[tuple[str, str]] = Counter()
    broken, start_s, slowest_s, longest_s = 0, time.monotonic(), 0.0, 0.0
    seeds = range(asked.first, asked.first + asked.runs)
    spawning = multiprocessing.get_context("spawn")
    # unlike multiprocessing's own pool, this one says so when a process dies
    with ProcessPoolExecutor(asked.processes, mp_context=spawning, initializer=prepare) as pool:
        for seed, names, ending, wrong, real_s, bench_s in pool.map(judged, seeds, chunksize=4):
            slowest_s, longest_s = max(slowest_s, real_s), max(longest_s, bench_s)
            endings.update((name, ending) for name in set(names))
            endings[("all", ending)] += 1
            if wrong:
                broken += 1
                print(f"seed {seed}:", *wrong, sep="\n    ", flush=True)
    columns = sorted({ending for _, ending in endings})
    print(f"{'':20}", *(f"{column:>26}" for column in columns))
    for name in sorted({name for name, _ in endings}):
        print(f"{name:20}", *(f"{endings[(name, column)]:26}" for column in columns))
    print(
        f"{asked.runs} runs, {broken} with violations, in {time.monotonic() - start_s:.0f} s; "
        f"the slowest {slowest_s:.1f} s, the longest {longest_s:.0f} s of the bench's time"
    )
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main())
