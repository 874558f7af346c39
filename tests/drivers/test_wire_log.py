from __future__ import annotations

import errno
import re

import pytest

from drivers.wire.link import Link
from drivers.wire.wire_log import WireLog

WALL_TIME = r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{6}Z"


@pytest.fixture
def log_of(tmp_path, clock):
    logs = []

    def make(**limits):
        logs.append(WireLog(tmp_path / "wire.log", clock, **limits))
        return logs[-1]

    yield make
    for log in logs:
        log.close()


def columns(path):
    return [line.split("\t") for line in path.read_text("ascii").splitlines()]


def test_line_has_both_times_device_direction_text_and_hex(log_of, tmp_path, clock):
    log, clock.time_s = log_of(), 12.5
    log.sent("arms", b"1TP?\r")
    log.received("arms", b"\x00\x7f\x80\\\t\n")
    log.event("arms", "connected again")
    sent, received, event = columns(tmp_path / "wire.log")
    assert re.fullmatch(WALL_TIME, sent[0])
    assert sent[1:] == ["12.500000", "arms", ">", r"1TP?\r", "31 54 50 3f 0d"]
    assert received[3:] == ["<", r"\x00\x7f\x80\\\t\n", "00 7f 80 5c 09 0a"]
    assert event[3:] == ["!", "connected again", ""]


def test_every_byte_can_be_read_back(log_of, tmp_path):
    every = bytes(range(256))
    log_of().received("stage", every)
    ((*_, text, in_hex),) = columns(tmp_path / "wire.log")
    assert bytes.fromhex(in_hex) == every
    assert text.encode("ascii").decode("unicode_escape").encode("latin-1") == every


def test_link_logs_all_that_goes_and_comes_under_the_name_of_the_device(make_peer, log_of, tmp_path):
    link = Link(make_peer({b"a": b"1\n2\n"}).port, device="bus", wire_log=log_of())
    link.for_device("polarizer").write(b"a\r")
    assert link.for_device("polarizer").read_until(b"\n") == b"1"
    link.discard_input()
    link.close()
    lines = columns(tmp_path / "wire.log")
    assert "".join(line[4] for line in lines if line[3] == ">") == r"a\r"
    assert "".join(line[4] for line in lines if line[3] == "<") == r"1\n2\n"
    assert lines[0][2] == "polarizer"


def test_repeats_and_reconnections_are_logged(make_peer, log_of, tmp_path, clock):
    link = Link(make_peer({}).port, device="arms", wire_log=log_of(), clock=clock, reply_timeout_s=0.01)
    with pytest.raises(TimeoutError, match="no complete answer"):
        link.until_answered(lambda: link.read_until(b"\n"))
    link.reconnect()
    link.close()
    events = [line[4] for line in columns(tmp_path / "wire.log") if line[3] == "!"]
    assert [event.split(":")[0] for event in events] == [
        "attempt 1 failed and is repeated",
        "attempt 2 failed and is repeated",
        "connected again",
    ]


def test_log_never_outgrows_its_files(log_of, tmp_path):
    log = log_of(file_bytes=1000, files=3)
    for number in range(200):
        log.sent("arms", b"%03d" % number)
    files = [tmp_path / "wire.log", tmp_path / "wire.log.1", tmp_path / "wire.log.2"]
    assert sorted(tmp_path.iterdir()) == files
    assert all(file.stat().st_size <= 1000 for file in files)
    kept = [line[4] for file in reversed(files) for line in columns(file)]
    assert kept == [f"{number:03d}" for number in range(200 - len(kept), 200)]
    assert len(kept) > 20


def test_earlier_log_is_continued(log_of, tmp_path):
    for text in (b"first", b"second"):
        log = log_of()
        log.sent("arms", text)
        log.close()
    assert [line[4] for line in columns(tmp_path / "wire.log")] == ["first", "second"]


@pytest.mark.parametrize("written", ["nothing", "a part of the line"])
def test_full_disk_ends_the_log_with_one_warning_and_not_the_scan(
    make_peer, log_of, tmp_path, monkeypatch, caplog, written
):
    log = log_of()
    log.event("arms", "before")

    class FullDisk:
        closed = False

        def tell(self):
            return 0

        def write(self, line):
            if written == "nothing":
                raise OSError(errno.ENOSPC, "No space left on device")
            return len(line) // 2

        def close(self):
            self.closed = True

    log._file.close()
    monkeypatch.setattr(log, "_file", FullDisk())
    peer = make_peer({b"a": b"1\n"})
    link = Link(peer.port, device="arms", wire_log=log)
    for _ in range(3):
        link.write(b"a\r")
        assert link.read_until(b"\n") == b"1"
    link.close()
    assert len(caplog.records) == 1
    assert re.search(r"wire\.log ends here.* The scan goes on.* Make room on the disk", caplog.records[0].message)


def test_closed_log_notes_nothing(log_of, tmp_path):
    log = log_of()
    log.close()
    log.close()
    log.sent("arms", b"a")
    assert columns(tmp_path / "wire.log") == []
