"""Runs of every kind in one folder: listed, searched, opened, and not disturbed."""

import json
import os
import re
import shutil
import signal
import sqlite3
import subprocess
import sys
import time
from pathlib import Path

import click
import pytest
from click.testing import CliRunner

from acquisition.journal import FILE_NAME, Journal
from acquisition.readings import Reading
from goniometer.catalogue.listing import catalogue, picked
from goniometer.cli_runs import runs as command
from goniometer.errors import ConfigurationError
from goniometer.run_lock import sole_writer

ABOUT = {
    "recipe": "# what for\nrecipe: 'iron: at 60'   # a name\nrig: r.yaml\n",
    "rig": "rig: bench\n",
    "scene": "scene: ground iron\nseed: 1\n",
    "started": "2026-03-01T12:00:00+01:00",
    "user": "Mela",
}
READING = Reading(0, "signal", 0, 1.0, 60.0, 0.0, 0.0, 2, 0.0, 0.03, 1e-9)
FIT = {"chi_square": 230.0, "degrees_of_freedom": 200}
SEPARATE_WRITER = """
import sys, time
sys.path.insert(0, sys.argv[3])
from pathlib import Path
from test_catalogue import ABOUT, READING
from acquisition.journal import FILE_NAME, Journal
from goniometer.run_lock import sole_writer
folder = Path(sys.argv[1])
folder.mkdir(parents=True)
with sole_writer(folder), Journal.create(folder / FILE_NAME, ABOUT) as journal:
    for _ in range(int(sys.argv[2])):
        journal.append(READING)
    print("written", flush=True)
    for line in sys.stdin:
        journal.append(READING)
        print("written", flush=True)
"""


@pytest.fixture
def runs(tmp_path):
    return tmp_path / "runs"


def store(runs, name, *, readings=5, fit=None, **about):
    folder = runs / name
    folder.mkdir(parents=True)
    with Journal.create(folder / FILE_NAME, ABOUT | about) as journal:
        for _ in range(readings):
            journal.append(READING)
    if fit:
        (folder / "fit.json").write_text(json.dumps(fit))
    return folder


@pytest.fixture
def written_elsewhere(runs):
    """A run of five readings that another process is writing; it writes one more for each line it is given."""
    process = subprocess.Popen(
        [sys.executable, "-c", SEPARATE_WRITER, str(runs / "live"), "5", str(Path(__file__).parent)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    with process:
        assert process.stdout.readline() == "written\n"
        yield process
        process.kill()


def by_name(runs):
    return {entry.folder.name: entry for entry in catalogue(runs)}


def files(folder):
    return {path.name: (path.stat().st_size, path.stat().st_mtime_ns) for path in folder.iterdir()}


def test_an_entry_says_when_what_and_how_good(runs):
    store(runs, "a", fit=FIT, ended="every step was taken")
    (entry,) = catalogue(runs)
    assert (entry.recipe, entry.sample, entry.readings) == ("iron: at 60", "ground iron", 5)
    assert entry.state == "finished"
    assert entry.begun.isoformat() == entry.begun.astimezone().isoformat()
    assert entry.begun.timestamp() == 1772362800.0  # 2026-03-01 11:00 UTC
    assert entry.chi_square_reduced == pytest.approx(1.15)


def test_a_run_that_did_not_end_as_asked_was_cut_short_though_it_was_fitted(runs):
    store(runs, "a", fit=FIT)
    assert by_name(runs)["a"].state == "cut short"


def test_runs_of_before_ends_were_written_down_are_finished_when_they_have_results(runs):
    about = {key: text for key, text in ABOUT.items() if key not in ("started", "user")}
    for name, fit in (("with", FIT), ("without", None)):
        folder = runs / name
        folder.mkdir(parents=True)
        with Journal.create(folder / FILE_NAME, about) as journal:
            journal.append(READING)
        if fit:
            (folder / "fit.json").write_text(json.dumps(fit))
    found = by_name(runs)
    assert (found["with"].state, found["without"].state) == ("finished", "cut short")
    assert abs(found["with"].begun.timestamp() - time.time()) < 60.0  # when its first reading was stored


def test_a_running_scan_is_seen_and_goes_on_undisturbed(runs, written_elsewhere):
    for taken in range(5, 9):
        (entry,) = catalogue(runs)
        assert (entry.state, entry.readings) == ("running", taken)
        written_elsewhere.stdin.write("one more\n")
        written_elsewhere.stdin.flush()
        assert written_elsewhere.stdout.readline() == "written\n"


def test_a_reader_that_hangs_holds_no_scan_up(runs, written_elsewhere):
    with sqlite3.connect(f"{(runs / 'live' / FILE_NAME).as_uri()}?mode=ro", uri=True) as reader:
        reader.execute("BEGIN")
        reader.execute("SELECT count(*) FROM readings").fetchone()
        written_elsewhere.stdin.write("one more\n")
        written_elsewhere.stdin.flush()
        assert written_elsewhere.stdout.readline() == "written\n"
        assert by_name(runs)["live"].readings == 6


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no kill -9")
def test_a_killed_scan_was_cut_short_and_keeps_every_reading(runs, written_elsewhere):
    os.kill(written_elsewhere.pid, signal.SIGKILL)
    written_elsewhere.wait()
    assert (runs / "live" / f"{FILE_NAME}-wal").stat().st_size > 0
    entry = by_name(runs)["live"]
    assert (entry.state, entry.readings, entry.recipe) == ("cut short", 5, "iron: at 60")
    with Journal.open(runs / "live" / FILE_NAME) as journal:
        assert len(journal.readings()) == 5


def test_looking_leaves_no_trace(runs):
    folder = store(runs, "a", fit=FIT)
    before = files(folder)
    catalogue(runs)
    assert files(folder) == before


def test_what_cannot_be_read_hides_nothing_else(runs):
    store(runs, "good", fit=FIT, ended="")
    for name, content in (("empty", b""), ("rubbish", b"no database at all, but long enough for one" * 100)):
        (runs / name).mkdir()
        (runs / name / FILE_NAME).write_bytes(content)
    torn = store(runs, "torn", readings=200)
    whole = (torn / FILE_NAME).read_bytes()
    (torn / FILE_NAME).write_bytes(whole[:4096] + bytes(len(whole) - 4096))
    (store(runs, "bad fit") / "fit.json").write_text("{")
    odd = store(runs, "odd recipe", recipe="recipe: [")
    (runs / "folder in place of a journal" / FILE_NAME).mkdir(parents=True)
    (runs / "notes.txt").write_text("mine")
    (runs / "no run").mkdir()
    found = by_name(runs)
    assert found.keys() == {
        *("good", "empty", "rubbish", "torn", "bad fit", odd.name, "folder in place of a journal"),
    }
    assert (found["good"].state, found["empty"].state, found["empty"].readings) == ("finished", "cut short", 0)
    for name in found.keys() - {"good", "empty"}:
        assert found[name].state == "unreadable", name
        assert found[name].fault, name
    assert "not a database" in found["rubbish"].fault


@pytest.mark.parametrize(
    ("words", "names"),
    [
        ([], {"a-iron", "b-glass"}),
        (["GLASS"], {"b-glass"}),
        (["mela", "iron"], {"a-iron"}),
        (["otto"], {"b-glass"}),
        (["otto", "mela"], set()),
        (["ground iron"], {"a-iron"}),
    ],
)
def test_search_looks_into_names_texts_and_provenance(runs, words, names):
    store(runs, "a-iron")
    store(runs, "b-glass", user="Otto", recipe="recipe: x\n", scene="scene: clear\n")
    assert {entry.folder.name for entry in catalogue(runs, words)} == names


def test_the_newest_comes_first_whatever_zone_it_was_written_in(runs):
    store(runs, "second", started="2026-03-01T12:00:00+00:00")
    store(runs, "first", started="2026-03-01T12:30:00+01:00")
    store(runs, "third", started="2026-03-01T06:30:00-08:00")
    assert [entry.folder.name for entry in catalogue(runs)] == ["third", "second", "first"]


def test_a_run_is_picked_by_number_or_by_part_of_its_name(runs):
    store(runs, "2026-a-iron", started="2026-03-02T12:00:00+00:00")
    store(runs, "2026-b-iron")
    entries = catalogue(runs)
    assert picked(entries, "1").folder.name == "2026-a-iron"
    assert picked(entries, "B-Iron").folder.name == "2026-b-iron"
    with pytest.raises(ConfigurationError, match="'iron' stands for 2 runs: 2026-a-iron, 2026-b-iron"):
        picked(entries, "iron")
    with pytest.raises(ConfigurationError, match="No run is called '3'"):
        picked(entries, "3")


def test_the_list_has_a_line_a_run_and_the_faults_below(runs):
    store(runs, "a", fit=FIT, ended="")
    (runs / "b").mkdir()
    (runs / "b" / FILE_NAME).write_text("no journal, but some text")
    done = CliRunner().invoke(command, ["--in", str(runs)], catch_exceptions=False)
    lines = done.stdout.splitlines()
    assert done.exit_code == 0
    assert lines[0].split() == ["when", "state", "readings", "chi²/dof", "recipe", "sample", "folder"]
    assert re.search(r"1  .* unreadable .* b$", lines[1])
    assert re.search(r"2  2026-03-01 \d\d:\d\d  finished +5 +1\.15  iron: at 60  ground iron  a$", lines[2])
    assert lines[4].startswith(f"{runs / 'b'}: file is not a database")


def test_nothing_found_is_said(runs):
    runs.mkdir()
    done = CliRunner().invoke(command, ["iron", "--in", str(runs)], catch_exceptions=False)
    assert done.stderr == f"No run in {runs} has iron.\n"
    with pytest.raises(ConfigurationError, match="There is no folder"):
        CliRunner().invoke(command, ["--in", str(runs / "none")], catch_exceptions=False)


@pytest.mark.parametrize("has_report", [True, False])
def test_opening_shows_the_report_or_else_the_folder(runs, monkeypatch, has_report):
    folder = store(runs, "a")
    report = folder / "report.png"
    if has_report:
        report.write_bytes(b"")
    shown = []
    monkeypatch.setattr(click, "launch", lambda path: shown.append(path) or 1)
    done = CliRunner().invoke(command, ["--in", str(runs), "--open", "1"], catch_exceptions=False)
    assert shown == [str(report if has_report else folder)]
    assert done.stdout == f"{shown[0]}\n"
    assert "open it yourself" in done.stderr


def test_a_thousand_runs_are_listed_at_once(runs):
    first = store(runs, "0", readings=50, fit=FIT)
    for number in range(1, 1000):
        shutil.copytree(first, runs / str(number))
    begun_s = time.perf_counter()
    assert len(catalogue(runs, ["iron"])) == 1000
    assert time.perf_counter() - begun_s < 2.0


def test_a_run_in_this_process_keeps_its_lock(runs):
    folder = store(runs, "a")
    with sole_writer(folder):
        for _ in range(2):  # the first look must not unlock it
            assert by_name(runs)["a"].state == "running"
    assert by_name(runs)["a"].state == "cut short"
