"""What the journal acknowledged is there, whatever happened afterwards."""

import itertools
import shutil
import sqlite3
from contextlib import closing
from dataclasses import astuple, replace

import pytest

from acquisition.imaging.frame_files import StoredFrame
from acquisition.journal import Journal
from acquisition.readings import Reading
from goniometer.errors import JournalError

ABOUT = {"recipe": "recipe: x", "seed": "7"}


def reading(number):
    kind = "dark" if number % 5 == 4 else "signal"
    return Reading(
        number // 5,
        kind,
        0,
        0.1 * number,
        60.0,
        number / 3,
        0.0,
        number % 5 + 2,
        None if kind == "dark" else 45.0,
        0.03,
        1 / 7e9,
    )


def test_readings_come_back_as_they_were(tmp_path):
    taken = [reading(number) for number in range(12)]
    with Journal.create(tmp_path / "j", ABOUT) as journal:
        for one in taken:
            journal.append(one)
    with Journal.open(tmp_path / "j") as journal:
        assert journal.readings() == tuple(taken)
        assert journal.about() == {**ABOUT, "format": "6"}


def test_the_retarder_comes_back_too(tmp_path):
    taken = replace(reading(0), retarder_deg=-15.1, retardance_deg=88.5)
    with Journal.create(tmp_path / "j", ABOUT) as journal:
        journal.append(taken)
    with Journal.open(tmp_path / "j") as journal:
        assert journal.readings() == (taken,)


def test_the_generator_comes_back_too(tmp_path):
    of_retarder = {"generator_retarder_deg": -15.1, "generator_retardance_deg": 88.5}
    taken = replace(reading(0), generator_slot=3, generator_deg=0.5, **of_retarder)
    with Journal.create(tmp_path / "j", ABOUT) as journal:
        journal.append(taken)
    with Journal.open(tmp_path / "j") as journal:
        assert journal.readings() == (taken,)
        assert type(journal.readings()[0].generator_slot) is int


def test_a_journal_from_before_generators_is_read_with_its_interruptions(tmp_path):
    """As the third format was written: with interruptions, and without the columns of later ones."""
    with Journal.create(tmp_path / "j", ABOUT) as journal:
        journal.append(reading(3))
        journal.begin_again("2026-01-31T12:00:00+00:00", "goniometer 1 on a computer")
    with closing(sqlite3.connect(tmp_path / "j", isolation_level=None)) as connection:
        generator = ("generator_slot", "generator_deg", "generator_retarder_deg", "generator_retardance_deg")
        for name in ("exit_azimuth_deg", *generator, "wavelength_nm"):
            connection.execute(f"ALTER TABLE readings DROP COLUMN {name}")
        connection.execute("UPDATE about SET value = '3' WHERE key = 'format'")
    with Journal.open(tmp_path / "j") as journal:
        assert journal.readings() == (reading(3),)
        (interruption,) = journal.interruptions()
        assert interruption.resumed_with == "goniometer 1 on a computer"
    with pytest.raises(JournalError, match=r"format 3\), whose journals are read and not written on"):
        Journal.go_on(tmp_path / "j")


def test_a_journal_from_before_generators_is_read_as_without_one(tmp_path):
    """As the second format was written: the columns up to the retardance."""
    connection = sqlite3.connect(tmp_path / "j", isolation_level=None)
    connection.execute("CREATE TABLE about (key TEXT PRIMARY KEY, value TEXT NOT NULL) STRICT")
    connection.execute(
        "CREATE TABLE readings (id INTEGER PRIMARY KEY, point INTEGER, kind TEXT, repeat INTEGER, time_s REAL, "
        "incidence_deg REAL, exit_deg REAL, azimuth_deg REAL, slot INTEGER, analyzer_deg REAL, exposure_s REAL, "
        "power_w REAL, retarder_deg REAL, retardance_deg REAL, stored_at TEXT NOT NULL DEFAULT 'then') STRICT"
    )
    connection.execute("INSERT INTO about VALUES ('format', '2')")
    old = replace(reading(3), retarder_deg=-15.1, retardance_deg=88.5)
    connection.execute(
        "INSERT INTO readings (point, kind, repeat, time_s, incidence_deg, exit_deg, azimuth_deg, slot, analyzer_deg, "
        "exposure_s, power_w, retarder_deg, retardance_deg) VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
        astuple(old)[:13],
    )
    connection.close()
    with Journal.open(tmp_path / "j") as journal:
        assert journal.readings() == (old,)


def test_a_journal_from_before_retarders_is_read_as_without_one(tmp_path):
    """As the first format was written: the same table without the last two columns."""
    connection = sqlite3.connect(tmp_path / "j", isolation_level=None)
    connection.execute("CREATE TABLE about (key TEXT PRIMARY KEY, value TEXT NOT NULL) STRICT")
    connection.execute(
        "CREATE TABLE readings (id INTEGER PRIMARY KEY, point INTEGER, kind TEXT, repeat INTEGER, time_s REAL, "
        "incidence_deg REAL, exit_deg REAL, azimuth_deg REAL, slot INTEGER, analyzer_deg REAL, exposure_s REAL, "
        "power_w REAL, stored_at TEXT NOT NULL DEFAULT 'then') STRICT"
    )
    connection.execute("INSERT INTO about VALUES ('format', '1')")
    row = astuple(reading(3))[:11]
    connection.execute(
        "INSERT INTO readings (point, kind, repeat, time_s, incidence_deg, exit_deg, azimuth_deg, slot, analyzer_deg, "
        f"exposure_s, power_w) VALUES ({', '.join('?' * 11)})",
        row,
    )
    connection.close()
    with Journal.open(tmp_path / "j") as journal:
        assert journal.readings() == (reading(3),)


def test_a_journal_from_before_wavelengths_is_read_as_without_them(tmp_path):
    """As the fourth format was written: the same table without a column."""
    taken = replace(reading(3), exit_azimuth_deg=12.5, generator_slot=2, generator_deg=45.0)
    with Journal.create(tmp_path / "j", ABOUT) as journal:
        journal.append(taken)
        journal._connection.execute("ALTER TABLE readings DROP COLUMN wavelength_nm")
        journal._connection.execute("UPDATE about SET value = '4' WHERE key = 'format'")
    with Journal.open(tmp_path / "j") as journal:
        assert journal.readings() == (taken,)


def test_exit_azimuth_and_wavelength_come_back(tmp_path):
    taken = replace(reading(3), exit_azimuth_deg=12.5, wavelength_nm=580.0)
    with Journal.create(tmp_path / "new", ABOUT) as journal:
        journal.append(taken)
    with Journal.open(tmp_path / "new") as journal:
        assert journal.readings() == (taken,)


def test_a_journal_of_a_later_version_is_refused_with_its_format(tmp_path):
    with Journal.create(tmp_path / "j", ABOUT) as journal:
        journal._connection.execute("UPDATE about SET value = '7' WHERE key = 'format'")
    with pytest.raises(
        JournalError, match=r"has journal format 7; this version of goniometer reads 1, 2, 3, 4, 5 and 6\."
    ):
        Journal.open(tmp_path / "j")


def test_every_acknowledged_reading_survives_a_copy_made_at_that_moment(tmp_path):
    """A copy of the files on disk is what a power cut leaves: nothing of the process, everything that was synced."""
    with Journal.create(tmp_path / "j", ABOUT) as journal:
        for number in range(8):
            journal.append(reading(number))
            moment = tmp_path / f"after {number}"
            moment.mkdir()
            for name in tmp_path.glob("j*"):
                shutil.copy(name, moment)
            with Journal.open(moment / "j") as left:
                assert left.readings() == tuple(reading(i) for i in range(number + 1))


def test_a_log_cut_at_any_byte_keeps_all_but_the_last_reading(tmp_path):
    with Journal.create(tmp_path / "j", ABOUT) as journal:
        journal.append(reading(0))
        kept = (tmp_path / "j-wal").stat().st_size
        journal.append(reading(1))
        whole = (tmp_path / "j-wal").read_bytes()
        for size in range(kept, len(whole), 97):
            (tmp_path / "cut").mkdir(exist_ok=True)
            shutil.copy(tmp_path / "j", tmp_path / "cut" / "j")
            (tmp_path / "cut" / "j-wal").write_bytes(whole[:size])
            with Journal.open(tmp_path / "cut" / "j") as left:
                assert left.readings() == (reading(0),)
            shutil.rmtree(tmp_path / "cut")


def test_a_run_never_writes_into_another_runs_journal(tmp_path):
    Journal.create(tmp_path / "j", ABOUT).close()
    with pytest.raises(JournalError, match="exists already"):
        Journal.create(tmp_path / "j", ABOUT)


@pytest.mark.parametrize(
    ("content", "message"),
    [(None, "does not exist"), (b"not a database at all" * 50, "cannot be read"), (b"", "is empty")],
)
def test_what_is_no_journal_is_named(tmp_path, content, message):
    if content is not None:
        (tmp_path / "j").write_bytes(content)
    with pytest.raises(JournalError, match=message):
        Journal.open(tmp_path / "j")


def test_a_full_disk_is_told_and_earlier_readings_stay(tmp_path):
    with Journal.create(tmp_path / "j", ABOUT) as journal:
        journal.append(reading(0))
        pages = journal._connection.execute("PRAGMA page_count").fetchone()[0]
        journal._connection.execute(f"PRAGMA max_page_count={pages}")
        stored = itertools.takewhile(lambda number: is_stored(journal, reading(number)), range(1, 200))
        full = max(stored, default=0) + 1
        with pytest.raises(JournalError, match=r"could not be stored.*earlier readings are safe"):
            journal.append(reading(full))
    with Journal.open(tmp_path / "j") as journal:
        assert journal.readings() == tuple(reading(number) for number in range(full))


def is_stored(journal, one):
    try:
        journal.append(one)
    except JournalError:
        return False
    return True


def test_a_run_can_be_read_while_it_is_written(tmp_path):
    with Journal.create(tmp_path / "j", ABOUT) as journal:
        journal.append(reading(0))
        with Journal.open(tmp_path / "j") as other:
            assert len(other.readings()) == 1
        journal.append(reading(1))


def test_full_durability_is_on(tmp_path, monkeypatch, safe):
    monkeypatch.setattr("acquisition.journal._SAFE", safe)
    with Journal.create(tmp_path / "j", ABOUT) as journal:
        assert journal._connection.execute("PRAGMA synchronous").fetchone() == (2,)
        assert journal._connection.execute("PRAGMA journal_mode").fetchone() == ("wal",)
    assert sqlite3.threadsafety >= 1


def test_a_journal_is_begun_whole_or_not_at_all(tmp_path, monkeypatch):
    """A kill in the middle of its beginning must not leave a run that cannot be told from one of another version."""
    texts = {"recipe": "r" * 100_000}

    class Cut(Exception):
        pass

    class Connection(sqlite3.Connection):
        def executemany(self, *arguments):
            super().executemany(*arguments)
            raise Cut

    connect = sqlite3.connect
    monkeypatch.setattr(sqlite3, "connect", lambda *a, **k: connect(*a, **k, factory=Connection))
    with pytest.raises(Cut):
        Journal.create(tmp_path / "j", texts)
    monkeypatch.undo()
    with pytest.raises(JournalError, match="cut off before its first step"):
        Journal.open(tmp_path / "j")


FRAMES = tuple(StoredFrame(f"frames/{number:06d}.png", 12, 0.1, 6.0, 3.5 + number, number, 4242) for number in range(3))


def test_the_pictures_of_each_reading_come_back_with_it(tmp_path):
    with Journal.create(tmp_path / "j", ABOUT) as journal:
        journal.append(reading(0), FRAMES[:2])
        journal.append(reading(1))
        journal.append(reading(2), [replace(FRAMES[2], number=None)])
    with Journal.open(tmp_path / "j") as journal:
        assert journal.readings() == (reading(0), reading(1), reading(2))
        assert journal.frames() == (FRAMES[:2], (), (replace(FRAMES[2], number=None),))


def test_a_reading_and_its_pictures_are_stored_together_or_not_at_all(tmp_path):
    with Journal.create(tmp_path / "j", ABOUT) as journal:
        journal.append(reading(0), FRAMES[:1])
        with pytest.raises(JournalError, match="could not be stored"):
            journal.append(reading(1), [FRAMES[1], replace(FRAMES[2], bits="twelve")])
        journal.append(reading(2), FRAMES[2:])
        assert journal.readings() == (reading(0), reading(2))
        assert journal.frames() == (FRAMES[:1], FRAMES[2:])


def test_a_journal_from_before_cameras_has_no_pictures(tmp_path):
    """As the fifth format was written: without their table."""
    with Journal.create(tmp_path / "j", ABOUT) as journal:
        journal.append(reading(0))
        journal.append(reading(1))
    with closing(sqlite3.connect(tmp_path / "j", isolation_level=None)) as connection:
        connection.execute("DROP TABLE frames")
        connection.execute("UPDATE about SET value = '5' WHERE key = 'format'")
    with Journal.open(tmp_path / "j") as journal:
        assert journal.frames() == ((), ())
