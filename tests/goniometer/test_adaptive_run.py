"""Scans that decide as they go, on the simulated bench: every byte over a socket, every reading through the journal."""

import io
import json
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml
from click.testing import CliRunner
from numpy.testing import assert_allclose
from rich.console import Console

import goniometer
from acquisition.events import DirectionChosen, FitUpdated, PointReduced, ScanEnded, ScanStarted
from acquisition.expand import HOME, Visits
from acquisition.expected_noise import expected_points, light_of
from acquisition.fit_points import dataset, surface_family
from acquisition.stokes_csv import read_stokes_csv
from acquisition.timing import READING_S
from goniometer.cli import cli
from goniometer.lasting_stream import LastingStream
from goniometer.live_console import LiveConsole
from goniometer.load_files import load_recipe
from goniometer.planning import detection, plan, slots, timing
from goniometer.run_folder import stored_run
from model.design.design import Criterion
from model.design.information import information, standard_errors
from model.design.timed_design import timed_design

ROOT = Path(__file__).resolve().parents[2]
EVERY_6 = {"exit": {"start_deg": 0.0, "stop_deg": 60.0, "step_deg": 6.0}}


def write_variant(tmp_path, sample="iron", scene_changes=None, **changes):
    """A copy of a shipped recipe and its scene with changes, beside a copy of the shipped rig."""
    for folder in ("recipes", "rigs", "scenes"):
        (tmp_path / folder).mkdir(exist_ok=True)
    (tmp_path / "rigs" / "simulated.yaml").write_text((ROOT / "rigs" / "simulated.yaml").read_text())
    recipe = yaml.safe_load((ROOT / "recipes" / f"{sample}_60deg.yaml").read_text()) | {"time_limit_s": 600.0} | changes
    scene = yaml.safe_load((ROOT / "scenes" / f"{sample}.yaml").read_text()) | (scene_changes or {})
    (tmp_path / "scenes" / f"{sample}.yaml").write_text(yaml.safe_dump(scene))
    path = tmp_path / "recipes" / "steered.yaml"
    path.write_text(yaml.safe_dump(recipe))
    return path


def run(tmp_path, *arguments, **changes):
    """Run a variant; returns the stored run and its events."""
    events = []
    recipe = write_variant(tmp_path, *arguments, **changes)
    return goniometer.run(recipe, out=tmp_path / "runs", speed="max", subscribers=[events.append]), events


def ended(events):
    (event,) = (event for event in events if isinstance(event, ScanEnded))
    return event


def exits_deg(stored):
    return [round(point.exit_deg) for point in stored.points]


def test_a_scan_ends_as_soon_as_the_wanted_standard_errors_are_reached(tmp_path):
    stored, events = run(tmp_path, until={"n": 0.1, "sigma": 0.001})
    assert stored.fit.parameters["n"].stderr <= 0.1
    assert 4 < len(stored.points) < 61
    end = ended(events)
    assert end.as_asked
    n, sigma = (stored.fit.parameters[name].stderr for name in ("n", "sigma"))
    assert end.reason == f"wanted standard errors reached: n {n:.3g} <= 0.1, sigma {sigma:.3g} <= 0.001"
    assert end.readings == len(stored.readings)
    before_last = [event for event in events if isinstance(event, FitUpdated)][-3]
    assert before_last.points == len(stored.points) - 1
    assert before_last.result.parameters["n"].stderr > 0.1


def test_a_scan_is_repeated_until_the_wanted_standard_errors_are_reached(tmp_path):
    stored, events = run(tmp_path, until={"n": 0.07}, **EVERY_6)
    there = list(range(0, 61, 6))
    assert 11 < len(stored.points) < 33
    assert exits_deg(stored) == (there + there[::-1] + there)[: len(stored.points)]
    assert ended(events).reason.startswith("wanted standard errors reached")
    assert abs(stored.fit.parameters["n"].value - stored.truth["n"]) < 4 * stored.fit.parameters["n"].stderr


def test_a_scan_that_runs_out_of_time_says_what_is_missing(tmp_path):
    stored, events = run(tmp_path, until={"n": 0.001}, time_limit_s=60.0, **EVERY_6)
    end = ended(events)
    assert end.as_asked
    assert 50.0 < end.bench_duration_s < 60.0 * 1.03
    stderr = stored.fit.parameters["n"].stderr
    assert end.reason == f"time limit of 60 s: wanted standard errors not reached: n {stderr:.3g} > 0.001"


def test_a_model_that_misses_the_sample_does_not_end_the_scan(tmp_path):
    """Rough asymmetric grooves reflect many times; the recipe follows one reflection."""
    sample = {
        "material": "Fe",
        "sigma": 0.5,
        "asymmetry": 0.4,
        "bounces": 3,
        "rho_s": 0.7,
        "rho_d": 0.1,
        "rho_dd": 0.05,
    }
    scene = {"sample": sample, "effects": [{"effect": "acceptance_cone"}, {"effect": "shot_noise"}]}
    _, events = run(tmp_path, "iron", scene, until={"n": 3.0}, time_limit_s=60.0, **EVERY_6)
    assert "the model misses the data by more than their noise" in ended(events).reason
    assert ended(events).bench_duration_s > 50.0


def test_an_adaptive_scan_tells_what_it_chooses_and_why(tmp_path):
    stored, events = run(tmp_path, adaptive=True, until={"n": 0.03})
    started = events[0]
    assert isinstance(started, ScanStarted)
    assert (started.points, started.readings, started.expected_duration_s) == (None, None, 600.0)
    assert started.aim == "adaptive until n ± 0.03, for at most 10:00"
    chosen = [event for event in events if isinstance(event, DirectionChosen)]
    assert [event.point for event in chosen] == list(range(len(stored.points)))
    assert [round(event.exit_deg) for event in chosen] == exits_deg(stored)
    for event in chosen:
        of_point = [reading for reading in stored.readings if reading.point == event.point]
        assert len(of_point) == 5 * event.readings
    assert [event.why.split(",")[0] for event in chosen[:4]] == ["one of the first"] * 4
    assert "tells most about n per second" in {event.why for event in chosen}
    assert chosen[-1].standing.startswith("n 0.0")
    reduced = [event.stokes_point.point for event in events if isinstance(event, PointReduced)]
    assert reduced == list(range(len(stored.points)))
    assert ended(events).reason.startswith("wanted standard errors reached: n 0.0")
    assert stored.fit.parameters["n"].stderr <= 0.03


@pytest.fixture(scope="module")
def steered(tmp_path_factory):
    """An adaptive run until the index is known within 0.05, and its events."""
    return run(tmp_path_factory.mktemp("steered"), adaptive=True, until={"n": 0.05})


def test_same_seed_same_decisions_readings_and_time_stamps(steered, tmp_path):
    (first, _), (second, _) = steered, run(tmp_path, adaptive=True, until={"n": 0.05})
    assert first.readings == second.readings
    assert first.folder != second.folder


def test_an_adaptive_run_reads_back_with_directions_in_any_order_and_measured_twice(tmp_path, drawing):
    with drawing():
        stored, _ = run(tmp_path, adaptive=True, time_limit_s=120.0)
    visited = exits_deg(stored)
    assert len(set(visited)) < len(visited)
    assert visited != sorted(visited)
    again = stored_run(stored.folder)
    assert again.fit.to_dict() == stored.fit.to_dict()
    written = read_stokes_csv(stored.folder / "stokes.csv")
    assert [point.exit_deg for point in written] == [point.exit_deg for point in stored.points]
    # more readings, smaller errors: those of a reading that all share
    for point in stored.points:
        readings = sum(reading.point == point.point for reading in stored.readings) / 5
        stderr_w = np.sqrt(point.covariance[0, 0] * readings) * 1e-8 * np.cos(np.radians(point.exit_deg))
        assert_allclose(stderr_w, 1e-11, rtol=0.5)
    assert (stored.folder / "report.png").stat().st_size > 10_000


def test_an_adaptive_scan_follows_the_lamp_too(tmp_path):
    stored, _ = run(tmp_path, adaptive=True, time_limit_s=100.0, reference={"exit_deg": 45.0, "every_points": 2})
    references = {reading.point for reading in stored.readings if reading.kind == "reference"}
    last = stored.points[-1].point
    assert references == {point.point for point in stored.points if point.point % 2 == 0} | {last}
    assert stored.fit.p_value > 1e-4


def test_the_plan_of_a_scan_that_decides_as_it_goes_says_what_is_known(tmp_path):
    recipe = write_variant(tmp_path, adaptive=True, until={"n": 0.01})
    said = CliRunner().invoke(cli, ["check", str(recipe)]).output
    assert "iron at 60 degrees: adaptive until n ± 0.01, for at most 10:00\nat first: 4 directions, 20 steps" in said
    assert "Then at whichever of 61 exit angles, 0° to 60°, readings tell most per second, 3 or more" in said
    recipe = write_variant(tmp_path, until={"n": 0.01}, time_limit_s=30.0)
    said = CliRunner().invoke(cli, ["check", str(recipe)]).output
    assert "passes over the exit angles until n ± 0.01, for at most 0:30\none pass: 61 directions" in said
    assert "The time limit of 30 s ends the scan before all of these are measured." in said


def test_a_person_at_the_console_sees_choices_and_the_reason_of_the_end(tmp_path):
    recipe = write_variant(tmp_path, adaptive=True, until={"n": 0.05})
    command = [
        sys.executable,
        "-m",
        "goniometer",
        "run",
        str(recipe),
        "--speed",
        "max",
        "--out",
        str(tmp_path / "runs"),
    ]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr
    assert "iron at 60 degrees: adaptive until n ± 0.05, for at most 10:00 on the bench's clock" in done.stdout
    assert "next exit 20.00°, 3 readings a slot: one of the first" in done.stdout
    assert "tells most about n per second (n 0." in done.stdout
    assert "iron at 60 degrees: finished, " in done.stdout
    assert "Reason: wanted standard errors reached: n 0.0" in done.stdout


def test_the_live_view_shows_choices_and_what_is_still_wanted(steered):
    _, events = steered
    live = LiveConsole(LastingStream(io.StringIO()), now_s=lambda: 0.0)
    for event in events[:-2]:
        live(event)
    page = Console(file=io.StringIO(), width=100, color_system=None)
    page.print(live)
    shown = page.file.getvalue()
    assert "left at most" in shown
    assert "why here    tells most about n per second" in shown
    assert "wanted      n 0." in shown
    assert " of None" not in shown


@pytest.mark.skipif(sys.platform == "win32", reason="signals of this kind exist on POSIX only")
@pytest.mark.parametrize(("name", "code"), [("SIGINT", 130), ("SIGTERM", 143)])
def test_a_signal_ends_an_adaptive_scan_with_its_code_and_the_readings_stored(tmp_path, name, code):
    recipe = write_variant(tmp_path, adaptive=True, time_limit_s=100_000.0)
    command = [sys.executable, "-m", "goniometer", "run", str(recipe), "--json", "--speed", "20"]
    process = subprocess.Popen(
        [*command, "--out", str(tmp_path / "runs")], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    try:
        lines = []
        for line in process.stdout:
            lines.append(json.loads(line))
            if sum(event["event"] == "DirectionChosen" for event in lines) == 5:
                break
        process.send_signal(getattr(signal, name))
        lines += map(json.loads, process.stdout.read().splitlines())
        errors = process.stderr.read()
        assert process.wait(timeout=20) == code
    finally:
        process.kill()
        process.wait()
        process.stdout.close()
        process.stderr.close()
    assert lines[-1]["event"] == "ScanEnded"
    assert not lines[-1]["as_asked"]
    assert "The bench has been stopped" in errors
    (folder,) = (tmp_path / "runs").iterdir()
    stored = stored_run(folder)
    assert len(stored.readings) == sum(event["event"] == "ReadingStored" for event in lines)
    assert len(stored.points) >= 4


# What steering is worth: against the design that knew the sample, and against the uniform recipe


def stderr_of_n(stored):
    return stored.fit.parameters["n"].stderr


def design_stderr(setup, truth, time_s):
    """Standard error of n after a time of the design that knows the sample."""
    recipe, rig = setup.recipe, setup.rig
    family = surface_family(recipe.fit, rig.calibration.acceptance_sr)
    values = {name: truth[name] for name in family.names}
    once = recipe.model_copy(update={"readings": 1})
    points = expected_points(plan(once, rig), light_of(family.seen(values)), detection(recipe, rig))
    data = dataset(points)
    pieces = information(family, data.directions, data.covariance, values)
    visits = Visits(recipe, slots(rig), timing(rig))

    def cost(places):
        here, total_s = HOME, 0.0
        for place in places:
            steps = visits.steps(1, recipe.exit_angles_deg()[place], 0, here)
            here, total_s = steps[-1].target, total_s + sum(step.duration_s for step in steps)
        return total_s, np.full(len(places), 5 * (recipe.exposure_s + READING_S))

    n = family.names.index("n")
    readings = timed_design(pieces[None], Criterion(np.eye(len(family.names))[n]), cost, time_s, 10_000)
    return float(standard_errors(np.einsum("n,npq->pq", readings, pieces))[n])


def compare(tmp_path, sample, seeds, time_s):
    """Standard error of n after a time, adaptive to best design, each seed; and how many such errors are off."""
    ratios, off = [], []
    for seed in seeds:
        stored, events = run(tmp_path, sample, {"seed": seed}, adaptive=True, until={"n": 1e-6}, time_limit_s=time_s)
        setup = load_recipe(tmp_path / "recipes" / "steered.yaml")
        ratios.append(stderr_of_n(stored) / design_stderr(setup, stored.truth, ended(events).bench_duration_s))
        off.append((stored.fit.parameters["n"].value - stored.truth["n"]) / stderr_of_n(stored))
    return np.array(ratios), np.array(off)


@pytest.mark.parametrize("sample", ["iron", "glass"])
def test_an_adaptive_scan_comes_close_to_the_design_that_knew_the_sample(tmp_path, sample):
    ratios, off = compare(tmp_path, sample, [1], 120.0)
    assert ratios[0] < 1.15
    assert abs(off[0]) < 3.0


@pytest.mark.long
@pytest.mark.timeout(600)
@pytest.mark.parametrize("time_s", [100.0, 207.0])
@pytest.mark.parametrize("sample", ["iron", "glass"])
def test_an_adaptive_scan_comes_close_to_the_design_that_knew_the_sample_whatever_the_noise(tmp_path, sample, time_s):
    ratios, off = compare(tmp_path, sample, range(1, 13), time_s)
    assert np.mean(ratios) < 1.15
    assert np.max(ratios) < 1.25
    assert np.sqrt(np.mean(off**2)) < 1.7


def test_an_adaptive_scan_is_over_long_before_the_uniform_one_that_tells_as_much(tmp_path):
    stored, events = run(tmp_path, adaptive=True, until={"n": 0.04})
    assert stderr_of_n(stored) <= 0.04
    assert ended(events).bench_duration_s < 0.4 * 207.0, "the uniform recipe reaches 0.040 after 207 s"
