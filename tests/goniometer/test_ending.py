"""However a scan ends, the bench is stopped and every reading that was shown can be looked at."""

import json
import random
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import pytest
from scipy.stats import chi2

from acquisition.journal import FILE_NAME, Journal
from goniometer.assembly import connected
from goniometer.bench import served_ports, simulate
from goniometer.load_files import load_scene

ROOT = Path(__file__).resolve().parents[2]
RECIPE = ROOT / "recipes" / "iron_60deg.yaml"
RIG = ROOT / "rigs" / "simulated.yaml"
COMMAND = [sys.executable, "-m", "goniometer"]
posix_only = pytest.mark.skipif(sys.platform == "win32", reason="signals of this kind exist on POSIX only")


def goniometer(*arguments, **options):
    return subprocess.Popen(
        [*COMMAND, *map(str, arguments)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=ROOT, **options
    )


@contextmanager
def ended_afterwards(process):
    try:
        yield process
    finally:
        process.kill()
        process.wait()
        process.stdout.close()
        process.stderr.close()


def shown_readings(lines):
    return [event for event in map(json.loads, lines) if event["event"] == "ReadingStored"]


def run_until(out, readings, *options, recipe=RECIPE):
    """Start a scan and return it, with what it has shown, once it has shown a number of readings."""
    process = goniometer("run", recipe, "--json", "--out", out, *options)
    lines = []
    for line in process.stdout:
        lines.append(line)
        if len(shown_readings([line])) and len(shown_readings(lines)) >= readings:
            break
    return process, lines


def short_recipe(folder, step_deg):
    """The recipe in fewer directions."""
    path, text = folder / "short.yaml", RECIPE.read_text().replace("../", f"{ROOT.as_posix()}/")
    path.write_text(text.replace("step_deg: 1", f"step_deg: {step_deg}"))
    return path


def stored_readings(out):
    (folder,) = out.iterdir()
    with Journal.open(folder / FILE_NAME) as journal:
        return folder, journal.readings()


@posix_only
@pytest.mark.parametrize(("name", "code"), [("SIGINT", 130), ("SIGTERM", 143), ("SIGHUP", 129)])
def test_a_signal_ends_the_scan_with_its_code_and_the_readings_stored(tmp_path, name, code):
    process, lines = run_until(tmp_path, 20, "--speed", "20")
    with ended_afterwards(process):
        process.send_signal(getattr(signal, name))
        rest, errors = process.stdout.read(), process.stderr.read()
        process.wait(timeout=20)
    assert process.returncode == code
    lines += rest.splitlines()
    assert json.loads(lines[-1])["event"] == "ScanEnded"
    folder, readings = stored_readings(tmp_path)
    assert len(readings) == len(shown_readings(lines)) >= 20
    assert "The bench has been stopped" in errors
    assert f"goniometer fit {folder}" in errors


@posix_only
@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_a_signal_during_a_long_move_stops_the_axes(tmp_path, name):
    """The bench outlives the scan here, so that its axes can be asked afterwards."""
    scene = load_scene(ROOT / "scenes" / "iron.yaml")
    with simulate(scene.scene, 1.0) as bench:
        rig = tmp_path / "rig.yaml"
        text = (ROOT / "rigs" / "simulated.yaml").read_text()
        for address in bench.addresses.values():
            text = text.replace("port: simulated", f"port: {address.tcp}", 1)
        rig.write_text(text)
        recipe = tmp_path / "all_axes_move.yaml"
        recipe.write_text(
            RECIPE.read_text()
            .replace("../", f"{ROOT.as_posix()}/")
            .replace("incidence_deg: 60", "incidence_deg: 60\nazimuth_deg: 90")
            .replace("exit: {start_deg: 0, stop_deg: 60, step_deg: 1}", "exit_deg: [60]")
        )
        process = goniometer("run", recipe, "--json", "--rig", rig, "--out", tmp_path / "runs")
        with (
            ended_afterwards(process),
            connected(scene.rig, served_ports(scene.rig, bench), bench.clock, 550.0) as devices,
        ):
            while not 5.0 < devices.source_arm.position_deg() < 40.0:
                bench.clock.sleep(0.02)
            process.send_signal(getattr(signal, name))
            process.wait(timeout=20)
            axes = (devices.source_arm, devices.detector_arm, devices.sample_azimuth)
            first_deg = [axis.position_deg() for axis in axes]
            bench.clock.sleep(0.2)
            assert [axis.position_deg() for axis in axes] == first_deg
            assert not any(axis.is_moving() for axis in axes)
            target_deg = (60.0, 60.0, 90.0)
            assert all(0.5 < at < target for at, target in zip(first_deg, target_deg, strict=True))


@posix_only
@pytest.mark.parametrize("seed", range(2))
def test_kill_9_leaves_a_journal_that_fit_reads(tmp_path, seed):
    kill_at_any_moment(tmp_path, seed)


@posix_only
@pytest.mark.long
@pytest.mark.parametrize("seed", range(2, 102))
def test_kill_9_at_a_hundred_moments(tmp_path, seed):
    kill_at_any_moment(tmp_path, seed)


def kill_at_any_moment(tmp_path, seed):
    rng = random.Random(seed)
    recipe, out = short_recipe(tmp_path, 2), tmp_path / "runs"
    with recipe.open("a") as file:
        file.write("direction_within_s: 30\n")  # so that several sweeps have ended
    process, lines = run_until(out, rng.randrange(230, 400), "--speed", "max", recipe=recipe)
    with ended_afterwards(process):
        deadline = time.monotonic() + rng.uniform(0.0, 0.01)
        while time.monotonic() < deadline:
            pass
        process.send_signal(signal.SIGKILL)
        rest = process.stdout.read()  # communicate() would lose what the lines above were read with
    shown = shown_readings([*lines, *(line for line in rest.splitlines() if line.endswith("}"))])
    folder, readings = stored_readings(out)
    assert len(shown) <= len(readings) <= len(shown) + 1
    for event, reading in zip(shown, readings, strict=False):
        assert event["reading"]["power_w"] == reading.power_w
    with ended_afterwards(goniometer("fit", folder)) as fitting:
        out, errors = fitting.communicate(timeout=60)
    assert fitting.returncode == 0, errors
    assert "sigma" in out
    written = json.loads((folder / "fit.json").read_text())
    assert chi2.sf(written["chi_square"], written["degrees_of_freedom"]) > 1e-6, "a point was reduced wrong"
    assert (folder / "report.png").stat().st_size > 10_000


def test_a_bench_served_by_another_process_gives_the_same_result(tmp_path):
    with ended_afterwards(goniometer("simulate", ROOT / "scenes" / "iron.yaml", "--speed", "max")) as serving:
        rig = tmp_path / "rig.yaml"
        text = ""
        while "bench:" not in text:
            text += serving.stdout.readline()
        rig.write_text(text)
        short = short_recipe(tmp_path, 20)
        for folder, options in (("there", ["--rig", rig]), ("here", ["--speed", "max"])):
            with ended_afterwards(goniometer("run", short, "--quiet", "--out", tmp_path / folder, *options)) as scan:
                _, errors = scan.communicate(timeout=60)
                assert scan.returncode == 0, errors
    _, there = stored_readings(tmp_path / "there")
    _, here = stored_readings(tmp_path / "here")
    assert there == here
    fits = [json.loads((next((tmp_path / name).iterdir()) / "fit.json").read_text()) for name in ("there", "here")]
    assert fits[0] == fits[1]


@posix_only
def test_a_signal_that_was_ignored_at_the_start_stays_ignored(tmp_path):
    """As under nohup."""
    command = [
        sys.executable,
        "-c",
        "import signal; signal.signal(signal.SIGHUP, signal.SIG_IGN); import goniometer.cli; goniometer.cli.main()",
    ]
    short = short_recipe(tmp_path, 20)
    arguments = ["run", str(short), "--json", "--speed", "40", "--out", str(tmp_path / "runs")]
    process = subprocess.Popen([*command, *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    with ended_afterwards(process):
        process.stdout.readline()
        process.send_signal(signal.SIGHUP)
        rest = process.stdout.read().splitlines()
        assert process.wait(timeout=30) == 0
    assert json.loads(rest[-2])["reason"] == "finished"


def test_a_run_without_a_finished_direction_says_so(tmp_path):
    with Journal.create(tmp_path / FILE_NAME, {"recipe": RECIPE.read_text(), "rig": RIG.read_text(), "scene": ""}):
        pass
    with ended_afterwards(goniometer("fit", tmp_path)) as fitting:
        _, errors = fitting.communicate(timeout=60)
    assert fitting.returncode == 1
    assert "0 readings and not one finished direction" in errors


def test_a_program_without_a_standard_output_scans_all_the_same(tmp_path):
    short = short_recipe(tmp_path, 20)
    arguments = ["run", str(short), "--speed", "max", "--out", str(tmp_path / "runs")]
    code = f"import sys; sys.stdout = None; sys.argv[1:] = {arguments!r}"
    command = [sys.executable, "-c", f"{code}; import goniometer.cli; goniometer.cli.main()"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr
    _, readings = stored_readings(tmp_path / "runs")
    assert len(readings) == 4 * 5 * 3
