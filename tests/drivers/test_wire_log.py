from __future__ import annotations

import errno
import re
from concurrent.futures import ThreadPoolExecutor

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
    log.event("arms", "port P is open")
    sent, received, event = columns(tmp_path / "wire.log")
    assert re.fullmatch(WALL_TIME, sent[0])
    assert sent[1:] == ["12.500000", "arms", ">", r"1TP?\r", "31 54 50 3f 0d"]
    assert received[3:] == ["<", r"\x00\x7f\x80\\\t\n", "00 7f 80 5c 09 0a"]
    assert event[3:] == ["!", "port P is open", ""]


def test_a_reason_of_several_lines_stays_in_one(log_of, tmp_path):
    log_of().event("arms", "it is gone\n\t(at 20\N{DEGREE SIGN}C)")
    assert columns(tmp_path / "wire.log")[0][4:] == [r"it is gone\n\t(at 20\xb0C)", ""]


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
    assert [line[2] for line in lines if line[3] == ">"] == ["polarizer"]


def events(path):
    return [re.sub(r"socket://\S+", "P", line[4]) for line in columns(path) if line[3] == "!"]


def test_repeats_are_logged_with_what_failed(make_peer, log_of, tmp_path):
    link = Link(make_peer({}).port, device="arms", wire_log=log_of(), reply_timeout_s=0.01)
    with pytest.raises(TimeoutError, match="no complete answer"):
        link.until_answered(lambda: link.read_until(b"\n"))
    link.close()
    failed = "no complete answer to b'' on port P within 0.01 s (received so far: b'')"
    repeated = [f"attempt {number} failed and is repeated: {failed}" for number in (1, 2)]
    assert events(tmp_path / "wire.log") == ["port P is open", failed, repeated[0], failed, repeated[1], failed]


def test_a_link_that_is_opened_lost_and_opened_again_is_logged_with_the_reasons(make_peer, log_of, tmp_path, caplog):
    peer = make_peer({})
    link = Link(peer.port, device="arms", wire_log=log_of())
    peer.vanish()
    with pytest.raises(ConnectionError, match="is gone"):
        link.read_until(b"\n")
    link.reconnect()
    peer.close()
    with pytest.raises(ConnectionError, match="is gone"):
        link.read_until(b"\n")
    with pytest.raises(ConnectionError, match="cannot be opened"):
        link.reconnect()
    told = events(tmp_path / "wire.log")
    hung_up, reset = (f"the link on port P is gone ({why}" for why in ("the other end hung up)", "["))
    assert told[:3:2] == ["port P is open"] * 2
    assert all(gone.startswith((hung_up, reset)) for gone in told[1:4:2])  # the system tells of either
    assert told[4].startswith("port P cannot be opened (")
    assert caplog.text == ""  # that it is back is for those to say who find all its devices there


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


def test_devices_in_several_threads_share_a_log(log_of, tmp_path):
    """Also while a full file is put aside, whichever of them finds it full."""
    log = log_of(file_bytes=2000, files=1000)
    with ThreadPoolExecutor(4) as threads:
        list(threads.map(lambda device: [log.sent(device, b"%03d" % number) for number in range(300)], "abcd"))
    kept = [line for file in tmp_path.iterdir() for line in columns(file)]
    assert {len(line) for line in kept} == {6}
    assert sorted((line[2], line[4]) for line in kept) == [(d, f"{n:03d}") for d in "abcd" for n in range(300)]


def test_two_programs_that_append_to_one_log_overwrite_nothing(log_of, tmp_path):
    one = log_of(file_bytes=200)
    for number in range(4):
        one.sent("arms", b"%03d" % number)
    other = log_of()
    other.sent("stage", b"x" * 10)
    one.sent("arms", b"004")
    kept = [line[4] for file in tmp_path.iterdir() for line in columns(file)]
    assert sorted(kept) == ["000", "001", "002", "003", "004", "x" * 10]


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
