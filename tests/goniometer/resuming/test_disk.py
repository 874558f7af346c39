"""What a disk may do to a run: be full, be read-only, cut files off. And what a clock and a second process may do."""

import os
import shutil
import sqlite3
import subprocess
import sys
from contextlib import closing
from datetime import UTC, datetime, timedelta

import pytest

import goniometer
from acquisition.journal import FILE_NAME, Journal
from goniometer.errors import JournalError
from goniometer.resume_run import resume
from goniometer.run_folder import measured
from goniometer.run_lock import sole_writer

LIMITED = """
import resource, sys
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[1]), resource.RLIM_INFINITY))
import goniometer.cli
sys.argv[1:] = sys.argv[2:]
goniometer.cli.main()
"""
"""The system then refuses to let any file grow beyond the limit, as a full disk would."""


@pytest.mark.skipif(sys.platform == "win32", reason="the limit exists on POSIX only")
@pytest.mark.parametrize("limit", [30_000, 100_000, 220_000])
def test_a_disk_that_is_full(limit, recipe, tmp_path, root, whole, rows, assert_same_results):
    command = [sys.executable, "-c", LIMITED, limit, "run", recipe(), "--out", tmp_path, "--speed", "max", "--quiet"]
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True, cwd=root, timeout=60, check=False)
    assert done.returncode == 1, done.stderr
    (run,) = tmp_path.iterdir()
    if limit == 30_000:
        assert "cannot be begun" in done.stderr
        assert "No device was moved. Is the disk full?" in done.stderr
        return
    stored = rows(run)
    assert "could not be stored" in done.stderr
    assert f"goniometer resume {run}" in done.stderr
    assert 0 < len(stored) < len(rows(whole))
    assert stored == rows(whole)[: len(stored)]
    resume(run, speed="max", live_fit=False)  # there is room again
    assert rows(run) == rows(whole)
    assert_same_results(run, whole)


def test_a_file_stands_where_the_runs_should_go(recipe, tmp_path):
    (tmp_path / "runs").write_text("")
    with pytest.raises(JournalError, match=r"cannot be made: .*No device was moved\. Choose another with --out"):
        goniometer.run(recipe(), speed="max", out=tmp_path / "runs")


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may write everywhere")
def test_a_run_that_may_not_be_written(whole, cut, rows):
    folder = cut(whole, 20)
    folder.chmod(0o500)
    try:
        with pytest.raises(JournalError, match=r"cannot be written: .*No device was moved"):
            resume(folder, speed="max")
    finally:
        folder.chmod(0o700)
    assert len(rows(folder)) == 20


def test_a_run_whose_lock_cannot_be_written(whole, cut, rows):
    folder = cut(whole, 20)
    (folder / ".lock").mkdir()
    with pytest.raises(JournalError, match=r"cannot be written: .*No device was moved"):
        resume(folder, speed="max")
    assert len(rows(folder)) == 20


def test_two_processes(whole, cut, rows):
    folder = cut(whole, 20)
    with sole_writer(folder), pytest.raises(JournalError, match="Another process is writing the run"):
        resume(folder, speed="max")
    assert len(rows(folder)) == 20


def pages_of(path):
    with closing(sqlite3.connect(path)) as connection:
        return connection.execute("PRAGMA page_size").fetchone()[0]


BYTES = pytest.mark.parametrize("every", [3, pytest.param(1, marks=pytest.mark.long)])
"""Rows have many lengths, so that cuts three bytes apart fall everywhere within them."""


@BYTES
def test_a_journal_cut_off_at_any_byte_of_its_last_page(every, whole, tmp_path):
    """What SQLite makes of a page that is there in part would be readings that nobody took."""
    with Journal.open(whole / FILE_NAME) as journal:
        expected = journal.readings()
    data, path = (whole / FILE_NAME).read_bytes(), tmp_path / FILE_NAME
    for size in range(len(data) - pages_of(whole / FILE_NAME), len(data), every):
        path.write_bytes(data[:size])
        with Journal.open(path) as journal:
            assert journal.damage
            readings = journal.readings()
            assert readings == expected[: len(readings)]
            assert len(readings) >= 40
        if size % 512 in range(7, 7 + every):
            with pytest.raises(JournalError, match=r"is damaged, and nothing was written to it: it ends in the middle"):
                resume(tmp_path, speed="max")
            run = measured(tmp_path)
            assert "is damaged" in run.doubts[0]
            assert f"{len(readings)} readings can be read" in run.doubts[0]
        assert path.read_bytes() == data[:size]


@BYTES
def test_a_log_cut_off_at_any_byte_of_its_last_page(every, whole, cut, tmp_path, rows):
    """As after a kill: most readings are in the log only."""
    folder = cut(whole, 10)
    with Journal.go_on(folder / FILE_NAME) as journal, Journal.open(whole / FILE_NAME) as source:
        for row in source.taken()[10:20]:
            journal.append(row.reading)
        shutil.copytree(folder, tmp_path / "killed")
    names = FILE_NAME, f"{FILE_NAME}-wal"
    page, log = ((tmp_path / "killed" / name).read_bytes() for name in names)
    frame = 24 + pages_of(whole / FILE_NAME)
    for size in range(len(log) - frame, len(log), every):
        left = tmp_path / str(size)
        left.mkdir()
        for name, data in zip(names, (page, log[:size]), strict=True):
            (left / name).write_bytes(data)
        with Journal.open(left / FILE_NAME) as journal:
            assert not journal.damage
            assert len(journal.readings()) == 19
        if abs(size - (len(log) - frame // 2)) * 2 <= every:
            resume(left, speed="max", live_fit=False)
            assert rows(left) == rows(whole)
        shutil.rmtree(left)


def test_a_page_in_the_middle_that_is_damaged(whole, cut):
    folder = cut(whole, 58)
    path = folder / FILE_NAME
    data, size = bytearray(path.read_bytes()), pages_of(path)
    data[-size : -size + 64] = bytes(64)
    path.write_bytes(data)
    with Journal.open(path) as journal:
        assert journal.damage
        readings = journal.readings()
    with Journal.open(whole / FILE_NAME) as journal:
        assert readings == journal.readings()[: len(readings)]


@pytest.mark.parametrize(("ahead_s", "is_noted"), [(3600, True), (-3600, False)])
def test_a_clock_that_was_set(ahead_s, is_noted, whole, cut, rows):
    """Nothing hangs by the time of day but how long a real bench is taken to have been left alone."""
    folder, events = cut(whole, 20), []
    with closing(sqlite3.connect(folder / FILE_NAME)) as connection:
        stored_at = (datetime.now(UTC) + timedelta(seconds=ahead_s)).strftime("%Y-%m-%dT%H:%M:%S.000Z")
        connection.execute("UPDATE readings SET stored_at = ?", (stored_at,))
        connection.commit()
    resume(folder, speed="max", live_fit=False, subscribers=[events.append])
    assert any("the computer's clock was set back" in note for note in events[0].notes) == is_noted
    assert rows(folder) == rows(whole)
