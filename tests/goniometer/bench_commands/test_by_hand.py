"""What a person does with a bench by hand: home, move, read; every way out leaves it at rest."""

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
from goniometer.bench_commands.read import read
from goniometer.errors import (
    CollisionError,
    ConfigurationError,
    DeviceFaultError,
    LimitError,
    PositionError,
    ScanInterrupted,
)

posix_only = pytest.mark.skipif(sys.platform == "win32", reason="signals of this kind exist on POSIX only")
POST = {"detector_arm": [-85, -40], "source_arm": [-5, 90]}
"""Something that the detector arm hits, wherever the source arm stands."""


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


@pytest.mark.parametrize("roles", [(), ("detector_arm", "source_arm")])
def test_axes_are_homed_one_after_the_other(serve, told, roles):
    bench = serve()
    move(bench.rig, "detector_arm", 12, told.append, told.append)
    told.clear()
    together = []
    axes = bench.sim.world.axes.values()
    for axis in axes:
        axis.before_motion.append(lambda now_s: together.append(sum(axis.is_moving(now_s) for axis in axes)))
    home(bench.rig, roles, told.append, told.append, way_is_clear=False)
    assert bench.motor_deg("detector_arm") == 0
    assert max(together) <= 1
    homed = [line.split(":")[0] for line in told if "homed after" in line]
    assert homed == list(roles or ("source_arm", "detector_arm", "sample_azimuth"))
    assert "searches its home position, 180 s at most" in told[0]


def test_homing_tells_that_it_goes_on(serve, told):
    bench = serve()
    move(bench.rig, "sample_azimuth", 170, told.append, told.append)
    home(bench.rig, ("sample_azimuth",), told.append, told.append, way_is_clear=False)
    assert "sample_azimuth: still searching after 5 s" in told


def test_homing_is_refused_while_the_axis_could_touch_something(serve, told):
    bench = serve(zones=[POST])
    move(bench.rig, "detector_arm", 30, told.append, told.append)
    told.clear()
    with pytest.raises(CollisionError, match="from -85 to 85 degrees it can enter a collision zone: source_arm at -5"):
        home(bench.rig, ("detector_arm", "source_arm"), told.append, told.append, way_is_clear=False)
    assert told == []
    assert_allclose(bench.motor_deg("detector_arm"), 30, atol=0.001)


def test_homing_is_allowed_where_the_whole_travel_is_free(serve, told):
    bench = serve(zones=[POST])
    move(bench.rig, "detector_arm", 30, told.append, told.append)
    home(bench.rig, ("source_arm", "sample_azimuth"), told.append, told.append, way_is_clear=False)
    assert sum("homed after" in line for line in told) == 2


def test_an_axis_that_is_not_homed_may_stand_anywhere(serve, told, monkeypatch):
    bench = serve(zones=[POST])
    monkeypatch.setattr("drivers.newport_esp301.stage.Esp301Stage.is_homed", lambda stage: stage.name != "detector_arm")
    with pytest.raises(CollisionError, match="detector_arm anywhere from -85° to 85°"):
        home(bench.rig, ("source_arm",), told.append, told.append, way_is_clear=False)
    assert bench.motor_deg("source_arm") == 0


def test_a_person_may_say_that_the_way_is_clear(serve, told):
    bench = serve(zones=[POST])
    home(bench.rig, ("detector_arm",), told.append, told.append, way_is_clear=True)
    assert "detector_arm: homed after" in told[-1]


def test_a_stage_that_has_not_found_its_zero_is_an_error(serve, told, monkeypatch):
    bench = serve()
    monkeypatch.setattr("drivers.newport_esp301.stage.Esp301Stage.is_homed", lambda stage: False)
    with pytest.raises(DeviceFaultError, match="the search has ended, and that the zero is not known"):
        home(bench.rig, ("source_arm",), told.append, told.append, way_is_clear=False)


def test_reading_gives_positions_slot_and_the_spread_of_readings(serve, told):
    bench = serve()
    move(bench.rig, "detector_arm", 7, told.append, told.append)
    reading = read(bench.rig, 0.1, 4, 50, told.append)
    assert reading.positions_deg == {"source_arm": 0.0, "detector_arm": 7.0, "sample_azimuth": 0.0}
    assert (reading.slot, reading.holds) == (4, 90)
    assert_allclose(reading.exposure_s, 0.099)
    assert len(reading.readings_w) == 50
    assert_allclose(reading.power_w, sum(reading.readings_w) / 50)
    # read noise of a 3 ms sample over the root of 33 samples, and photons of 3.6e-19 J
    noise_w = (2e-11**2 / 33 + reading.power_w * 3.6e-19 / 0.099) ** 0.5
    assert_allclose(reading.stddev_w, noise_w, rtol=0.35)
    assert "polarizer at 90°" in str(reading)
    assert read(bench.rig, 0.1, None, 1, told.append).stddev_w is None


def test_an_axis_that_is_not_homed_is_told_of(serve, told, monkeypatch):
    bench = serve()
    monkeypatch.setattr("drivers.newport_esp301.stage.Esp301Stage.is_homed", lambda stage: stage.name != "detector_arm")
    reading = read(bench.rig, 0.1, None, 1, told.append)
    assert reading.not_homed == ("detector_arm",)
    assert "this position means nothing" in str(reading).splitlines()[1]


def test_an_exposure_too_long_for_the_detector_is_refused(serve, told):
    bench = serve()
    with pytest.raises(ConfigurationError, match="the detector averages 9 s at most"):
        read(bench.rig, 20, None, 1, told.append)


def test_a_rig_that_no_process_serves_has_nothing_to_reach(serve, told):
    bench = serve()
    with pytest.raises(ConfigurationError, match="Serve a bench with: goniometer simulate"):
        read(bench.rig.with_name("simulated_rig.yaml"), 0.1, None, 1, told.append)


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
    with pytest.raises(BaseExceptionGroup, match="not every device could be stopped"):
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
