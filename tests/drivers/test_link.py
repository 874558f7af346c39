from __future__ import annotations

import os
import select
import socket
import sys

import numpy as np
import pytest

from drivers.wire.framing import take_exactly, take_frame
from drivers.wire.link import Link
from goniometer.errors import DeviceFaultError, LimitError, NotConnectedError, ReplyError, ReplyTimeoutError

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


@pytest.mark.parametrize("trailing", [b"", b"\x00", b"\x01\x02\x03\x04"])
def test_frame_of_known_length_is_taken_with_its_last_byte_only(trailing):
    received = bytearray()
    for byte in b"\x80\x04\x01":
        assert take_exactly(received, 3) is None
        received.append(byte)
    received += trailing
    assert take_exactly(received, 3) == b"\x80\x04\x01"
    assert received == trailing


def waiting_bytes(link):
    with socket.socket(fileno=os.dup(link.fileno())) as same:
        return len(same.recv(100_000, socket.MSG_PEEK))


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
    until(lambda: waiting_bytes(link) == 20_004)
    link.discard_input()
    link.write(b"b\r")
    assert link.read_until(b"\n") == b"new"


def test_discard_of_an_endless_stream_is_given_up(make_peer, open_link, monkeypatch):
    link = open_link(make_peer({}).port, "meter", reply_timeout_s=0.01)
    monkeypatch.setattr(link._port, "receive", lambda wait_s: b"x")
    with pytest.raises(ReplyError, match=r"meter: bytes come on port .* without a pause"):
        link.discard_input()


def test_what_is_sent_after_the_other_end_hung_up_is_an_error(make_peer, open_link, until):
    peer = make_peer({})
    link = open_link(peer.port, "arms")
    peer.vanish()
    until(lambda: bool(select.select([link], [], [], 0)[0]))
    for _ in range(2):
        with pytest.raises(NotConnectedError, match="is gone"):
            link.write(b"1ST\r")


def test_reopened_link_is_a_fresh_one(make_peer, open_link):
    peer = make_peer({b"a": b"old\nhalf", b"b": b"new\n"})
    link = open_link(peer.port, "arms")
    link.write(b"a\r")
    assert link.read_until(b"\n") == b"old"
    link.reconnect()
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


def test_line_is_opened_as_the_device_needs_it(monkeypatch):
    asked = {}

    def refuse(address, **settings):
        asked.update(settings, address=address)
        raise OSError("no such port")

    monkeypatch.setattr("serial.serial_for_url", refuse)
    with pytest.raises(NotConnectedError, match="no such port"):
        Link("COM3", device="stage", baudrate=9600, parity="E", rtscts=True)
    needed = {"address": "COM3", "baudrate": 9600, "parity": "E", "rtscts": True, "exclusive": True}
    assert needed.items() <= asked.items()


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


def test_bytes_of_a_known_length_are_read_whole_and_leave_what_follows(make_peer, open_link):
    link = open_link(make_peer({b"a": b"\x01\x02\x03\x04\x05"}).port, "stage")
    link.write(b"a\r")
    assert link.read_exactly(2) == b"\x01\x02"
    assert link.read_exactly(3) == b"\x03\x04\x05"


def test_a_slow_drip_does_not_lengthen_the_deadline(open_link, make_peer, monkeypatch):
    link = open_link(make_peer({}).port, "meter", reply_timeout_s=3.0)
    now_s = [0.0]

    def drip(wait_s):
        now_s[0] += min(wait_s, 1.0)
        return b"x" if wait_s >= 1.0 else b""

    monkeypatch.setattr("drivers.wire.link.time.monotonic", lambda: now_s[0])
    monkeypatch.setattr(link._port, "receive", drip)
    with pytest.raises(ReplyTimeoutError, match=r"within 3 s \(received so far: b'xxx'\)"):
        link.read_until(b"\n")
    assert now_s[0] == 3.0


def test_a_request_may_have_a_deadline_of_its_own(make_peer, open_link):
    link = open_link(make_peer({}).port, "meter", reply_timeout_s=60)
    for read in (lambda: link.read_until(b"\n", 0.01), lambda: link.read_exactly(1, 0.01)):
        with pytest.raises(ReplyTimeoutError, match=r"within 0\.01 s"):
            read()


def test_silence_that_is_asked_for_is_waited_for(open_link, make_peer, monkeypatch):
    link = open_link(make_peer({}).port, "stage")
    waits, pieces = [], [b"noise", b"more", b""]
    monkeypatch.setattr(link._port, "receive", lambda wait_s: (waits.append(wait_s), pieces.pop(0))[1])
    link.discard_input(quiet_s=0.25)
    assert waits == [0.25, 0.25, 0.25]


class TestRepeats:
    def test_a_lost_answer_is_asked_for_again(self, make_peer, open_link):
        peer = make_peer({b"TP?": [b"", b"12.5\n"]})
        link = open_link(peer.port, "arms", reply_timeout_s=0.02)

        def ask():
            link.write(b"TP?\r")
            return link.read_until(b"\n")

        assert link.until_answered(ask) == b"12.5"
        assert peer.commands == [b"TP?", b"TP?"]

    def test_three_attempts_are_enough_and_each_is_told(self, make_peer, open_link, caplog):
        link = open_link(make_peer({}).port, "arms")
        attempts = []

        def refuse():
            attempts.append(1)
            raise ReplyError("arms", f"garbage {len(attempts)}", not_done="-", to_do="-")

        with pytest.raises(ReplyError, match="garbage 3"):
            link.until_answered(refuse)
        assert [record.message for record in caplog.records] == [
            "arms: attempt 1 failed and is repeated: garbage 1",
            "arms: attempt 2 failed and is repeated: garbage 2",
        ]

    @pytest.mark.parametrize("error", [NotConnectedError, DeviceFaultError, LimitError])
    def test_nothing_else_is_repeated(self, make_peer, open_link, error):
        link = open_link(make_peer({}).port, "arms")
        attempts = []

        def fail():
            attempts.append(1)
            raise error("arms", "no", not_done="-", to_do="-")

        with pytest.raises(error, match="no"):
            link.until_answered(fail)
        assert len(attempts) == 1


class TestReconnection:
    @pytest.fixture
    def link(self, make_peer):
        link = Link(make_peer({b"a": b"new\n"}).port, device="arms")
        yield link
        link.close()

    def test_port_that_comes_back_is_opened_and_its_devices_hear_of_it(self, link, clock, monkeypatch):
        forgotten = []
        link.on_reopen(lambda: forgotten.append(clock.time_s))
        really_open = link._port.open

        def open_from_two_seconds_on():
            if clock.time_s < 2:
                raise OSError("No such file or directory")
            really_open()

        monkeypatch.setattr(link._port, "open", open_from_two_seconds_on)
        with pytest.raises(NotConnectedError, match=r"arms: port .* cannot be opened \(No such file or directory\)"):
            link.reconnect()
        with pytest.raises(NotConnectedError, match="is gone"):
            link.write(b"a\r")
        assert (forgotten, clock.time_s) == ([], 0.0), "it waits for nobody"
        clock.time_s = 2.0
        link.reconnect()
        assert forgotten == [2.0]
        link.write(b"a\r")
        assert link.read_until(b"\n") == b"new"

    def test_every_device_on_the_port_hears_of_it(self, link):
        heard = []
        for name in ("source_arm", "detector_arm"):
            link.for_device(name).on_reopen(lambda name=name: heard.append(name))
        link.for_device("sample_azimuth").reconnect()
        assert heard == ["source_arm", "detector_arm"]
        link.write(b"a\r")
        assert link.read_until(b"\n") == b"new"


def test_devices_on_one_port_share_it_and_are_named_apart(make_peer, open_link):
    peer = make_peer({b"0gs": b"0GS00\r\n1GS00\r\n"})
    bus = open_link(peer.port, "bus", reply_timeout_s=0.02)
    first, second = bus.for_device("polarizer"), bus.for_device("analyzer")
    first.write(b"0gs\r")
    assert first.read_until(b"\r\n") == b"0GS00"
    assert second.read_until(b"\r\n") == b"1GS00"
    for link in (first, second):
        with pytest.raises(ReplyTimeoutError, match=f"^{link.device}: no complete answer"):
            link.read_until(b"\r\n")
    assert peer.connections == 1


def test_device_that_takes_nothing_is_a_timeout(make_peer, open_link):
    with socket.create_server(("127.0.0.1", 0)) as deaf:
        port = f"socket://127.0.0.1:{deaf.getsockname()[1]}"
        link = open_link(port, "arms", reply_timeout_s=0.02)
        with pytest.raises(ReplyTimeoutError, match=r"arms: it did not take .* within 0\.02 s"):
            link.write(bytes(50_000_000))


@pytest.mark.parametrize("method", ["read_until", "poll_until"])
def test_any_bytes_in_any_pieces_end_as_frames_or_as_errors(open_link, make_peer, monkeypatch, method):
    random = np.random.default_rng(5)
    link = open_link(make_peer({}).port, "meter", reply_timeout_s=1e-9)
    for _ in range(10_000):
        piece = random.choice(np.frombuffer(b"1.5e\r\n\x00\xff", np.uint8), random.integers(0, 60)).tobytes()
        monkeypatch.setattr(link._port, "receive", lambda wait_s, piece=piece: piece)
        try:
            frame = getattr(link, method)(b"\r\n")
        except (ReplyError, ReplyTimeoutError):
            frame = b""
        assert frame is None or b"\r\n" not in frame
        assert len(link._received) < 4096 + 60


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

    def test_unplugged_port_is_not_connected_and_is_opened_again(self, open_link, clock, tmp_path):
        import tty

        first, second = os.openpty(), os.openpty()
        for pair in (first, second):
            tty.setraw(pair[1])
        adapter = tmp_path / "ttyUSB0"
        adapter.symlink_to(os.ttyname(first[1]))
        link = open_link(str(adapter), "arms")
        os.close(first[1])
        os.close(first[0])
        with pytest.raises(NotConnectedError, match=r"arms: the link on port .*ttyUSB0 is gone"):
            link.read_until(b"\n")
        adapter.unlink()
        adapter.symlink_to(os.ttyname(second[1]))
        link.reconnect()
        os.write(second[0], b"1.5\n")
        assert link.read_until(b"\n") == b"1.5"
        os.close(second[0])
        os.close(second[1])

    def test_terminal_without_parity_is_opened_again(self, terminal):
        controller, port = terminal
        link = Link(port, device="stage", parity="E")
        link.reconnect()
        link.write(b"1TP?\r")
        assert os.read(controller, 5) == b"1TP?\r"
        link.close()

    def test_line_without_rts_does_not_mind(self, terminal, open_link):
        link = open_link(terminal[1], "stage")
        link.set_rts(on=True)
        link.set_rts(on=False)

    def test_one_program_a_port(self, terminal, open_link):
        open_link(terminal[1], "arms")
        with pytest.raises(NotConnectedError, match="close other programs that use the port"):
            Link(terminal[1], device="other")
