"""Another process' clock follows the bench's."""

import contextlib
import json
import socket
import threading
import time

import pytest
from numpy.testing import assert_allclose

from goniometer.errors import DeviceFaultError, NotConnectedError, ReplyError
from sim_devices.bench import Address, Bench
from sim_devices.serving import control
from sim_devices.serving.clock import ScaledClock, VirtualClock
from sim_devices.serving.control import ControlServer
from sim_devices.serving.remote_clock import RemoteClock

TEXT = "scene: ground iron # Δ\n"


@pytest.fixture
def bench(scene_with):
    with Bench(scene_with(), VirtualClock()) as bench:
        yield bench


@pytest.fixture
def serve():
    servers = []

    def serve(bench):
        servers.append(ControlServer(bench, TEXT))
        return servers[-1].address

    yield serve
    for server in servers:
        server.stop()


@pytest.fixture
def remote():
    clocks = []

    def open_clock(address):
        clocks.append(RemoteClock(address))
        return clocks[-1]

    yield open_clock
    for clock in clocks:
        clock.close()


def test_a_remote_clock_passes_virtual_time_on_the_bench(bench, serve, remote, connect):
    clock = remote(serve(bench))
    assert (clock.speed, clock.scene_text) == ("max", TEXT)
    arms = connect(bench.addresses["arms"])
    for target in range(1, 30):
        arms.sendall(b"1MO;1PA%d\r" % target)
        clock.sleep(10.0)
        assert_allclose(bench.world.axes["source_arm"].position_deg(bench.clock.now()), target)
    assert_allclose(clock.now(), bench.clock.now())
    assert_allclose(bench.clock.now(), 290.0)


def test_a_remote_clock_counts_scaled_time_itself(scene_with, serve, remote, monkeypatch):
    with Bench(scene_with(), ScaledClock(1000)) as bench:
        clock = remote(serve(bench))
        assert clock.speed == 1000
        assert_allclose(clock.now(), bench.clock.now(), atol=300)
        slept = []
        monkeypatch.setattr(time, "sleep", slept.append)
        clock.sleep(50.0)
        assert slept == [0.05]


@pytest.mark.parametrize(
    ("line", "keys"),
    [
        (b'{"request": "hello"}', {"scene", "speed", "now_s"}),
        (b'{"request": "now"}', {"now_s"}),
        (b'{"request": "sleep", "duration_s": 2}', {"now_s"}),
        (b'{"request": "sleep", "duration_s": -2}', {"error"}),
        (b'{"request": "sleep", "duration_s": NaN}', {"error"}),
        (b'{"request": "sleep", "duration_s": true}', {"error"}),
        (b'{"request": "sleep"}', {"error"}),
        (b'{"request": "tea"}', {"error"}),
        (b"hello", {"error"}),
        (b"[]", {"error"}),
        (b"", {"error"}),
    ],
)
def test_requests_are_answered_one_line_each(bench, serve, connect, line, keys):
    client = connect(Address(serve(bench), None))
    client.sendall(line + b"\n")
    with client.makefile("rb") as replies:
        assert set(json.loads(replies.readline())) == keys


def test_one_program_at_a_time(bench, serve, remote):
    address = serve(bench)
    first = remote(address)
    with pytest.raises(DeviceFaultError, match="another program is using this bench"):
        RemoteClock(address)
    first.sleep(1.0)
    assert_allclose(first.now(), 1.0)


def test_no_bench_at_the_address():
    with socket.create_server(("127.0.0.1", 0)) as listener:
        address = f"socket://127.0.0.1:{listener.getsockname()[1]}"
    with pytest.raises(NotConnectedError, match="goniometer simulate"):
        RemoteClock(address)


@pytest.mark.parametrize("address", ["", "COM3", "socket://127.0.0.1", "socket://127.0.0.1:port"])
def test_an_address_that_is_none(address):
    with pytest.raises(NotConnectedError, match="cannot be reached"):
        RemoteClock(address)


def test_something_else_at_the_address(bench):
    with pytest.raises(ReplyError, match="control address"):
        RemoteClock(bench.listen(_Parrot()))


class _Parrot:
    def session(self):
        return self

    def receive(self, data, now_s):
        return [(now_s, data)]


def test_a_bench_that_has_gone(remote):
    with socket.create_server(("127.0.0.1", 0)) as listener:

        def answer_once():
            connection, _ = listener.accept()
            connection.recv(4096)
            connection.sendall(b'{"scene": "", "speed": "max", "now_s": 0}\n')
            connection.close()

        answering = threading.Thread(target=answer_once)
        answering.start()
        clock = remote(f"socket://127.0.0.1:{listener.getsockname()[1]}")
        answering.join()
        with pytest.raises(NotConnectedError, match="cannot be reached"):
            clock.now()


def test_what_was_sent_before_a_sleep_is_done_before_the_clock_moves(bench, serve, remote, connect):
    """A wheel begins to turn before the sleeper's time passes, however close together the two were sent."""
    clock = remote(serve(bench))
    wheel = connect(bench.addresses["analyzer"])
    for slot in (2, 3) * 20:
        wheel.sendall(b"pos=%d\r" % slot)
        clock.sleep(0.005)
        assert bench.world.analyzer.wheel.target == slot
        clock.sleep(2.0)


def test_a_program_that_goes_while_it_waits_leaves_the_bench_to_the_next(scene_with, serve, connect, monkeypatch):
    monkeypatch.setattr(control, "_NAP_S", 0.01)
    with Bench(scene_with(), ScaledClock(1)) as bench:
        address = serve(bench)
        with connect(Address(address, None)) as gone:
            gone.sendall(b'{"request": "sleep", "duration_s": 1000000}\n')
        answer, end_s = b"", time.monotonic() + 20
        while b"now_s" not in answer and time.monotonic() < end_s:
            with connect(Address(address, None)) as next_one, next_one.makefile("rb") as replies:
                next_one.sendall(b'{"request": "now"}\n')
                answer = replies.readline()
        assert b"now_s" in answer


def test_a_web_page_cannot_speak_to_a_bench(bench, serve, connect):
    fault = b'{"request": "fault", "fault": {"fault": "lamp_off", "for_s": 5}}\n'
    page = connect(Address(serve(bench), None))
    page.sendall(b"POST / HTTP/1.1\r\nContent-Type: text/plain\r\n\r\n" + fault)
    with page.makefile("rb") as replies:
        assert set(json.loads(replies.readline())) == {"error"}
        with contextlib.suppress(ConnectionError):
            assert replies.read() == b""
    assert bench.world.power_w(bench.clock.now()) > 0
