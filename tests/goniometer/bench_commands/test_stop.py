"""`goniometer stop`: what goes to devices of every make, and that everything is seen at rest."""

import re
import sys
from pathlib import Path

import pytest
import serial

from goniometer.assembly import connected
from goniometer.bench import served_ports
from goniometer.bench_commands.stop import stop
from goniometer.errors import ConfigurationError
from goniometer.load_files import load_scene
from sim_devices.faults.known import one_fault

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="signals of this kind exist on POSIX only")

ROOT = Path(__file__).resolve().parents[3]


ALL = ["analyzer: stopped", "detector_arm: stopped", "sample_azimuth: stopped", "source_arm: stopped"]


def move_for_ever(bench, speed_deg_s=1.0):
    """Have the source arm moved by another program, which is gone."""
    link = serial.serial_for_url(bench.sim.addresses["arms"].tcp, timeout=5)
    link.write(f"1MO\r1VA{speed_deg_s}\r1PA90\r1MD?\r".encode())
    assert link.readline() == b"0\r\n"
    link.close()


def test_a_bench_at_rest_is_stopped(serve, told):
    bench = serve()
    assert stop(bench.rig, told.append)
    assert sorted(told) == ALL


def test_a_device_that_cannot_be_reached_does_not_keep_the_others_from_being_stopped(serve, told):
    bench = serve()
    bench.change_rig(lambda rig: rig["devices"]["analyzer"].update(port="socket://127.0.0.1:1"))
    assert not stop(bench.rig, told.append)
    assert sorted(told)[1:] == ALL[1:]
    assert sorted(told)[0].startswith("analyzer: NOT STOPPED. analyzer: port socket://127.0.0.1:1 cannot be opened")


def test_an_axis_that_does_not_obey_is_told_of(serve, told, monkeypatch):
    monkeypatch.setattr("drivers.newport_esp301.stage.Esp301Stage.stop", lambda stage: None)
    monkeypatch.setattr("drivers.clock.Deadline._REAL_GRACE_S", 0.0)
    bench = serve()
    move_for_ever(bench)
    assert not stop(bench.rig, told.append)
    (failed,) = [line for line in told if line not in ALL]
    assert failed.startswith("source_arm: NOT STOPPED. source_arm: it answers, and still moves 10 s after")
    assert len(told) == 4


def test_simulated_devices_cannot_be_stopped_from_outside(serve, told):
    with pytest.raises(ConfigurationError, match="simulated by whichever program runs a scan"):
        stop(serve().rig.with_name("simulated_rig.yaml"), told.append)


AZ_STOP, AZ_STOP_OFF = bytes.fromhex("01 06 00 7D 00 20 18 0A"), bytes.fromhex("01 06 00 7D 00 00 19 D2")


APT_STOP, LEC_HOLD = bytes.fromhex("65 04 01 02 50 01"), bytes.fromhex("01 05 00 18 FF 00 0C 3D")


STOPS = {
    # behind an empty command, one that was cut off cannot swallow the stop
    "iron": {"arms": [b"WT0\r", b"1ST\r", b"WT0\r", b"2ST\r"], "sample_stage": [AZ_STOP, AZ_STOP_OFF], "analyzer": []},
    "iron_thorlabs": {
        "source_arm": [APT_STOP],
        "detector_arm": [APT_STOP],
        "table": [LEC_HOLD],
        "polarizer": [b"\r0st"],
    },
    "iron_slider": {"analyzer": [b"\r0st"]},
}


QUESTION = re.compile(
    rb"\d?(MD|TP|TB|VE)\?\r|pos\?\r|\r?0(in|gs|gp|gj)|\x01[\x01-\x03].{6}|(\x14\x04|\x80\x04|\x11\x02).\x00P\x01",
    re.DOTALL,
)


@pytest.mark.parametrize("scene", STOPS)
def test_nothing_goes_to_a_device_before_its_stop_and_only_questions_after_it(
    serve_shipped, told, tmp_path, sent, scene
):
    assert stop(serve_shipped(scene).rig, told.append, trace=tmp_path / "wire.log"), told
    writes = sent(tmp_path / "wire.log")
    assert "meter" not in writes
    for device, stops in STOPS[scene].items():
        assert writes[device][: len(stops)] == stops
        asked = writes[device][len(stops) :]
        assert asked, "nobody has looked whether it rests"
        assert [write for write in asked if not QUESTION.fullmatch(write)] == []


@pytest.mark.parametrize("scene", ["iron", "iron_thorlabs"])
def test_axes_of_every_make_that_a_program_has_left_moving_are_stopped(serve_shipped, told, scene):
    bench = serve_shipped(scene)
    setup = load_scene(ROOT / "scenes" / f"{scene}.yaml")
    roles = ("source_arm", "detector_arm", "sample_azimuth")
    with connected(setup.rig, served_ports(setup.rig, bench.sim), bench.sim.clock, None) as devices:
        for axis in devices.to_home:
            axis.start_homing()
            while axis.is_moving():
                bench.sim.clock.sleep(0.02)
        for role in roles:
            devices.axes[role].start_move(80)
    bench.sim.clock.sleep(0.5)
    begun_deg = {role: bench.motor_deg(role) for role in roles}
    assert stop(bench.rig, told.append), told
    assert not bench.is_moving()
    assert all(begun_deg[role] < bench.motor_deg(role) < 75 for role in roles)


@pytest.mark.parametrize(
    ("scene", "role", "fault"),
    [
        ("iron", "sample_azimuth", {"fault": "lost_home", "axis": "sample_azimuth"}),
        ("iron_thorlabs", "sample_azimuth", {"fault": "power_cycle", "device": "table", "off_s": 0.1}),
    ],
)
def test_an_axis_with_an_alarm_or_without_power_is_stopped_when_it_stands_still(
    serve_shipped, told, scene, role, fault
):
    bench = serve_shipped(scene)
    bench.sim.faults.switch_on(one_fault.validate_python(fault))
    bench.sim.clock.sleep(1.0)
    assert stop(bench.rig, told.append), told
    assert f"{role}: stopped" in told


def test_errors_left_in_a_controller_do_not_keep_its_axes_from_being_seen_at_rest(serve, told):
    bench = serve()
    link = serial.serial_for_url(bench.sim.addresses["arms"].tcp, timeout=5)
    link.write(b"XX\r1PA500\r1MD?\r")
    assert link.readline() == b"1\r\n"
    link.close()
    assert stop(bench.rig, told.append)
    assert sorted(told) == ALL


def test_a_stop_does_without_a_log_that_cannot_be_written(serve, told, tmp_path):
    bench = serve()
    move_for_ever(bench)
    assert stop(bench.rig, told.append, trace=tmp_path)
    assert "No wire log is kept" in told[0]
    assert not bench.is_moving()
