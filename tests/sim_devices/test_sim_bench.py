"""The bench serves its devices to many clients, on true time, and says when it cannot."""

import contextlib
import os
import socket
import time

import pytest
from numpy.testing import assert_allclose

from goniometer.errors import DeviceFaultError
from sim_devices.bench import Address, Bench
from sim_devices.modbus.rtu import crc16
from sim_devices.serving.clock import ScaledClock, VirtualClock

NOISE = [{"effect": "shot_noise"}, {"effect": "read_noise", "power_w": 2e-11}]


@pytest.fixture
def bench(scene_with):
    with Bench(scene_with(effects=NOISE), VirtualClock()) as bench:
        yield bench


def answer(connection, command, end=b"\r\n"):
    """Send a command and read until its answer is complete."""
    connection.sendall(command)
    received = b""
    while not received.endswith(end):
        received += connection.recv(4096)
    return received


def test_every_device_answers_over_tcp(bench, connect):
    read = bytes.fromhex("01 03 00 CC 00 02")
    assert answer(connect(bench.addresses["arms"]), b"VE?\r").startswith(b"ESP301")
    assert answer(connect(bench.addresses["analyzer"]), b"pos?\r", b"> ") == b"pos?\r1\r> "
    assert answer(connect(bench.addresses["meter"]), b"*IDN?\n", b"\n").startswith(b"THORLABS")
    reply = bytes.fromhex("01 03 04 00 00 00 00")
    assert answer(connect(bench.addresses["sample_stage"]), read + crc16(read), crc16(reply)) == reply + crc16(reply)


@pytest.mark.skipif(not hasattr(os, "openpty"), reason="this system has no pseudo-terminals")
def test_every_device_answers_at_a_pty_for_one_client_after_the_other(bench):
    for command in (b"1MO;1PA5\r1PA?\r", b"1PA?\r"):
        terminal = os.open(bench.addresses["arms"].pty, os.O_RDWR | os.O_NOCTTY)
        try:
            os.write(terminal, command)
            assert os.read(terminal, 100) == b"5.000000\r\n"
        finally:
            os.close(terminal)


def test_a_system_without_ptys_still_has_tcp(scene_with, connect, monkeypatch):
    monkeypatch.delattr(os, "openpty", raising=False)
    with Bench(scene_with(), VirtualClock()) as bench:
        assert {address.pty for address in bench.addresses.values()} == {None}
        assert answer(connect(bench.addresses["arms"]), b"1TP\r") == b"0.000000\r\n"


def test_state_outlives_the_client(bench, connect):
    first = connect(bench.addresses["arms"])
    first.sendall(b"1MO;1PA33")
    first.close()
    second = connect(bench.addresses["arms"])
    second.sendall(b"1MO;1PA7\r")
    second.close()
    assert answer(connect(bench.addresses["arms"]), b"1PA?\r") == b"7.000000\r\n"


@pytest.mark.parametrize("clock", [ScaledClock(100), VirtualClock()], ids=["scaled", "virtual"])
def test_a_client_that_has_said_all_still_gets_its_answer(scene_with, connect, clock):
    with Bench(scene_with(), clock) as bench:
        client = connect(bench.addresses["arms"])
        client.sendall(b"WT3000;1TP\r")
        client.shutdown(socket.SHUT_WR)
        assert client.recv(100) == b"0.000000\r\n"
        assert client.recv(100) == b""


def test_many_clients_at_once(bench, connect):
    clients = [connect(bench.addresses["arms"]) for _ in range(12)]
    for client in clients:
        client.sendall(b"1TP\r")
    assert [client.recv(100) for client in clients] == [b"0.000000\r\n"] * 12


def test_more_clients_than_a_bench_takes_are_turned_away_and_disturb_nobody(bench, connect):
    first = connect(bench.addresses["arms"])
    assert answer(first, b"1TP\r", b"\r\n") == b"0.000000\r\n"
    crowd = [connect(bench.addresses["arms"]) for _ in range(300)]
    crowd[-1].settimeout(5)
    with contextlib.suppress(ConnectionError):
        assert crowd[-1].recv(1) == b""
    assert answer(first, b"1TP\r", b"\r\n") == b"0.000000\r\n"
    for client in crowd:
        client.close()
    assert answer(first, b"1TP\r", b"\r\n") == b"0.000000\r\n"


class _Talkative:
    """Answers every byte with a hundred thousand."""

    SIZE = 100_000

    def session(self):
        return self

    def receive(self, data, now_s):
        return [(now_s, b"x" * self.SIZE)] * len(data)


def test_a_client_that_is_slow_to_read_fills_no_memory_disturbs_nobody_and_loses_nothing(bench, connect):
    slow, questions = connect(Address(bench.listen(_Talkative()), None)), 300
    for _ in range(questions):
        slow.sendall(b"?")
        bench.serve()
    waiting = [link.scheduled_bytes + len(link.unsent) for link in bench._reactor._clients._links]
    assert 0 < max(waiting) < 3 * _Talkative.SIZE
    assert answer(connect(bench.addresses["meter"]), b"*OPC?\n", b"\n") == b"1\n"
    missing = questions * _Talkative.SIZE
    while missing:
        missing -= len(slow.recv(1 << 20))


def test_in_virtual_time_a_motion_lasts_exactly_its_profile(bench, connect):
    arms, clock, byte_s = connect(bench.addresses["arms"]), bench.clock, 10 / 921_600
    arms.sendall(b"1MO;1PA60\r")
    start_s = clock.now()
    clock.sleep(3.2499)
    assert answer(arms, b"1MD?\r") == b"0\r\n"
    assert_allclose(clock.now(), start_s + 3.2579 + (5 + 3) * byte_s)
    assert answer(arms, b"1MD?\r") == b"1\r\n"
    assert_allclose(bench.world.axes["source_arm"].end_s, start_s + 3.25 + 10 * byte_s)


def test_whoever_waits_for_a_reply_moves_virtual_time_to_it(bench, connect):
    start_s = bench.clock.now()
    assert answer(connect(bench.addresses["analyzer"]), b"pos=4\r", b"> ") == b"pos=4\r> "
    # six characters at 115200 baud, and three slots
    assert_allclose(bench.clock.now(), start_s + 6 * 10 / 115_200 + 1.5)


def test_sleeping_takes_what_was_sent_before(bench, connect):
    arms = connect(bench.addresses["arms"])
    for target in range(1, 30):
        arms.sendall(b"1MO;1PA%d\r" % target)
        bench.clock.sleep(10.0)
        assert_allclose(bench.world.axes["source_arm"].position_deg(bench.clock.now()), target)


def test_hours_pass_in_moments(bench, connect):
    arms, began_s = connect(bench.addresses["arms"]), time.monotonic()
    for target in (0, 90) * 500:
        arms.sendall(b"1MO;1PA%d\r" % target)
        bench.clock.sleep(30.0)
        assert answer(arms, b"1TP\r") == b"%d.000000\r\n" % target
    assert bench.clock.now() > 8 * 3600
    assert time.monotonic() - began_s < 10


def scan(scene, connect):
    """A small scan over plain sockets: every byte that came back, and when."""
    log = []
    with Bench(scene, VirtualClock()) as bench:
        arms, analyzer, meter = (connect(bench.addresses[name]) for name in ("arms", "analyzer", "meter"))
        meter.sendall(b"SENS:AVER 10\n")
        arms.sendall(b"1MO;2MO;1PA60\r")
        for exit_deg in range(0, 60, 10):
            arms.sendall(b"2PA%d\r" % exit_deg)
            bench.clock.sleep(5.0)
            for slot in (2, 3, 4, 5):
                analyzer.sendall(b"pos=%d\r" % slot)
                bench.clock.sleep(2.0)
                answer(analyzer, b"", b"> ")
                place = answer(arms, b"2TP\r")
                meter.sendall(b"READ?\n")
                bench.clock.sleep(0.1)
                log.append((place, answer(meter, b"", b"\n"), bench.clock.now()))
    return log


def test_the_same_scene_gives_the_same_bytes_at_the_same_times(scene_with, connect):
    one, again = scan(scene_with(effects=NOISE), connect), scan(scene_with(effects=NOISE), connect)
    other = scan(scene_with(effects=NOISE, seed=2), connect)
    assert one == again
    assert [reading for _, reading, _ in one] != [reading for _, reading, _ in other]
    assert [moment for *_, moment in one] == [moment for *_, moment in other]
    assert len({reading for _, reading, _ in one}) == len(one)


def test_in_scaled_time_a_reply_comes_when_it_is_due(scene_with, connect):
    clock = ScaledClock(100)
    with Bench(scene_with(), clock) as bench:
        arms = connect(bench.addresses["arms"])
        answer(arms, b"VE?\r")
        sent_s = clock.now()
        answer(arms, b"WT5000;VE?\r")
        assert 5.008 <= clock.now() - sent_s < 600


class _Broken:
    def session(self):
        return self

    def receive(self, data, now_s):
        raise ZeroDivisionError("a fault in the bench's own code")


@pytest.mark.parametrize("clock", [ScaledClock(1000), VirtualClock()], ids=["scaled", "virtual"])
def test_an_error_in_the_bench_is_not_lost(scene_with, connect, clock):
    bench = Bench(scene_with(), clock)
    bench.world.devices["meter"] = _Broken()
    bench.start()
    client = connect(bench.addresses["meter"])
    client.sendall(b"*IDN?\n")
    # the client sees at once that no answer will come
    assert client.recv(100) == b""
    with pytest.raises(DeviceFaultError, match="ZeroDivisionError"):
        clock.sleep(0.1)
    with pytest.raises(DeviceFaultError, match="start the bench again"):
        bench.stop()


def test_after_the_end_nothing_is_left(scene_with, connect):
    bench = Bench(scene_with(), VirtualClock())
    bench.start()
    client = connect(bench.addresses["arms"])
    answer(client, b"VE?\r")
    bench.stop()
    assert client.recv(100) == b""
    assert not bench._reactor._thread.is_alive()
    with pytest.raises(ConnectionRefusedError):
        connect(bench.addresses["arms"])
    # a clock that outlives its bench goes on
    bench.clock.sleep(1.0)
