"""What devices say on their own: on true time, to whom it concerns, and without driving virtual time."""

import contextlib
import time
import tracemalloc

import pytest

from sim_devices.bench import Address
from sim_devices.serving import reactor as reactor_module
from sim_devices.serving.clock import ScaledClock, VirtualClock
from sim_devices.serving.reactor import Reactor


class Talker:
    """Told ``m``, says ``done`` after 10 s unless told ``s`` before; told ``u``, says the time every 0.1 s for ever.

    Told ``b``, it says ``begun`` on its own after 1 s, and then ``ended`` as a reply due at the same time.
    """

    def __init__(self, said=b"%d "):
        self._said = said
        self.moves = 0
        self.updates = 0

    def session(self):
        return self

    def receive(self, data, now_s):
        due = []
        for letter in data.decode():
            if letter in "ms":
                self.moves += 1
            if letter == "m":
                due.append((now_s + 10.0, lambda due_s, move=self.moves: self._done(due_s, move)))
            elif letter == "b":
                due += [(now_s + 1.0, lambda due_s: [(due_s, b"begun")]), (now_s + 1.0, b"ended")]
            elif letter == "u":
                due.append((now_s + 0.1, self._update))
            else:
                due.append((now_s + 0.01, letter.encode()))
        return due

    def _done(self, due_s, move):
        return [(due_s, b"done")] if move == self.moves else []

    def _update(self, due_s):
        self.updates += 1
        said = self._said % round(due_s * 10) if b"%" in self._said else self._said
        return [(due_s, said), (due_s + 0.1, self._update)]


@pytest.fixture
def reactors():
    """Those that serve; they are stopped after the test, and an error in them fails it."""
    serving = []
    yield serving
    for reactor in serving:
        reactor.stop()
        reactor.raise_failure()


@pytest.fixture
def serve(connect, reactors):
    """Serve a talker on a clock; a client of it, as many as are asked for."""

    def start(talker, clock):
        reactor = Reactor(clock)
        clock.attach(reactor)
        address = Address(f"socket://127.0.0.1:{reactor.listen(talker)}", None)
        reactor.start()
        reactors.append(reactor)
        return lambda: connect(address)

    return start


def received(client, size):
    data = b""
    while len(data) < size:
        data += client.recv(size - len(data))
    return data


def silent(client):
    client.setblocking(False)
    try:
        client.recv(1)
    except BlockingIOError:
        return True
    finally:
        client.settimeout(5)
    return False


def test_virtual_time_does_not_go_where_nobody_waits(serve):
    clock = VirtualClock()
    client = serve(Talker(), clock)()
    client.sendall(b"mu?")
    assert received(client, 1) == b"?"
    assert clock.now() == pytest.approx(0.01)
    clock.sleep(0.05)
    clock.sleep(0.0)
    assert silent(client)


def test_it_is_said_once_its_time_has_come_also_when_nobody_speaks(serve):
    clock = VirtualClock()
    client = serve(Talker(), clock)()
    client.sendall(b"m?")
    assert received(client, 1) == b"?"
    clock.sleep(10.0)
    assert received(client, 4) == b"done"


def test_what_was_due_before_a_word_is_said_before_the_answer(serve):
    clock = VirtualClock()
    client = serve(Talker(), clock)()
    client.sendall(b"m?")
    received(client, 1)
    clock.sleep(11.0)
    # too late to take it back
    client.sendall(b"s")
    assert received(client, 5) == b"dones"


def test_what_has_been_overtaken_is_not_said(serve):
    clock = VirtualClock()
    client = serve(Talker(), clock)()
    client.sendall(b"m?")
    received(client, 1)
    clock.sleep(5.0)
    client.sendall(b"s")
    assert received(client, 1) == b"s"
    clock.sleep(10.0)
    client.sendall(b"?")
    assert received(client, 1) == b"?"


def test_what_is_due_at_the_same_time_is_said_in_the_order_it_was_entered(serve):
    client = serve(Talker(), VirtualClock())()
    client.sendall(b"b")
    assert received(client, 10) == b"begunended"


def test_updates_come_in_order_between_answers_whatever_was_slept(serve):
    clock = VirtualClock()
    client = serve(Talker(), clock)()
    client.sendall(b"u")
    clock.sleep(0.595)
    # the answer is due after the sixth
    client.sendall(b"?")
    assert received(client, 13) == b"1 2 3 4 5 6 ?"
    client.sendall(b"m?")
    clock.sleep(10.3)
    client.sendall(b"?")
    heard = received(client, 1 + 2 * 3 + 3 * 90 + 4 * 10 + 4 + 1)
    assert heard.startswith(b"?7 8 9 10 ")
    assert heard.index(b"106 ") < heard.index(b"done") < heard.index(b"107 ")
    assert heard.endswith(b"?")


def test_updates_cost_no_time_and_no_memory_on_a_client_that_does_not_read(serve, reactors):
    clock, talker = VirtualClock(), Talker(said=b"x" * 1000)
    connect = serve(talker, clock)
    lazy, other = connect(), connect()
    lazy.sendall(b"u?")
    received(lazy, 1)
    began_s = time.monotonic()
    for _ in range(100):
        clock.sleep(36.0)
        assert max(len(link.unsent) for link in reactors[0]._clients._links) < 100_000
    other.sendall(b"?")
    assert received(other, 1) == b"?"
    assert talker.updates == pytest.approx(36_000, abs=2)
    assert time.monotonic() - began_s < 10


def flood(client, data, count):
    """Send again and again without reading, as much as is taken within a while; how many bytes were."""
    client.settimeout(0.2)
    sent = 0
    with contextlib.suppress(TimeoutError):
        for _ in range(count):
            sent += client.send(data)
    client.settimeout(5)
    return sent


def test_a_client_that_asks_for_much_to_be_said_later_is_not_listened_to_until_it_has_been(
    serve, reactors, monkeypatch
):
    # so that time does not pass by itself meanwhile
    monkeypatch.setattr(reactor_module, "_PATIENCE_S", 3600.0)
    clock, talker = VirtualClock(), Talker()
    connect = serve(talker, clock)
    lazy, other = connect(), connect()
    tracemalloc.start()
    flood(lazy, b"m" * 10_000, 2000)
    kept_bytes, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert talker.moves < 10_000
    assert kept_bytes < 8e6
    other.sendall(b"?")
    assert received(other, 1) == b"?"
    before = talker.moves
    clock.sleep(10.1)
    clock.sleep(0.0)
    assert talker.moves > before


def test_what_was_to_be_said_to_a_client_that_is_gone_is_forgotten(serve, reactors):
    clock = VirtualClock()
    connect = serve(Talker(), clock)
    for _ in range(20):
        client = connect()
        client.sendall(b"m" * 100 + b"?")
        received(client, 1)
        client.close()
        clock.sleep(0.0)
    other = connect()
    other.sendall(b"?")
    received(other, 1)
    assert len(reactors[0]._agenda._unasked) <= 100


def test_nothing_is_said_to_a_client_that_is_gone(serve):
    clock, talker = VirtualClock(), Talker()
    connect = serve(talker, clock)
    gone, other = connect(), connect()
    gone.sendall(b"u?")
    received(gone, 1)
    gone.close()
    other.sendall(b"?")
    received(other, 1)
    clock.sleep(1.0)
    clock.sleep(0.0)
    until_now = talker.updates
    clock.sleep(100.0)
    other.sendall(b"?")
    received(other, 1)
    assert talker.updates == until_now


def test_in_scaled_time_updates_come_when_they_are_due(serve):
    clock = ScaledClock(100)
    client = serve(Talker(), clock)()
    began_s = clock.now()
    client.sendall(b"u")
    heard = b""
    while heard.count(b" ") < 10:
        heard += client.recv(100)
    assert clock.now() - began_s >= 1.0
    times = [int(word) for word in heard.split()[:10]]
    assert times == list(range(times[0], times[0] + 10))
