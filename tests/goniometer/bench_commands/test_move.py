"""`goniometer move`: one axis goes where it may, no device is opened but those it needs, and in the end all rest."""

import json
import os
import signal
import subprocess
import sys
import threading

import pytest
from numpy.testing import assert_allclose

from goniometer.bench_commands.home import home
from goniometer.bench_commands.move import move
from goniometer.errors import (
    CollisionError,
    ConfigurationError,
    DeviceFaultError,
    LimitError,
    NotConnectedError,
    PositionError,
    ScanInterrupted,
)

posix_only = pytest.mark.skipif(sys.platform == "win32", reason="signals of this kind exist on POSIX only")


def goniometer(*arguments):
    command = [sys.executable, "-m", "goniometer", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)


def test_a_move_tells_from_to_duration_and_where_the_axis_stands(serve, told):
    bench = serve()
    move(bench.rig, "source_arm", 30, told.append, told.append)
    assert_allclose(bench.motor_deg("source_arm"), 30, atol=0.001)
    start_s = bench.sim.clock.now()
    told.clear()
    move(bench.rig, "source_arm", -4.5, told.append, told.append)
    # trapezoid: 34.5 / 20 + 20 / 80 s, then 0.05 s to settle
    assert told[0] == "source_arm: from 30.0000° to -4.5°, about 2.0 s"
    assert told[1] == "source_arm: stands at -4.5000°"
    assert_allclose(bench.motor_deg("source_arm"), -4.5, atol=0.001)
    assert 2.0 < bench.sim.clock.now() - start_s < 2.8


def test_a_move_against_backlash_counts_the_way_back(serve, told):
    bench = serve()
    bench.change_axis("source_arm", backlash_deg=1.0)
    move(bench.rig, "source_arm", 30, told.append, told.append)
    move(bench.rig, "source_arm", 20, told.append, told.append)
    # 11 degrees down: 11 / 20 + 20 / 80 s; 1 degree up: 2 √(1 / 80) s; 0.05 s to settle
    assert told[2] == "source_arm: from 30.0000° to 20°, about 1.1 s"


def test_a_target_beyond_the_limits_moves_nothing(serve, told):
    bench = serve()
    with pytest.raises(LimitError, match="target 91 degrees is outside the limits -5 to 90"):
        move(bench.rig, "source_arm", 91, told.append, told.append)
    assert bench.motor_deg("source_arm") == 0
    assert told == []


def test_a_way_through_a_zone_moves_nothing(serve, told):
    bench = serve(zones=[{"source_arm": [20, 25]}])
    with pytest.raises(CollisionError, match="the way from 0 to 40 degrees enters a collision zone"):
        move(bench.rig, "source_arm", 40, told.append, told.append)
    assert bench.motor_deg("source_arm") == 0
    move(bench.rig, "source_arm", 15, told.append, told.append)
    assert_allclose(bench.motor_deg("source_arm"), 15, atol=0.001)


def test_an_axis_that_stands_elsewhere_is_an_error(serve, told):
    """An encoder step coarser than the tolerance, as the rig file of another stage would have it."""
    bench = serve()
    bench.change_axis("source_arm", tolerance_deg=1e-5)
    with pytest.raises(PositionError, match=r"it came to rest at 10\.0005 degrees \(tolerance 1e-05"):
        move(bench.rig, "source_arm", 10.00033, told.append, told.append)


@pytest.mark.parametrize(
    "command",
    [
        lambda rig, tell, log: home(rig, ["sample_azimuth"], tell, tell, way_is_clear=False, trace=log),
        lambda rig, tell, log: home(rig, ["sample_azimuth"], tell, tell, way_is_clear=True, trace=log),
        lambda rig, tell, log: move(rig, "sample_azimuth", 5, tell, tell, trace=log),
    ],
    ids=["home", "home, way is clear", "move"],
)
def test_a_motion_needs_no_device_but_its_own_axis(serve_shipped, told, tmp_path, sent, command):
    bench = serve_shipped("iron")
    bench.switch_off("meter", "analyzer", "arms")
    command(bench.rig, told.append, tmp_path / "wire.log")
    assert list(sent(tmp_path / "wire.log")) == ["sample_stage"]


def test_of_a_controller_no_axis_is_set_up_but_the_one_that_moves(serve, told, tmp_path, sent):
    move(serve().rig, "detector_arm", 5, told.append, told.append, trace=tmp_path / "wire.log")
    addressed = {write[:1] for write in sent(tmp_path / "wire.log")["arms"] if write[:1].isdigit()}
    assert addressed == {b"2"}


def test_a_move_needs_the_axes_that_it_could_touch(beside_the_table, told, tmp_path, sent):
    move(beside_the_table.rig, "sample_azimuth", 105, told.append, told.append)
    log = tmp_path / "wire.log"
    with pytest.raises(CollisionError, match="the way from 0 to 70 degrees enters a collision zone"):
        move(beside_the_table.rig, "source_arm", 70, told.append, told.append, trace=log)
    assert set(sent(log)) == {"arms", "sample_stage"}
    assert {write[:1] for write in sent(log)["arms"] if write[:1].isdigit()} == {b"1"}
    beside_the_table.switch_off("sample_stage")
    with pytest.raises(NotConnectedError, match="sample_stage: port"):
        move(beside_the_table.rig, "source_arm", 30, told.append, told.append)
    assert beside_the_table.motor_deg("source_arm") == 0
    move(beside_the_table.rig, "detector_arm", 30, told.append, told.append)


def test_a_zone_of_other_axes_keeps_no_axis_from_moving(serve_shipped, told):
    """The arms stand in it, perhaps because it was written down wrongly."""
    bench = serve_shipped("iron")
    bench.set_zones({"source_arm": [-5, 5], "detector_arm": [-5, 5]})
    move(bench.rig, "sample_azimuth", 5, told.append, told.append)
    home(bench.rig, ["sample_azimuth"], told.append, told.append, way_is_clear=False)
    with pytest.raises(CollisionError, match="enters a collision zone"):
        move(bench.rig, "source_arm", 4, told.append, told.append)


def test_an_axis_that_the_rig_has_not_is_refused_before_anything_is_opened(serve, told, tmp_path):
    with pytest.raises(ConfigurationError, match="The rig 'test bench' has no axis polarizer"):
        move(serve().rig, "polarizer", 5, told.append, told.append, trace=tmp_path / "wire.log")
    assert not (tmp_path / "wire.log").exists()


@posix_only
@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM"])
@pytest.mark.parametrize(
    "command",
    [
        lambda rig, tell: home(rig, ("source_arm",), tell, tell, way_is_clear=False),
        lambda rig, tell: move(rig, "source_arm", 0, tell, tell),
    ],
    ids=["home", "move"],
)
def test_a_signal_stops_the_axis_on_its_way(serve, told, name, command):
    bench = serve()
    move(bench.rig, "source_arm", 80, told.append, told.append)
    began = []

    def interrupt(now_s):
        if not began:
            began.append(now_s)
            threading.Timer(0.0, os.kill, (os.getpid(), getattr(signal, name))).start()

    bench.sim.world.axes["source_arm"].before_motion.append(interrupt)
    with pytest.raises(ScanInterrupted):
        command(bench.rig, told.append)
    assert not bench.is_moving()
    assert bench.motor_deg("source_arm") > 1


def test_a_device_that_fails_leaves_the_others_at_rest(serve, told, monkeypatch):
    bench = serve()

    def fails(self):
        raise DeviceFaultError("source_arm", "it burns", not_done="the move", to_do="put it out")

    monkeypatch.setattr("drivers.newport_esp301.stage.Esp301Stage.is_moving", fails)
    with pytest.raises(DeviceFaultError, match="it burns"):
        move(bench.rig, "source_arm", 80, told.append, told.append)
    bench.sim.clock.sleep(1.0)
    assert not bench.is_moving()
    assert bench.motor_deg("source_arm") < 10


def test_the_command_line_takes_an_angle_below_zero_and_prints_json(serve):
    bench = serve()
    done = goniometer("move", "--rig", bench.rig, "detector_arm", "-30")
    assert done.returncode == 0, done.stderr
    assert "stands at -30.0000°" in done.stdout
    done = goniometer("read", "--rig", bench.rig, "--count", "2", "--json")
    assert json.loads(done.stdout)["positions_deg"]["detector_arm"] == -30
    refused = goniometer("move", "--rig", bench.rig, "detector_arm", "100")
    assert refused.returncode == 1
    assert "outside the limits -85 to 85" in refused.stderr
