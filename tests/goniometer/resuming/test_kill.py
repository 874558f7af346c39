"""Signals at random instants, and resume: no reading is lost, none is there twice, and the results are the same."""

import json
import random
import signal
import subprocess
import sys
import time

import pytest

import goniometer

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="signals of this kind exist on POSIX only")
COMMAND = [sys.executable, "-m", "goniometer"]
POWER_W = 11
"""Its place in a row."""
KILLS = 10
MOST_STEPS = 12
"""Of the scan's 80 or more, that a process may begin before it is killed."""


@pytest.fixture(scope="module", params=[{}, {"reference": ""}], ids=["references", "sweeps"])
def longer(request, recipe):
    return recipe(step_deg=4, **request.param)


@pytest.fixture(scope="module")
def expected(longer, tmp_path_factory):
    """The run that was never interrupted."""
    return goniometer.run(longer, speed="max", out=tmp_path_factory.mktemp("expected"), live_fit=False).folder


def shown(lines):
    """The readings that a process has shown; the line in whose middle it was killed was not."""
    events = [json.loads(line) for line in lines if line.endswith("}\n")]
    return [event["reading"] for event in events if event["event"] == "ReadingStored"]


def ended_at(instant, arguments, ends, root):
    """Run a process, end it as `instant` says; returns the readings that it has shown, its exit code and errors."""
    command = [*COMMAND, *map(str, arguments), "--speed", "max", "--json"]
    lines = []
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=root) as process:
        try:
            instant(process, lines)
            if ends is not None:
                process.send_signal(ends)
            lines += process.stdout.readlines()
            errors = process.stderr.read()
        finally:
            process.kill()
    return shown(lines), process.returncode, errors


def at_a_step(rng):
    """A moment, up to 8 ms, after a random step has begun: in a move, in a reading, while it is stored."""
    steps, moment_s = rng.randint(1, MOST_STEPS), rng.uniform(0.0, 0.008)

    def instant(process, lines):
        begun = 0
        for line in process.stdout:
            lines.append(line)
            begun += '"StepStarted"' in line
            if begun == steps:
                break
        until_s = time.monotonic() + moment_s
        while time.monotonic() < until_s:
            pass

    return instant


def at_any_time(rng):
    """From the start of the process on: while devices are connected, axes are homed, or results are written."""
    pause_s = rng.uniform(0.0, 3.0)
    return lambda process, lines: time.sleep(pause_s)


def at_its_end(process, lines):
    """Let it finish."""


def interrupted_often(recipe, out, root, rows, instants, ends, code):
    """Run a recipe, ended at every one of the instants until it finishes; the run's folder, and how often it was."""
    run, told = None, []
    for times, instant in enumerate((*instants, at_its_end)):
        arguments = ["run", recipe, "--out", out] if run is None else ["resume", run]
        readings, found, errors = ended_at(instant, arguments, None if instant is at_its_end else ends, root)
        begun = [path.parent for path in out.glob("*/journal.sqlite") if path.stat().st_size]
        run = begun[-1] if begun else None
        stored = rows(run) if run else []
        assert stored[: len(told)] == told, "what was stored before has changed"
        assert [reading["power_w"] for reading in readings] == [row[POWER_W] for row in stored[: len(readings)]], "lost"
        told = stored
        if found == 0:
            return run, times
        assert found == code, errors
    raise AssertionError(errors)


def killed(seed, longer, expected, tmp_path, root, rows, assert_same_results):
    rng = random.Random(seed)
    instants = [at_any_time(rng) if rng.random() < 0.2 else at_a_step(rng) for _ in range(KILLS)]
    run, times = interrupted_often(longer, tmp_path, root, rows, instants, signal.SIGKILL, -signal.SIGKILL)
    assert_same_results(run, expected)
    return times


@pytest.mark.parametrize("seed", range(2))
def test_kill_9_at_40_instants(seed, longer, expected, tmp_path, root, rows, assert_same_results):
    killed(seed, longer, expected, tmp_path, root, rows, assert_same_results)


@pytest.mark.long
@pytest.mark.parametrize("seed", range(2, 27))
def test_kill_9_at_500_instants(seed, longer, expected, tmp_path, root, rows, assert_same_results):
    killed(seed, longer, expected, tmp_path, root, rows, assert_same_results)


@pytest.mark.parametrize("longer", [{}], ids=["references"], indirect=True)
@pytest.mark.parametrize(("name", "code"), [("SIGINT", 130), ("SIGTERM", 143), ("SIGHUP", 129)])
def test_signals_at_random_instants(name, code, longer, expected, tmp_path, root, rows, assert_same_results):
    rng = random.Random(name)
    instants = [at_a_step(rng) for _ in range(5)]
    run, times = interrupted_often(longer, tmp_path, root, rows, instants, getattr(signal, name), code)
    assert times == len(instants)
    assert_same_results(run, expected)
