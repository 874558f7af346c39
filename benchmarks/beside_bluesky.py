"""What a recipe takes on a simulated bench, and what Bluesky's grid_scan takes there for the same readings, in one run.

Both drive the same devices through the same drivers, in virtual time: the same arms, slots, exposures and repeats, each
reading with the positions read back. Bluesky's plan sends what moves together at the same time, as ours does. The order
is what its user writes: slots within each exit angle, with the wheel going back and forth (snake) or not; or all exit
angles within each slot, where the light must be as constant as the whole scan is long. Beside it stands the processor
time of the engines alone. Run it with ``python benchmarks/beside_bluesky.py``; the figures in docs/bluesky.md come from
here. It is not called bluesky.py because it would hide Bluesky from every script in this folder.
"""

import json
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

import bluesky.plan_stubs as bps
from bluesky import RunEngine
from bluesky.plans import grid_scan
from scan import REPEATS, ROOT, best, engine_alone

import goniometer
import goniometer.bluesky
from acquisition.events import ScanEnded
from goniometer.load_files import load_recipe
from goniometer.planning import slots

RECIPES = ("iron_60deg", "iron_slider", "iron_thorlabs")


def ours(path):
    """Bench seconds and readings of a run, after homing."""
    ends = []
    with tempfile.TemporaryDirectory() as folder:
        goniometer.run(
            path,
            out=folder,
            speed="max",
            live_fit=False,
            subscribers=[lambda event: ends.append(event) if isinstance(event, ScanEnded) else None],
        )
    return ends[0].bench_duration_s, ends[0].readings


def of_bluesky(engine, setup, *, slots_outside, snake):
    """Bench seconds and readings of grid_scan, after homing."""
    recipe, held = setup.recipe, slots(setup.rig)
    stops = sorted([held.polarizers[angle] for angle in recipe.analyzer_deg] + [held.blocked] * recipe.dark)
    assert stops == list(range(stops[0], stops[-1] + 1)), "grid_scan takes evenly spaced slots"
    exits_deg = recipe.exit_angles_deg()

    def per_step(detectors, step, pos_cache):
        yield from bps.move_per_step(step, pos_cache)
        for _ in range(recipe.readings):
            yield from bps.trigger_and_read([*detectors, *step])

    readings = []
    token = engine.subscribe(lambda kind, document: readings.append(document), "event")
    with goniometer.bluesky.devices(
        setup.scene_path, speed="max", wavelength_nm=recipe.wavelength_nm, exposure_s=recipe.exposure_s
    ) as bench:
        bench.home()
        axes = [
            (bench.detector_arm, exits_deg[0], exits_deg[-1], len(exits_deg)),
            (bench.analyzer, stops[0], stops[-1], len(stops)),
        ]
        arguments = [argument for axis in (axes[::-1] if slots_outside else axes) for argument in axis]
        begun_s = bench.clock.now()
        engine(bps.mv(bench.source_arm, recipe.incidence_deg, bench.sample_azimuth, recipe.azimuth_deg))
        engine(grid_scan([bench.detector], *arguments, snake_axes=snake, per_step=per_step))
        duration_s = bench.clock.now() - begun_s
    engine.unsubscribe(token)
    return duration_s, len(readings)


def rig_time(name, engine):
    setup = load_recipe(ROOT / "recipes" / f"{name}.yaml")
    our_s, readings = ours(setup.recipe_path)
    print(f"{name}, {readings} readings: goniometer {our_s:.1f} bench s")
    for what, slots_outside, snake in (
        ("slots within each exit angle, snake   ", False, True),
        ("slots within each exit angle, no snake", False, False),
        ("exit angles within each slot, snake   ", True, True),
    ):
        duration_s, events = of_bluesky(engine, setup, slots_outside=slots_outside, snake=snake)
        assert events == readings, f"{events} readings are not {readings}"
        print(f"  grid_scan, {what}: {duration_s:6.1f} bench s; goniometer / Bluesky: {our_s / duration_s:.2f}")


def peer():
    """CPU and wall milliseconds a reading of Bluesky's RunEngine on devices in memory, nothing stored."""
    script = Path(__file__).with_name("bluesky_peer.py")
    return json.loads(subprocess.run([sys.executable, script], capture_output=True, check=True).stdout)


def main():
    engine = RunEngine()
    for name in RECIPES:
        rig_time(name, engine)
    ours_alone, peers = [], []
    for _ in range(REPEATS):
        ours_alone.append(engine_alone())
        peers.append(peer())
    our_ms, their_ms = best(ours_alone, "cpu_ms"), best(peers, "cpu_ms")
    ratios = [one["cpu_ms"] / other["cpu_ms"] for one, other in zip(ours_alone, peers, strict=True)]
    print(f"Engines alone, CPU a reading (median of {REPEATS}, taken in turn):")
    print(
        f"  goniometer {our_ms:.3f} ms with durable journal, Bluesky {peers[0]['version']} {their_ms:.3f} ms without;"
    )
    print(f"  goniometer / Bluesky: {statistics.median(ratios):.3f}, from {min(ratios):.3f} to {max(ratios):.3f}")


if __name__ == "__main__":
    main()
