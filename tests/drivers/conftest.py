"""A scripted device on loopback, and a clock that a test turns by hand."""

from __future__ import annotations

import math
import select
import socket
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress

import pytest

from drivers.clock import Deadline
from drivers.wire.link import Link
from drivers.wire.ports import TcpPort

Split = Callable[[bytes], tuple[bytes, bytes, bytes]]


class HandTurnedClock:
    def __init__(self) -> None:
        self.time_s = 0.0

    def now(self) -> float:
        return self.time_s

    def sleep(self, duration_s: float) -> None:
        self.time_s += duration_s


class Peer(threading.Thread):
    """Answers each command from a table; a list is used up answer by answer, its last one stays. Unknown: silence."""

    def __init__(self, answers: Mapping[bytes, bytes | list[bytes]], split: Split) -> None:
        super().__init__(daemon=True)
        self._answers = {
            command: answer if isinstance(answer, list) else [answer] for command, answer in answers.items()
        }
        self._split = split
        self._listener = socket.create_server(("127.0.0.1", 0))
        self._wake, self._woken = socket.socketpair()
        self._client: socket.socket | None = None
        self._number = 0
        self._connected = threading.Event()
        self._one_at_a_time = threading.Lock()  # what a test says never overtakes an answer
        self.port = f"socket://127.0.0.1:{self._listener.getsockname()[1]}"
        self.commands: list[bytes] = []
        self.connections = 0
        self._heard: dict[int, float] = {}
        self._hears = threading.Condition()
        self.start()

    def run(self) -> None:
        received = b""
        while True:
            sockets = [s for s in (self._listener, self._woken, self._client) if s is not None]
            ready = select.select(sockets, [], [])[0]
            if self._woken in ready:
                return
            if self._listener in ready:
                self._hang_up()
                (self._client, (_, self._number)), received = self._listener.accept(), b""
                self.connections += 1
                self._connected.set()
            elif self._client is not None:
                try:
                    data = self._client.recv(4096)
                except OSError:
                    data = b""
                if not data:
                    self._hang_up()
                received += data
                command, end, rest = self._split(received)
                while end:
                    received = rest
                    with self._one_at_a_time:
                        self.commands.append(command)
                        self._answer(command)
                    command, end, rest = self._split(received)
                self._hear(len(data) if data else math.inf)

    def wait_until_heard(self, number: int, sent: int) -> None:
        """Wait until all that was sent on a connection has been heard, and what is to be answered was answered."""
        with self._hears:
            assert self._hears.wait_for(lambda: self._heard.get(number, 0) >= sent, 10)

    def say(self, data: bytes) -> None:
        assert self._connected.wait(5)
        assert self._client is not None
        with self._one_at_a_time:
            self._client.sendall(data)

    def vanish(self) -> None:
        assert self._connected.wait(5)
        assert self._client is not None
        self._client.shutdown(socket.SHUT_RDWR)

    def close(self) -> None:
        self._wake.close()
        self.join(5)
        self._hang_up()
        self._hear(math.inf)
        self._woken.close()
        self._listener.close()

    def _answer(self, command: bytes) -> None:
        answers = self._answers.get(command)
        if answers and self._client is not None:
            with suppress(ConnectionError):  # a client may hang up before its last answer; `run` sees that it has
                self._client.sendall(answers.pop(0) if len(answers) > 1 else answers[0])

    def _hang_up(self) -> None:
        if self._client is not None:
            self._client.close()
            self._client = None
            self._hear(math.inf)

    def _hear(self, length: float) -> None:
        with self._hears:
            self._heard[self._number] = self._heard.get(self._number, 0) + length
            self._hears.notify_all()


@pytest.fixture
def make_peer(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., Peer]]:
    peers: list[Peer] = []
    count_in_what_peers_have_heard(monkeypatch, peers)

    def make(
        answers: Mapping[bytes, bytes | list[bytes]], *, terminator: bytes = b"\r", split: Split | None = None
    ) -> Peer:
        peers.append(Peer(answers, split or (lambda received: received.partition(terminator))))
        return peers[-1]

    yield make
    for peer in peers:
        peer.close()


def count_in_what_peers_have_heard(monkeypatch: pytest.MonkeyPatch, peers: list[Peer]) -> None:
    """Let no port look for an answer before the peer has given it: answers then come at once, or not at all.

    A deadline as short as a test can wait for tells the two apart, also on a machine that has much else to do.
    """
    really_send, really_receive = TcpPort.send, TcpPort.receive
    sent: dict[tuple[str, int], int] = {}

    def connection(port: TcpPort) -> tuple[str, int]:
        return port._address, port._opened().getsockname()[1]

    def send(port: TcpPort, data: bytes) -> None:
        key = connection(port)
        really_send(port, data)
        sent[key] = sent.get(key, 0) + len(data)

    def receive(port: TcpPort, wait_s: float) -> bytes:
        address, number = connection(port)
        for peer in peers:
            if peer.port.partition("://")[2] == address.partition("://")[2]:
                peer.wait_until_heard(number, sent.get((address, number), 0))
        return really_receive(port, wait_s)

    monkeypatch.setattr(TcpPort, "send", send)
    monkeypatch.setattr(TcpPort, "receive", receive)


@pytest.fixture
def open_link() -> Iterator[Callable[..., Link]]:
    links: list[Link] = []

    def make(port: str, device: str, reply_timeout_s: float = 2.0) -> Link:
        links.append(Link(port, device=device, reply_timeout_s=reply_timeout_s))
        return links[-1]

    yield make
    for link in links:
        link.close()


@pytest.fixture
def clock() -> HandTurnedClock:
    return HandTurnedClock()


@pytest.fixture
def no_real_grace(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let a deadline pass with the test's clock alone."""
    monkeypatch.setattr(Deadline, "_REAL_GRACE_S", 0.0)


@pytest.fixture
def until() -> Callable[[Callable[[], bool]], None]:
    """Poll until true: bytes on loopback take a moment of real time, the test's clock stands still."""

    def poll(condition: Callable[[], bool]) -> None:
        give_up_s = time.monotonic() + 10
        while not condition():
            assert time.monotonic() < give_up_s, "never became true"

    return poll
