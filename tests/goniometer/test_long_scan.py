"""What a scan needs does not grow with its readings."""

import gc
import tracemalloc
from pathlib import Path

import numpy as np

import goniometer
from acquisition.events import ReadingStored
from acquisition.journal import Journal
from acquisition.lamp_watch import LampWatch
from acquisition.pipeline import Pipeline
from acquisition.readings import Reading
from acquisition.reduce import NoiseModel, Radiometry, Reduction
from goniometer.scan_so_far import ScanSoFar
from model.fit import Dataset, fit, lobe_family

ROOT = Path(__file__).resolve().parents[2]
SLOTS = 5
DARK_W, NOISE = 2e-10, NoiseModel(read_w=2e-11, sample_s=0.003, shot=True, wavelength_nm=550)


def test_whole_scan_keeps_no_object_for_a_reading(tmp_path: Path) -> None:
    directions, repeats = 12, 16
    recipe = (ROOT / "recipes" / "iron_60deg.yaml").read_text(encoding="utf-8").replace("../", f"{ROOT}/")
    recipe = recipe.replace("stop_deg: 60", f"stop_deg: {directions - 1}").replace(
        "readings: 3", f"readings: {repeats}"
    )
    path = tmp_path / "long.yaml"
    path.write_text(f"{recipe}direction_within_s: 0\n", encoding="utf-8")
    read, alive = 0, {}

    def watch(event: object) -> None:
        nonlocal read
        if isinstance(event, ReadingStored):
            read += 1
            if read in (3 * SLOTS * repeats + 1, 11 * SLOTS * repeats + 1):  # as a direction begins
                gc.collect()
                alive[read] = len(gc.get_objects())

    goniometer.run(path, out=tmp_path, speed="max", live_fit=False, subscribers=[watch])
    (first, few), (last, many) = alive.items()
    assert read == directions * SLOTS * repeats
    assert (many - few) / (last - first) < 0.3


def test_memory_of_journal_and_pipeline_does_not_grow_with_the_readings(tmp_path: Path) -> None:
    reduction = Reduction(Radiometry(1e-4, 1e-4), NOISE, has_dark=True)
    sizes, points, repeats, settled = [], 80, 10, 45  # Python keeps 2000 tuples of a reading for the next ones
    with Journal.create(tmp_path / "journal.sqlite", {}) as journal:
        seen = ScanSoFar(lambda: 0.0)
        pipeline = Pipeline(reduction, None, [seen])
        tracemalloc.start()
        try:
            for point in range(points):
                for place, angle_deg in enumerate((0.0, 45.0, 90.0, 135.0, None)):
                    kind = "dark" if angle_deg is None else "signal"
                    for repeat in range(repeats):
                        at_s = 10.0 * point + place + 0.01 * repeat
                        power_w = DARK_W if angle_deg is None else DARK_W + 1e-9 * (1.0 + 1e-3 * repeat)
                        place_of = (point, kind, repeat, at_s, 60.0, 1.0 * point, 0.0, place, angle_deg, 0.03)
                        reading = Reading(*place_of, power_w)  # type: ignore[arg-type]
                        journal.append(reading)
                        pipeline.publish(ReadingStored(reading))
                pipeline.end_point()
                sizes.append(tracemalloc.get_traced_memory()[0])
        finally:
            tracemalloc.stop()
    assert seen.readings == points * SLOTS * repeats == 4000
    a_reading = np.polyfit(SLOTS * repeats * np.arange(settled, points), sizes[settled:], 1)[0]
    assert a_reading < 60.0, "bytes; a reading alone has some 400, and a Stokes point 1000 for its 50 readings"


def test_of_many_references_only_the_last_ones_are_kept() -> None:
    watch = LampWatch()
    for point in range(1000):
        for place, kind in enumerate(("reference", "signal", "signal", "signal", "dark")):
            at_s = 10.0 * point + place
            watch.add(Reading(point, kind, 0, at_s, 60.0, 0.0, 0.0, 2, None, 0.03, 1e-9))  # type: ignore[arg-type]
        watch.end_point(point)
        assert len(watch.of_lamp()) <= 6
        assert len(watch.in_question()) <= 20
    references = [reading.point for reading in watch.of_lamp() if reading.kind == "reference"]
    assert references == [0, 998, 999]
    assert [reading.point for reading in watch.of_lamp() if reading.kind == "dark"] == references


def test_a_search_in_many_directions_takes_little_memory() -> None:
    family = lobe_family(
        ["specular", "diffuse", "directional"], free={"sigma": (0.02, 1.0), "n": (1.0, 6.0), "k": (0.0, 8.0)}, fixed={}
    )
    count = 8000
    directions = np.full(count, np.radians(60.0)), np.linspace(0.0, np.radians(59.0), count), np.full(count, np.pi)
    truth = {"sigma": 0.2, "n": 2.9, "k": 2.9, "rho_s": 0.7, "rho_d": 0.1, "rho_dd": 0.05}
    stokes = family.surface_of(truth).stokes(*directions)[:, :3]
    data = Dataset(*directions, stokes, np.broadcast_to(1e-8 * np.eye(3), (count, 3, 3)))
    fit(data.some(np.arange(0, count, 100)), family)  # compiles
    tracemalloc.start()
    try:
        found = fit(data, family)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert abs(found.values["sigma"] - 0.2) < 1e-3
    assert peak < 100e6, "all 64 points of the search at once take 300 MB"
