from __future__ import annotations

import os
import select
import socket
import sys

import pytest

from drivers.link import Link, take_frame
from goniometer.errors import NotConnectedError, ReplyError, ReplyTimeoutError

FRAMES = [
    (b"\r\n", b"12.500000\r\n", b"12.500000"),
    (b"\r\n", b"\r\n", b""),
    (b"\r\n", b"a\rb\n\r\n", b"a\rb\n"),
    (b"> ", b"pos?\r3\r> ", b"pos?\r3\r"),
    (b"> ", b"a>b > ", b"a>b "),
    (b"\n", b"1.234205E-03\n", b"1.234205E-03"),
]


@pytest.mark.parametrize(("terminator", "sent", "frame"), FRAMES)
@pytest.mark.parametrize("trailing", [b"", b"7", b"7\r\n8\n9> "])
def test_frame_is_taken_whole_and_leaves_what_follows(terminator, sent, frame, trailing):
    received = bytearray(sent + trailing)
    assert take_frame(received, terminator) == frame
    assert received == trailing


@pytest.mark.parametrize(("terminator", "sent", "frame"), FRAMES)
def test_frame_that_comes_byte_by_byte_is_taken_with_its_last_byte_only(terminator, sent, frame):
    received = bytearray()
    for byte in sent[:-1]:
        received.append(byte)
        assert take_frame(received, terminator) is None
    received.append(sent[-1])
    assert take_frame(received, terminator) == frame
    assert not received


def test_two_answers_in_one_packet_are_read_one_after_the_other(make_peer, open_link):
    link = open_link(make_peer({b"a": b"1\n2\n"}).port, "meter")
    link.write(b"a\r")
    assert link.read_until(b"\n") == b"1"
    assert link.read_until(b"\n") == b"2"


def test_poll_never_waits_and_returns_the_frame_once_it_is_whole(make_peer, open_link, until):
    peer = make_peer({b"a": b"1"})
    link = open_link(peer.port, "meter")
    assert link.poll_until(b"\n") is None
    link.write(b"a\r")
    until(lambda: bool(peer.commands))
    assert link.poll_until(b"\n") is None
    peer.say(b"2\n3")
    frames = []
    until(lambda: (frame := link.poll_until(b"\n")) is not None and not frames.append(frame))
    assert frames == [b"12"]


def test_discard_drops_what_came_before(make_peer, open_link, until):
    peer = make_peer({b"a": b"old\nhalf", b"b": b"new\n"})
    link = open_link(peer.port, "meter")
    link.write(b"a\r")
    assert link.read_until(b"\n") == b"old"
    link.discard_input()
    link.write(b"b\r")
    assert link.read_until(b"\n") == b"new"


def test_discard_drops_more_than_one_packet(make_peer, open_link, until):
    peer = make_peer({b"a": b"x" * 20_000 + b"old\n", b"b": b"new\n"})
    link = open_link(peer.port, "meter")
    link.write(b"a\r")
    until(lambda: bool(peer.commands))
    peer.say(b"")
    until(lambda: len(link._socket.recv(100_000, socket.MSG_PEEK)) == 20_004)
    link.discard_input()
    link.write(b"b\r")
    assert link.read_until(b"\n") == b"new"


def test_discard_of_an_endless_stream_is_given_up(make_peer, open_link, monkeypatch):
    link = open_link(make_peer({}).port, "meter", reply_timeout_s=0.01)
    monkeypatch.setattr(link, "_receive", lambda wait_s: b"x")
    with pytest.raises(ReplyError, match=r"meter: bytes come on port .* without a pause"):
        link.discard_input()


def test_what_is_sent_after_the_other_end_hung_up_is_an_error(make_peer, open_link, until):
    peer = make_peer({})
    link = open_link(peer.port, "arms")
    peer.vanish()
    until(lambda: bool(select.select([link._socket], [], [], 0)[0]))
    for _ in range(2):
        with pytest.raises(NotConnectedError, match="is gone"):
            link.write(b"1ST\r")


def test_reopened_link_is_a_fresh_one(make_peer, open_link):
    peer = make_peer({b"a": b"old\nhalf", b"b": b"new\n"})
    link = open_link(peer.port, "arms")
    link.write(b"a\r")
    assert link.read_until(b"\n") == b"old"
    link.reopen()
    link.write(b"b\r")
    assert link.read_until(b"\n") == b"new"
    assert peer.connections == 2


def test_silence_names_device_port_and_question(make_peer, open_link):
    peer = make_peer({})
    link = open_link(peer.port, "arms", reply_timeout_s=0.02)
    link.write(b"VE?\r")
    with pytest.raises(
        ReplyTimeoutError, match=rf"arms: no complete answer to b'VE\?\\r' on port {peer.port} within 0.02 s"
    ):
        link.read_until(b"\n")


def test_half_an_answer_is_a_timeout_that_shows_the_half(make_peer, open_link):
    link = open_link(make_peer({b"a": b"12.5"}).port, "arms", reply_timeout_s=0.05)
    link.write(b"a\r")
    with pytest.raises(ReplyTimeoutError, match=r"received so far: b'12\.5'"):
        link.read_until(b"\n")


@pytest.mark.parametrize("method", ["read_until", "poll_until"])
def test_endless_output_is_refused(make_peer, open_link, until, method):
    link = open_link(make_peer({b"a": b"x" * 20_000}).port, "meter")
    link.write(b"a\r")
    with pytest.raises(ReplyError, match="meter: more than 4096 bytes without an end"):
        until(lambda: getattr(link, method)(b"\n") is not None)


def test_closed_port_says_what_to_do():
    with socket.create_server(("127.0.0.1", 0)) as server:
        free = server.getsockname()[1]
    with pytest.raises(NotConnectedError, match=rf"arms: port socket://127.0.0.1:{free} cannot be opened .*cable"):
        Link(f"socket://127.0.0.1:{free}", device="arms")


@pytest.mark.parametrize("port", ["socket://nowhere", "no_such_scheme://x", "/dev/no_such_port"])
def test_unusable_address_is_not_connected(port):
    with pytest.raises(NotConnectedError, match="cannot be opened"):
        Link(port, device="arms")


@pytest.mark.skipif(sys.platform == "win32", reason="terminals are POSIX")
def test_terminal_that_fails_while_it_is_opened_is_not_connected(monkeypatch):
    import termios

    def fail(*_, **__):
        raise termios.error(5, "Input/output error")

    monkeypatch.setattr("serial.serial_for_url", fail)
    with pytest.raises(NotConnectedError, match="cannot be opened"):
        Link("/dev/ttyUSB0", device="arms")


def test_vanished_device_is_not_connected(make_peer, open_link):
    peer = make_peer({})
    link = open_link(peer.port, "arms")
    peer.vanish()
    with pytest.raises(NotConnectedError, match=r"arms: the link on port .* is gone"):
        link.read_until(b"\n")


def test_closed_link_is_not_connected_and_closes_twice(make_peer, open_link):
    link = open_link(make_peer({}).port, "arms")
    link.close()
    link.close()
    for use in (lambda: link.write(b"a"), lambda: link.read_until(b"\n"), lambda: link.poll_until(b"\n")):
        with pytest.raises(NotConnectedError, match="is gone"):
            use()


def test_nagle_is_off(make_peer, open_link, monkeypatch):
    options = []
    monkeypatch.setattr(socket.socket, "setsockopt", lambda self, *option: options.append(option))
    open_link(make_peer({}).port, "arms")
    assert (socket.IPPROTO_TCP, socket.TCP_NODELAY, 1) in options


@pytest.mark.skipif(sys.platform == "win32", reason="pseudo terminals are POSIX")
class TestPseudoTerminal:
    @pytest.fixture
    def terminal(self):
        import tty

        controller, terminal = os.openpty()
        tty.setraw(terminal)
        yield controller, os.ttyname(terminal)
        os.close(controller)
        os.close(terminal)

    def test_reads_and_polls(self, terminal, open_link, until):
        controller, port = terminal
        link = open_link(port, "arms")
        assert link.poll_until(b"\n") is None
        link.write(b"1TP?\r")
        assert os.read(controller, 5) == b"1TP?\r"
        os.write(controller, b"1.5\n2.5\n")
        assert link.read_until(b"\n") == b"1.5"
        assert link.poll_until(b"\n") == b"2.5"

    def test_silence_is_a_timeout(self, terminal, open_link):
        link = open_link(terminal[1], "arms", reply_timeout_s=0.02)
        with pytest.raises(ReplyTimeoutError, match="no complete answer"):
            link.read_until(b"\n")

    def test_one_program_a_port(self, terminal, open_link):
        open_link(terminal[1], "arms")
        with pytest.raises(NotConnectedError, match="close other programs that use the port"):
            Link(terminal[1], device="other")
