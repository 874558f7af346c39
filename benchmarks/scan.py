"""What a scan costs: the whole recipe in virtual time, and the engine alone beside Bluesky's, in one run.

Run with ``make bench``; the figures in docs/cost.md come from here.
"""

import json
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import goniometer
from acquisition.engine import Bench, Engine
from acquisition.events import FitUpdated, ScanEnded
from acquisition.fit_points import dataset, surface_family
from acquisition.journal import Journal
from acquisition.time_left import TimeLeft
from goniometer.assembly import connected
from goniometer.bench import served_ports, simulate
from goniometer.load_files import load_recipe
from goniometer.planning import plan
from model.fit import fit, follow

ROOT = Path(__file__).resolve().parent.parent
RECIPE = ROOT / "recipes" / "iron_60deg.yaml"
PEER = ROOT / ".venv-bench" / ("Scripts" if sys.platform == "win32" else "bin") / "python"
REPEATS = 5


class InMemory:
    """Every role of a bench at once: arrives, and reads, without delay."""

    name, settle_s, tolerance_deg, rested_s = "in memory", 0.0, 0.001, 0.0

    def __init__(self):
        self._position = 0

    def connect(self):
        return ()

    def reconnect(self):
        pass

    def start_move(self, target):
        self._position = target

    start_select = start_move

    def is_moving(self):
        return False

    is_reading = is_exposing = is_moving

    def remaining_s(self):
        return 0.0

    def position_deg(self):
        return self._position

    slot = position_deg

    def start_reading(self, exposure_s):
        pass

    def power_w(self):
        return 1e-9

    def stop(self):
        pass


class FreeClock:
    """Time that passes when somebody waits, and costs nothing."""

    def __init__(self):
        self._now_s = 0.0

    def now(self):
        return self._now_s

    def sleep(self, duration_s):
        self._now_s += duration_s


def whole_scan(live_fit, speed):
    """One scan; returns wall time, bench time, readings and the intervals between live fits."""
    ends, fits = [], []

    def watch(event):
        if isinstance(event, ScanEnded):
            ends.append((time.perf_counter(), event))
        elif isinstance(event, FitUpdated):
            fits.append(event)

    with tempfile.TemporaryDirectory() as folder:
        start = time.perf_counter()
        goniometer.run(RECIPE, out=folder, speed=speed, live_fit=live_fit, subscribers=[watch])
        total_s = time.perf_counter() - start
    end, event = ends[0]
    return {
        "scan_s": end - start,
        "total_s": total_s,
        "bench_s": event.bench_duration_s,
        "readings": event.readings,
        "fits": len(fits),
    }


def round_trips_a_second(count=5000):
    """Questions that a driver asks the served ESP301 a second, each answered before the next."""
    setup = load_recipe(RECIPE)
    with (
        simulate(setup.scene, "max") as bench,
        connected(setup.rig, served_ports(setup.rig, bench), bench.clock, setup.recipe.wavelength_nm) as devices,
    ):
        start = time.perf_counter()
        for _ in range(count):
            devices.source_arm.position_deg()
        return count / (time.perf_counter() - start)


def live_fit_update_ms():
    """Wall milliseconds of each warm refit as the points of a whole scan come in."""
    with tempfile.TemporaryDirectory() as folder:
        stored = goniometer.run(RECIPE, out=folder, speed="max", live_fit=False)
    acceptance_sr = load_recipe(RECIPE).rig.calibration.acceptance_sr
    family, last, times_ms = surface_family(stored.recipe.fit, acceptance_sr), None, []
    for count in range(20, len(stored.points) + 1):
        start = time.perf_counter()
        data = dataset(stored.points[:count])
        last = follow(data, family, last) if last else fit(data, family)
        times_ms.append(1e3 * (time.perf_counter() - start))
    return sorted(times_ms[1:])


def engine_alone():
    """CPU and wall milliseconds a reading of the engine with its durable journal, on devices in memory."""
    setup = load_recipe(RECIPE)
    steps = plan(setup.recipe, setup.rig)
    bench = Bench(InMemory(), InMemory(), InMemory(), InMemory(), InMemory())
    with tempfile.TemporaryDirectory() as folder, Journal.create(Path(folder) / "journal.sqlite", {}) as journal:
        clock = FreeClock()
        engine = Engine(bench, clock, journal, lambda event: None, lambda: None, TimeLeft(clock, 0.0))
        cpu_s, wall_s = time.process_time(), time.perf_counter()
        engine.run(steps)
        cpu_s, wall_s = time.process_time() - cpu_s, time.perf_counter() - wall_s
    return {"cpu_ms": 1e3 * cpu_s / engine.readings_taken, "wall_ms": 1e3 * wall_s / engine.readings_taken}


def best(runs, key):
    return statistics.median(run[key] for run in runs)


def main():
    print("Whole scan of iron_60deg, 61 angles x 5 slots x 3 readings, every byte over a socket (median of runs):")
    for live_fit in (True, False):
        runs = [whole_scan(live_fit, "max") for _ in range(REPEATS)]
        print(
            f"  speed max, live fit {'on ' if live_fit else 'off'}: scan {best(runs, 'scan_s'):.2f} s wall, "
            f"with start and results {best(runs, 'total_s'):.2f} s; {runs[0]['bench_s']:.0f} virtual s, "
            f"{runs[0]['bench_s'] / best(runs, 'scan_s'):.0f} virtual s a second; {runs[0]['fits']} live fits shown"
        )
    print(f"  {round_trips_a_second():.0f} round trips a second between driver and simulated device")
    times_ms = live_fit_update_ms()
    print(
        f"  live-fit update: median {statistics.median(times_ms):.1f} ms, "
        f"95th percentile {times_ms[int(0.95 * len(times_ms))]:.1f} ms"
    )
    ratios = []
    for _ in range(3):
        with_fit, without = whole_scan(True, 40.0), whole_scan(False, 40.0)
        ratios.append(with_fit["scan_s"] / without["scan_s"])
    print(f"  speed 40: scan {with_fit['scan_s']:.2f} s wall; with live fit / without: {statistics.median(ratios):.3f}")

    print("Engine alone, devices in memory, a reading:")
    ours = [engine_alone() for _ in range(REPEATS)]
    print(f"  goniometer with durable journal: {best(ours, 'cpu_ms'):.3f} ms CPU, {best(ours, 'wall_ms'):.3f} ms wall")
    peers = [
        json.loads(
            subprocess.run([PEER, ROOT / "benchmarks" / "bluesky_peer.py"], capture_output=True, check=True).stdout
        )
        for _ in range(3)
    ]
    print(
        f"  Bluesky {peers[0]['version']}, nothing stored:  {best(peers, 'cpu_ms'):.3f} ms CPU, "
        f"{best(peers, 'wall_ms'):.3f} ms wall"
    )
    print(f"  ratio of CPU: {best(ours, 'cpu_ms') / best(peers, 'cpu_ms'):.3f}")


if __name__ == "__main__":
    main()
