"""Signals at random instants, and resume: no reading is lost, none is there twice, and the results are the same."""

import json
import os
import random
import signal
import socket
import subprocess
import sys
import time
from contextlib import closing
from pathlib import Path

import pytest

import goniometer

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="signals of this kind exist on POSIX only")
WARM_COMMAND = Path(__file__).with_name("warm_command.py")
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


class Processes:
    """Runs the command in processes that begin at once: nothing has to be loaded or compiled in them."""

    def __init__(self, orders):
        self._orders = orders

    def ended_at(self, instant, arguments, ends):
        """Run one, end it as `instant` says; returns the readings that it has shown, its exit code and errors."""
        shows, says = os.pipe(), os.pipe()
        command = [*map(str, arguments), "--speed", "max", "--json"]
        socket.send_fds(self._orders, [json.dumps(command).encode()], [shows[1], says[1]])
        for end in (shows[1], says[1]):
            os.close(end)
        process, lines = int(self._orders.recv(100)), []
        with os.fdopen(shows[0], encoding="utf-8") as output, os.fdopen(says[0], encoding="utf-8") as errors:
            try:
                instant(output, lines)
                if ends is not None:
                    os.kill(process, ends)
                lines += output.readlines()
                said = errors.read()
            finally:
                os.kill(process, signal.SIGKILL)
                self._orders.sendall(b"?")
                code = int(self._orders.recv(100))
        return shown(lines), code, said


@pytest.fixture(scope="module")
def processes(longer, root, tmp_path_factory):
    ours, theirs = socket.socketpair()
    arguments = [theirs.fileno(), "run", longer, "--speed", "max", "--quiet", "--out", tmp_path_factory.mktemp("first")]
    command = [sys.executable, WARM_COMMAND, *arguments]
    with subprocess.Popen([*map(str, command)], stdin=subprocess.DEVNULL, pass_fds=[theirs.fileno()], cwd=root):
        theirs.close()
        with closing(ours):
            yield Processes(ours)


def at_a_step(rng):
    """A moment, up to 8 ms, after a random step has begun: in a move, in a reading, while it is stored."""
    steps, moment_s = rng.randint(1, MOST_STEPS), rng.uniform(0.0, 0.008)

    def instant(output, lines):
        begun = 0
        for line in output:
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
    pause_s = rng.uniform(0.0, 1.5)
    return lambda output, lines: time.sleep(pause_s)


def at_its_end(output, lines):
    """Let it finish."""


def interrupted_often(recipe, out, processes, rows, instants, ends, code):
    """Run a recipe, ended at every one of the instants until it finishes; the run's folder, and how often it was."""
    run, told = None, []
    for times, instant in enumerate((*instants, at_its_end)):
        arguments = ["run", recipe, "--out", out] if run is None else ["resume", run]
        readings, found, errors = processes.ended_at(instant, arguments, None if instant is at_its_end else ends)
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


def killed(seed, longer, expected, tmp_path, processes, rows, assert_same_results):
    rng = random.Random(seed)
    instants = [at_any_time(rng) if rng.random() < 0.2 else at_a_step(rng) for _ in range(KILLS)]
    run, times = interrupted_often(longer, tmp_path, processes, rows, instants, signal.SIGKILL, -signal.SIGKILL)
    assert_same_results(run, expected)
    return times


@pytest.mark.parametrize("seed", range(2))
def test_kill_9_at_40_instants(seed, longer, expected, tmp_path, processes, rows, assert_same_results):
    killed(seed, longer, expected, tmp_path, processes, rows, assert_same_results)


@pytest.mark.long
@pytest.mark.parametrize("seed", range(2, 27))
def test_kill_9_at_500_instants(seed, longer, expected, tmp_path, processes, rows, assert_same_results):
    killed(seed, longer, expected, tmp_path, processes, rows, assert_same_results)


@pytest.mark.parametrize("longer", [{}], ids=["references"], indirect=True)
@pytest.mark.parametrize(("name", "code"), [("SIGINT", 130), ("SIGTERM", 143), ("SIGHUP", 129)])
def test_signals_at_random_instants(name, code, longer, expected, tmp_path, processes, rows, assert_same_results):
    rng = random.Random(name)
    instants = [at_a_step(rng) for _ in range(3)]
    run, times = interrupted_often(longer, tmp_path, processes, rows, instants, getattr(signal, name), code)
    assert times == len(instants)
    assert_same_results(run, expected)
