"""Single keys at a terminal: what each does, and that the terminal is as it was however the scan ends."""

import json
import os
import signal
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

import pytest

from acquisition.control import ABORTED, ScanControl
from goniometer.errors import ScanInterrupted
from goniometer.keyboard import HELP, keys, plain_keys, press

ROOT = Path(__file__).resolve().parents[2]
posix_only = pytest.mark.skipif(sys.platform == "win32", reason="there are no pseudo-terminals there")
IN_A_TERMINAL = (
    "import os, sys; os.open(os.ttyname(0), os.O_RDWR); from goniometer.cli import main; sys.argv[0] = 'goniometer'; "
    "main()"
)


@pytest.mark.parametrize("key", ["p", "P", " "])
def test_one_key_pauses_and_goes_on(key):
    control = ScanControl()
    press(key, control)
    assert control.is_paused
    press(key, control)
    assert not control.is_paused


def test_keys_for_exposure_double_and_halve_what_was_asked_last():
    control = ScanControl()
    control.begin(0.03, float)
    press("+", control)
    press("+", control)
    assert control.take().exposure_s == pytest.approx(0.12)
    press("-", control)
    assert control.take().exposure_s == pytest.approx(0.06)


def test_q_ends_the_scan():
    control = ScanControl()
    press("q", control)
    with pytest.raises(ScanInterrupted, match="the key q") as ended:
        control.check()
    assert ended.value.exit_code == ABORTED


@pytest.mark.parametrize("key", ["x", "\r", "\t", "0"])
def test_other_keys_do_nothing(key):
    control = ScanControl()
    press(key, control)
    assert not control.is_waiting
    control.check()


@pytest.mark.parametrize(
    ("sent", "meant"),
    [(b"\x1bOS", ""), (b"\x1b[As", "s"), (b"p\x1b[15~+", "p+"), (b"\x1b", ""), (b"\xc3\xa4", "\ufffd" * 2)],
)
def test_arrow_and_function_keys_are_no_orders(sent, meant):
    """F4 ends in the letter of one."""
    assert plain_keys(sent) == meant


def test_without_a_terminal_there_are_no_keys(tmp_path):
    for stream in (None, (tmp_path / "file").open("w")):
        with keys(ScanControl(), stream) as known:
            assert known == ""
        if stream is not None:
            stream.close()
    assert HELP


@contextmanager
def at_a_terminal(out):
    """A scan with a terminal of its own as its standard input; its events, and the terminal."""
    import pty
    import termios

    ours, theirs = pty.openpty()
    before = termios.tcgetattr(theirs)
    recipe = ROOT / "recipes" / "iron_60deg.yaml"
    process = subprocess.Popen(
        [sys.executable, "-c", IN_A_TERMINAL, "run", str(recipe), "--json", "--speed", "20", "--out", str(out)],
        stdin=theirs,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=ROOT,
        start_new_session=True,
    )
    try:
        yield process, lambda key: os.write(ours, key), lambda: termios.tcgetattr(theirs) == before
    finally:
        process.kill()
        process.wait()
        process.stdout.close()
        process.stderr.close()
        os.close(ours)
        os.close(theirs)


def until(process, name):
    for line in process.stdout:
        event = json.loads(line)
        if event["event"] == name:
            return event
    raise AssertionError(f"no {name}: {process.stderr.read()}")


@posix_only
def test_a_scan_is_paused_skipped_changed_and_ended_by_keys(tmp_path):
    with at_a_terminal(tmp_path) as (process, press_key, is_as_before):
        until(process, "ReadingStored")
        assert not is_as_before()
        press_key(b"p")
        assert "a person" in until(process, "Paused")["why"]
        press_key(b"+")
        assert json.loads(process.stdout.readline())["event"] == "ExposureChanged"
        press_key(b"s")
        point = until(process, "Skipped")["point"]
        press_key(b" ")
        until(process, "WentOn")
        press_key(b"-")
        assert until(process, "ExposureChanged")["exposure_s"] == pytest.approx(0.03)
        press_key(b"q")
        assert until(process, "ScanEnded")["reason"] == "the key q"
        assert process.wait(timeout=20) == ABORTED
        assert is_as_before()
        assert "Ended by the key q. The bench has been stopped." in process.stderr.read()
    assert isinstance(point, int)


@posix_only
@pytest.mark.parametrize(("name", "code"), [("SIGINT", 130), ("SIGTERM", 143), ("SIGHUP", 129)])
def test_a_signal_leaves_the_terminal_as_it_was(tmp_path, name, code):
    with at_a_terminal(tmp_path) as (process, press_key, is_as_before):
        until(process, "ReadingStored")
        if name == "SIGINT":
            press_key(b"\x03")  # the terminal still makes a signal of Ctrl-C
        else:
            process.send_signal(getattr(signal, name))
        until(process, "ScanEnded")
        assert process.wait(timeout=20) == code
        assert is_as_before()


@posix_only
def test_a_paused_scan_is_ended_by_ctrl_c(tmp_path):
    with at_a_terminal(tmp_path) as (process, press_key, is_as_before):
        until(process, "ReadingStored")
        press_key(b"p")
        until(process, "Paused")
        press_key(b"\x03")
        assert process.wait(timeout=20) == 130
        assert is_as_before()
