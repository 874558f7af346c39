"""Faults of a scene, or asked for at run time, strike on a bench when their time has come, and only where named."""

import json
import os
import socket

import pytest
from numpy.testing import assert_allclose
from pydantic import ValidationError

from goniometer.errors import ConfigurationError
from sim_devices.bench import Address, Bench
from sim_devices.faults.faulty_port import FaultySession
from sim_devices.faults.known import one_fault
from sim_devices.modbus.rtu import crc16
from sim_devices.serving.clock import VirtualClock
from sim_devices.serving.control import ControlServer
from sim_devices.serving.remote_clock import RemoteClock

POSITION = bytes.fromhex("01 03 00 CC 00 02")
POSITION += crc16(POSITION)
STATUS = bytes.fromhex("01 03 00 7E 00 04")
STATUS += crc16(STATUS)


@pytest.fixture
def start(scene_with):
    """Start a bench in virtual time, with faults."""
    benches = []

    def start(*faults, **parts):
        benches.append(Bench(scene_with(faults=list(faults), **parts), VirtualClock()))
        benches[-1].start()
        return benches[-1]

    yield start
    for bench in benches:
        bench.stop()


def switch_on(bench, name, **keys):
    bench.faults.switch_on(one_fault.validate_python({"fault": name, **keys}))


def answer(connection, question, size):
    connection.sendall(question)
    received = b""
    while len(received) < size:
        data = connection.recv(4096)
        assert data, "the bench hung up"
        received += data
    return received


def is_silent(bench, connection, question):
    """Whether a question has no answer: what is sent is taken and answered before a sleep ends."""
    connection.sendall(question)
    bench.clock.sleep(0.5)
    bench.clock.sleep(0.0)
    connection.setblocking(False)
    try:
        return not connection.recv(4096)
    except BlockingIOError:
        return True
    finally:
        connection.settimeout(5)


def test_a_fault_strikes_when_its_time_has_come_and_then_no_more(start, connect):
    bench = start({"fault": "short", "device": "arms", "at_s": 10, "lost_bytes": 9})
    arms = connect(bench.addresses["arms"])
    assert answer(arms, b"1TP\r", 10) == b"0.000000\r\n"
    bench.clock.sleep(10)
    assert answer(arms, b"VE?\r", 20) == b"ESP301 Version 3.0.1"
    assert answer(arms, b"1TP\r", 10) == b"0.000000\r\n"


def test_a_fault_is_of_its_device_alone(start, connect):
    bench = start({"fault": "missing", "device": "meter", "replies": 100})
    assert answer(connect(bench.addresses["arms"]), b"1TP\r", 10) == b"0.000000\r\n"
    assert is_silent(bench, connect(bench.addresses["meter"]), b"*IDN?\n")


def test_a_fault_is_switched_on_while_clients_are_connected(start, connect):
    bench = start()
    arms = connect(bench.addresses["arms"])
    assert answer(arms, b"1TP\r", 10) == b"0.000000\r\n"
    switch_on(bench, "missing", device="arms")
    assert is_silent(bench, arms, b"1TP\r")
    assert answer(arms, b"1TP\r", 10) == b"0.000000\r\n"


def test_a_bench_without_faults_has_nothing_between(start, connect, monkeypatch):
    def refuse(self, data, now_s):
        raise AssertionError("a fault stands between")

    monkeypatch.setattr(FaultySession, "receive", refuse)
    bench = start()
    assert answer(connect(bench.addresses["arms"]), b"1TP\r", 10) == b"0.000000\r\n"


def test_noise_comes_without_being_asked_for(start, connect):
    bench = start()
    meter = connect(bench.addresses["meter"])
    answer(meter, b"*IDN?\n", 31)
    switch_on(bench, "noise", device="meter", noise_bytes=7, at_s=3.0)
    switch_on(bench, "stray_prompt", device="meter", text="> ", at_s=4.0)
    bench.clock.sleep(5)
    bench.clock.sleep(0)
    assert answer(meter, b"", 9)[7:] == b"> "


def test_endless_output_ends_with_the_fault(start, connect):
    bench = start()
    meter = connect(bench.addresses["meter"])
    answer(meter, b"*IDN?\n", 31)
    switch_on(bench, "endless_output", device="meter", for_s=0.1)
    bench.clock.sleep(1)
    bench.clock.sleep(0)
    output = answer(meter, b"", 10 * 512)
    assert len(output) < 13 * 512
    assert b"\n" not in output
    assert answer(meter, b"*IDN?\n", 31).startswith(b"THORLABS")


def test_a_pulled_cable_ends_connections_and_refuses_new_ones(start, connect):
    bench = start()
    first = connect(bench.addresses["arms"])
    answer(first, b"1MO;1TP\r", 10)
    first.sendall(b"1PA5\r")
    bench.clock.sleep(0.1)
    switch_on(bench, "cable_pulled", device="arms", for_s=20.0)
    bench.clock.sleep(0.1)
    assert first.recv(100) == b""
    assert connect(bench.addresses["arms"]).recv(100) == b""
    bench.clock.sleep(20)
    assert answer(connect(bench.addresses["arms"]), b"1TP\r", 10) == b"5.000000\r\n"


@pytest.mark.skipif(not hasattr(os, "openpty"), reason="this system has no pseudo-terminals")
def test_at_a_terminal_a_pulled_cable_loses_what_is_said(start):
    bench = start()
    if bench.addresses["arms"].pty is None:
        pytest.skip("this system has no pseudo-terminals left")
    terminal = os.open(bench.addresses["arms"].pty, os.O_RDWR | os.O_NOCTTY)
    try:
        switch_on(bench, "cable_pulled", device="arms", for_s=20.0)
        bench.clock.sleep(0.1)
        os.write(terminal, b"VE?\r")
        bench.clock.sleep(30)
        os.write(terminal, b"1TP\r")
        assert os.read(terminal, 100) == b"0.000000\r\n"
    finally:
        os.close(terminal)


def test_a_meter_that_lost_its_power_has_lost_its_settings(start, connect):
    bench = start()
    meter = connect(bench.addresses["meter"])
    assert answer(meter, b"SENS:AVER 10;AVER?\n", 3) == b"10\n"
    switch_on(bench, "power_cycle", device="meter", off_s=2.0)
    assert is_silent(bench, meter, b"SENS:AVER?\n")
    bench.clock.sleep(2)
    assert answer(meter, b"SENS:AVER?\n", 2) == b"1\n"


def test_arms_that_lost_their_power_count_from_where_they_stand(start, connect):
    bench = start()
    arms = connect(bench.addresses["arms"])
    answer(arms, b"1MO;1PA30;1WS;1TP\r", 11)
    switch_on(bench, "power_cycle", device="arms", off_s=0.1)
    bench.clock.sleep(5)
    assert answer(arms, b"1TP?;1MO?\r", 13) == b"0.000000\r\n0\r\n"
    assert_allclose(bench.world.axes["source_arm"].position_deg(bench.clock.now()), 30)


def test_a_reset_in_motion_waits_for_a_motion(start, connect):
    bench = start({"fault": "reset_in_motion", "axis": "source_arm", "into_motion_s": 0.5})
    arms = connect(bench.addresses["arms"])
    bench.clock.sleep(10)
    assert answer(arms, b"1MO;1MO?\r", 3) == b"1\r\n"
    arms.sendall(b"1PA60\r")
    bench.clock.sleep(6)
    assert answer(arms, b"1MO?;1MD?\r", 6) == b"0\r\n1\r\n"
    assert 1 < bench.world.axes["source_arm"].position_deg(bench.clock.now()) < 20


def test_a_stalled_axis_is_driven_in_vain(start, connect):
    bench = start({"fault": "stall", "axis": "detector_arm", "into_motion_s": 1.0})
    arms = connect(bench.addresses["arms"])
    arms.sendall(b"2MO;2PA60\r")
    bench.clock.sleep(30)
    first = answer(arms, b"2MD?;2TP\r", 14)
    bench.clock.sleep(30)
    assert answer(arms, b"2MD?;2TP\r", 14) == first
    assert first.startswith(b"0\r\n")


def test_a_limit_switch_stops_the_arm_and_takes_its_power(start, connect):
    bench = start({"fault": "limit_hit", "axis": "source_arm", "into_motion_s": 1.0})
    arms = connect(bench.addresses["arms"])
    arms.sendall(b"1MO;1PA60\r")
    bench.clock.sleep(5)
    assert answer(arms, b"TB?;1MO?\r", 20).split(b",")[0] == b"104"


def test_a_limit_switch_of_the_sample_stage_is_an_alarm(start, connect):
    bench = start()
    stage = connect(bench.addresses["sample_stage"])
    assert answer(stage, STATUS, 13)[3:11].hex()[8:] == "00000000"
    switch_on(bench, "lost_home", axis="sample_azimuth")
    bench.clock.sleep(1)
    assert answer(stage, STATUS, 13)[3:11].hex()[8:] == "0000004a"


def test_a_wheel_is_moved_on_by_hand(start, connect):
    bench = start({"fault": "wheel_by_hand", "device": "analyzer", "at_s": 5.0})
    wheel = connect(bench.addresses["analyzer"])
    assert answer(wheel, b"pos?\r", 9) == b"pos?\r1\r> "
    bench.clock.sleep(10)
    assert answer(wheel, b"pos?\r", 9) == b"pos?\r2\r> "
    assert bench.world.analyzer.wheel.slot(bench.clock.now()) == 2


def test_a_lamp_that_is_off_leaves_what_the_detector_has_of_its_own(start, connect):
    dark = {"effect": "dark_current", "power_w": 1e-9}
    bench = start({"fault": "lamp_off", "at_s": 5.0, "for_s": 10.0}, effects=[dark])
    meter = connect(bench.addresses["meter"])
    powers_w = []
    for _ in range(3):
        meter.sendall(b"MEAS:POW?\n")
        powers_w.append(float(meter.recv(100)))
        bench.clock.sleep(10)
    assert powers_w[0] == powers_w[2] > 1e-9
    assert_allclose(powers_w[1], 1e-9)


def test_a_saturated_detector_is_over_its_range_for_a_while(start, connect):
    bench = start({"fault": "detector_saturated", "at_s": 5.0, "for_s": 10.0})
    meter = connect(bench.addresses["meter"])
    said = []
    for _ in range(3):
        meter.sendall(b"MEAS:POW?\n")
        said.append(meter.recv(100))
        bench.clock.sleep(10)
    assert said[0] == said[2] != said[1] == b"9.9E+37\n"


@pytest.mark.parametrize(
    ("keys", "reason"),
    [
        ({"fault": "late", "device": "tea", "late_s": 1}, "of 'tea', and the devices are arms"),
        ({"fault": "crc_error", "device": "arms"}, "needs a Modbus RTU device, and arms is none"),
        ({"fault": "modbus_exception", "device": "meter"}, "needs a Modbus device, and meter is none"),
        ({"fault": "stall", "axis": "polarizer"}, "of the axis polarizer, which no device turns"),
        ({"fault": "late", "device": "arms"}, "late_s"),
        ({"fault": "late", "device": "arms", "late_s": "2"}, "late_s"),
        ({"fault": "tea"}, "fault"),
    ],
)
def test_a_fault_that_the_bench_cannot_have_is_refused_in_the_scene(scene_with, keys, reason):
    with pytest.raises(ValidationError, match=reason):
        scene_with(faults=[keys])


def test_a_device_that_has_no_button_cannot_be_pressed(start):
    bench = start()
    with pytest.raises(ConfigurationError, match="meter is a thorlabs_pm100, to which wheel_by_hand cannot happen"):
        switch_on(bench, "wheel_by_hand", device="meter")


@pytest.fixture
def control(start):
    """A bench with its control socket, and what asks it."""
    bench = start()
    server = ControlServer(bench, "scene: x\n")
    connections = []

    def ask(request):
        connections.append(socket.create_connection(("127.0.0.1", int(server.address.rpartition(":")[2])), timeout=5))
        connections[-1].sendall(json.dumps(request).encode() + b"\n")
        with connections[-1].makefile("rb") as replies:
            return json.loads(replies.readline())

    yield bench, server, ask
    for connection in connections:
        connection.close()
    server.stop()


def test_a_fault_is_asked_for_beside_a_running_scan(control, connect):
    bench, server, ask = control
    scan = RemoteClock(server.address)
    try:
        arms = connect(Address(bench.addresses["arms"].tcp, None))
        assert answer(arms, b"1TP\r", 10) == b"0.000000\r\n"
        assert set(ask({"request": "fault", "fault": {"fault": "missing", "device": "arms"}})) == {"now_s"}
        assert is_silent(bench, arms, b"1TP\r")
        scan.sleep(1.0)
    finally:
        scan.close()


@pytest.mark.parametrize(
    ("fault", "reason"),
    [
        ({"fault": "missing", "device": "tea"}, "the devices are arms, sample_stage, analyzer, meter"),
        ({"fault": "wheel_by_hand", "device": "meter"}, "cannot happen"),
        ({"fault": "late", "device": "arms"}, "late_s: Field required"),
        ({"fault": "tea"}, "does not match any of the expected tags"),
        (7, "valid dictionary"),
        (None, "valid dictionary"),
    ],
)
def test_a_fault_that_cannot_be_is_answered_with_the_reason(control, fault, reason):
    _, _, ask = control
    assert reason in ask({"request": "fault", "fault": fault})["error"]
