"""`goniometer stop` and other processes: whoever has a bench in motion or holds its ports, it is stopped."""

import os
import signal
import subprocess
import sys
import time

import pytest
import yaml

from drivers.newport_esp301.stage import Esp301Stage
from goniometer.bench_commands.port_lock import held_ports
from goniometer.bench_commands.stop import stop
from goniometer.errors import NotConnectedError
from goniometer.run_recipe import run
from sim_devices.serving.remote_clock import RemoteClock

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="signals of this kind exist on POSIX only")


ALL = ["analyzer: stopped", "detector_arm: stopped", "sample_azimuth: stopped", "source_arm: stopped"]


DEAF = """
import signal, sys, time
from goniometer.bench_commands.port_lock import held_ports
signal.signal(signal.SIGTERM, signal.SIG_IGN)
with held_ports(sys.argv[1:]):
    print("held", flush=True)
    time.sleep(60)
"""


@pytest.fixture
def started():
    """Start processes that are gone when the test ends."""
    processes = []

    def start(*command):
        processes.append(subprocess.Popen([sys.executable, *map(str, command)], stdout=subprocess.PIPE, text=True))
        return processes[-1]

    yield start
    for process in processes:
        process.kill()
        process.wait()
        process.stdout.close()


RECIPE = """\
recipe: to be stopped
rig: bench.yaml
scene: scene.yaml
wavelength_nm: 550
incidence_deg: 80
exit_deg: [0, 80]
analyzer_deg: [0, 45, 90, 135]
readings: 1
exposure_s: 0.099
fit: {lobes: [specular], free: {sigma: [0.001, 1.0]}, fixed: {n: 3.0, k: 3.0}}
"""


def run_until_moving(bench, started, *command):
    process = started("-m", "goniometer", *(command or ("move", "--rig", bench.rig, "source_arm", 80)))
    deadline = time.monotonic() + 20
    while not bench.is_moving():
        assert time.monotonic() < deadline, "the move has not begun"
        bench.sim.clock.sleep(0.02)
    return process


def test_another_process_is_ended_and_its_bench_stopped(serve, told, started):
    bench = serve(speed=1.0)
    process = run_until_moving(bench, started)
    assert stop(bench.rig, told.append)
    assert not bench.is_moving()
    assert 0 < bench.motor_deg("source_arm") < 75
    assert process.wait(timeout=10) == 128 + signal.SIGTERM
    assert f"process {process.pid} (__main__.py move --rig" in told[0]
    assert sorted(told[1:]) == ALL


def test_a_scan_is_ended_and_its_bench_stopped(serve, told, started, tmp_path):
    bench = serve(speed=1.0)
    recipe = tmp_path / "recipe.yaml"
    recipe.write_text(RECIPE)
    process = run_until_moving(bench, started, "run", recipe, "--quiet", "--out", tmp_path / "runs")
    assert stop(bench.rig, told.append)
    assert not bench.is_moving()
    assert 0 < bench.motor_deg("source_arm") < 75
    assert process.wait(timeout=10) == 128 + signal.SIGTERM
    assert f"process {process.pid} (__main__.py run" in told[0]


def test_a_scan_is_not_begun_on_ports_that_are_held(serve, started, tmp_path):
    bench = serve()
    recipe = tmp_path / "recipe.yaml"
    recipe.write_text(RECIPE)
    with (
        held_ports([bench.sim.addresses["meter"].tcp]),
        pytest.raises(NotConnectedError, match="it is held by process"),
    ):
        run(recipe, out=tmp_path / "runs")
    assert bench.sim.clock.now() == 0.0


def test_what_a_killed_process_has_left_moving_is_stopped(serve, told, started):
    bench = serve(speed=1.0)
    process = run_until_moving(bench, started)
    process.kill()
    process.wait()
    assert bench.is_moving()
    assert stop(bench.rig, told.append)
    assert not bench.is_moving()
    assert 0 < bench.motor_deg("source_arm") < 75
    assert sorted(told) == ALL


def test_a_process_that_does_not_let_go_is_named_and_the_axes_stopped_all_the_same(serve, told, started, monkeypatch):
    monkeypatch.setattr("goniometer.bench_commands.stop._LETS_GO_S", 0.2)
    bench = serve()
    process = started("-c", DEAF, bench.sim.addresses["arms"].tcp)
    process.stdout.readline()
    assert stop(bench.rig, told.append)
    assert f"has not let go within 0.2 s; end it with: kill -9 {process.pid}" in told[1]
    assert sorted(told[2:]) == ALL
    assert process.poll() is None


def test_ctrl_c_does_not_end_a_stop(serve, told, monkeypatch):
    obeyed = Esp301Stage.stop

    def interrupted(self):
        os.kill(os.getpid(), signal.SIGINT)
        obeyed(self)

    monkeypatch.setattr(Esp301Stage, "stop", interrupted)
    assert stop(serve().rig, told.append)
    assert sorted(told) == ALL


def test_the_clock_of_a_bench_that_is_in_use_is_not_needed(serve, told, monkeypatch):
    """Another user's program, which cannot be ended from here."""
    monkeypatch.setattr("goniometer.bench_commands.stop._CLOCK_FREE_S", 0.1)
    bench = serve(speed=1.0)
    other = RemoteClock(yaml.safe_load(bench.rig.read_text())["bench"])
    try:
        assert stop(bench.rig, told.append)
    finally:
        other.close()
    assert "another program is using this bench" in told[0]
    assert "Real time is used instead" in told[0]
    assert sorted(told[1:]) == ALL
