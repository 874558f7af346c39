"""The journal of a run: one SQLite file, one transaction a reading, on disk before anybody is told.

Write-ahead logging with ``synchronous=FULL`` keeps every acknowledged reading through a kill or a power cut;
docs/decisions/journal.md says why.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import astuple, dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from acquisition.imaging.frame_files import StoredFrame
from acquisition.interruption import Interruption
from acquisition.journal_damage import damage, readable_part
from acquisition.journal_schema import (
    APPEND,
    APPEND_FRAME,
    COLUMNS,
    CREATE,
    FORMAT,
    FRAME_COLUMNS,
    INTERRUPTED,
    INTERRUPTIONS,
    KNOWN,
    MISSING,
    WITH_FRAMES,
    WITHOUT_PLAN,
)
from acquisition.readings import Reading
from goniometer.errors import JournalError

FILE_NAME = "journal.sqlite"
STOPPED = "stopped"
"""The key of `about` under which stands why a scan has ended before its time."""
LINK_LOST = "link lost"
"""How the keys of `about` begin under which stand the links that were lost, and taken up again."""
_SAFE = "PRAGMA synchronous=FULL"
_IDS = "SELECT id FROM readings ORDER BY id"
_FRAMES = f"SELECT reading, {', '.join(FRAME_COLUMNS)} FROM frames ORDER BY rowid"  # noqa: S608 (names are ours)


@dataclass(frozen=True)
class StoredReading:
    """A reading, and whether the recipe's plan has it."""

    reading: Reading
    is_planned: bool


class Journal:
    """The readings of one run, and what is needed to understand them.

    Use `create` for a new run, `open` for a stored one, and `go_on` to write a stored one on.

    Attributes
    ----------
    damage : str
        What is wrong with the file; empty for a whole one. Of a damaged one `readings` gives those before the damage.
    """

    def __init__(self, connection: sqlite3.Connection, path: Path, stored: str = FORMAT, damage: str = "") -> None:
        self._connection, self.path, self._stored, self.damage = connection, path, stored, damage
        names = ("NULL" if name in MISSING[stored] else name for name in COLUMNS)
        self._select = f"SELECT {', '.join(names)} FROM readings ORDER BY id"  # noqa: S608 (names are ours)

    @classmethod
    def create(cls, path: Path, about: Mapping[str, str]) -> Journal:
        """Begin a journal; `about` holds the recipe, rig and scene texts, versions and seed.

        Raises
        ------
        JournalError
            When the file exists already or cannot be written.
        """
        if path.exists():
            raise JournalError(f"{path} exists already; a run never writes into another run's journal.")
        try:
            connection = sqlite3.connect(path, isolation_level=None)
            connection.execute("PRAGMA journal_mode=WAL")
            connection.execute(_SAFE)
            connection.execute("BEGIN")
            for table in CREATE:
                connection.execute(table)
            connection.executemany("INSERT INTO about VALUES (?, ?)", [("format", FORMAT), *sorted(about.items())])
            connection.execute("COMMIT")
        except sqlite3.Error as error:
            raise JournalError(f"{path} cannot be begun: {error}. No device was moved. Is the disk full?") from error
        return cls(connection, path)

    @classmethod
    def open(cls, path: Path) -> Journal:
        """Open a stored journal for reading, of a finished run or of one cut short; also what is left of a damaged one.

        Raises
        ------
        JournalError
            When there is no journal there, or it is not one of ours.
        """
        if not path.is_file():
            raise JournalError(
                f"{path} does not exist. Name a run's folder, for example runs/2026-01-31T12-00-00-iron."
            )
        try:
            connection = sqlite3.connect(path, isolation_level=None)
            connection.execute("PRAGMA query_only=ON")
            if found := damage(path, connection):
                connection.close()
                connection = readable_part(path)
            has_begun = connection.execute("SELECT count(*) FROM sqlite_schema").fetchone() != (0,)
            stored = connection.execute("SELECT value FROM about WHERE key='format'").fetchone() if has_begun else None
        except (sqlite3.Error, OSError) as error:
            raise JournalError(f"{path} cannot be read as a journal: {error}.") from error
        if not has_begun:
            connection.close()
            raise JournalError(
                f"{path} is empty: the run was cut off before its first step. There is nothing to look at."
            )
        (number,) = stored or ("none",)
        if number not in MISSING:
            connection.close()
            raise JournalError(
                f"{path} has journal format {number}; this version of goniometer reads {KNOWN}. Read "
                "it with the version that wrote it, or a newer one."
            )
        return cls(connection, path, number, found)

    @classmethod
    def go_on(cls, path: Path) -> Journal:
        """Open a stored journal to write it on; every page of it is looked at first.

        Raises
        ------
        JournalError
            When there is no journal there, it is damaged, or an earlier version wrote it.
        """
        journal = cls.open(path)
        try:
            if journal.damage:
                raise JournalError(
                    f"{path} is damaged, and nothing was written to it: {journal.damage}. Copy the folder away before "
                    f"anything else and look at the disk. What can still be read: goniometer fit {path.parent}. Then "
                    "run the recipe again."
                )
            if journal._stored != FORMAT:
                raise JournalError(
                    f"{path} was begun by an earlier version of goniometer (journal format {journal._stored}), whose "
                    "journals are read and not written on. Nothing was changed. Run the recipe again; what was "
                    f"measured can be fitted: goniometer fit {path.parent}"
                )
            journal._connection.execute("PRAGMA query_only=OFF")
            journal._connection.execute(_SAFE)
        except BaseException:
            journal.close()
            raise
        return journal

    def append(self, reading: Reading, frames: Sequence[StoredFrame] = (), *, is_planned: bool = True) -> None:
        """Store one reading; when this returns it is on disk.

        Parameters
        ----------
        reading : Reading
            What was read.
        frames : sequence of StoredFrame
            Its pictures, whose files are there already.
        is_planned : bool
            Whether the recipe's plan has it, or it was taken besides because the scan was interrupted.

        Raises
        ------
        JournalError
            When it cannot be stored; everything stored before stays readable.
        """
        try:
            if not frames:
                self._connection.execute(APPEND, (*astuple(reading), is_planned))
                return
            with self._connection:  # all of it, or nothing
                self._connection.execute("BEGIN")
                row = self._connection.execute(APPEND, (*astuple(reading), is_planned)).lastrowid
                self._connection.executemany(APPEND_FRAME, [(row, *astuple(frame)) for frame in frames])
        except sqlite3.Error as error:
            raise JournalError(
                f"{self.path}: reading at point {reading.point} could not be stored: {error}. "
                "All earlier readings are safe; the scan stops. Free disk space, then go on with: goniometer resume "
                f"{self.path.parent}"
            ) from error

    def remember(self, key: str, text: str) -> None:
        """Add to what `about` holds, or replace it: what is known only later, such as how the scan ended.

        Raises
        ------
        JournalError
            When it cannot be stored.
        """
        try:
            self._connection.execute("INSERT OR REPLACE INTO about VALUES (?, ?)", (key, text))
        except sqlite3.Error as error:
            raise JournalError(f"{self.path}: '{key}' could not be stored: {error}. All readings are safe.") from error

    def begin_again(self, at: str, by: str) -> None:
        """Note that the scan was interrupted and goes on, and forget why it had stopped.

        Parameters
        ----------
        at : str
            When, in ISO 8601.
        by : str
            The program that goes on, and where.

        Raises
        ------
        JournalError
            When it cannot be stored.
        """
        try:
            self._connection.execute("BEGIN IMMEDIATE")
            self._connection.execute(INTERRUPTED, (STOPPED, at, by))
            self._connection.execute("DELETE FROM about WHERE key=?", (STOPPED,))
            self._connection.execute("COMMIT")
        except sqlite3.Error as error:
            raise JournalError(
                f"{self.path}: that the scan goes on could not be stored: {error}. All readings are safe; no further "
                "one was taken."
            ) from error

    def interruptions(self) -> tuple[Interruption, ...]:
        """When the scan was interrupted, and went on, in order."""
        if self._stored in WITHOUT_PLAN:
            return ()
        return tuple(Interruption(*row) for row in self._rows(INTERRUPTIONS))

    def last_stored_at(self) -> str | None:
        """When the last reading was stored, by the computer's clock, in ISO 8601; None when there is none."""
        row = self._connection.execute("SELECT stored_at FROM readings ORDER BY id DESC LIMIT 1").fetchone()
        return None if row is None else str(row[0])

    def taken(self) -> tuple[StoredReading, ...]:
        """All stored readings, and whether the plan has them, in the order they were taken."""
        rows = self._rows(f"SELECT {', '.join(COLUMNS)}, is_planned FROM readings ORDER BY id")  # noqa: S608 (names are ours)
        return tuple(StoredReading(Reading(*row[:-1]), bool(row[-1])) for row in rows)

    def readings(self) -> tuple[Reading, ...]:
        """All stored readings, in the order they were taken."""
        return tuple(Reading(*row) for row in self._rows(self._select))

    def frames(self) -> tuple[tuple[StoredFrame, ...], ...]:
        """The pictures of each stored reading, in the order of `readings`; none of what was read without a camera."""
        of_readings: dict[int, list[StoredFrame]] = {int(row[0]): [] for row in self._rows(_IDS)}
        if self._stored in WITH_FRAMES:
            for reading, *row in self._rows(_FRAMES):
                if reading in of_readings:
                    of_readings[reading].append(StoredFrame(*row))
        return tuple(map(tuple, of_readings.values()))

    def about(self) -> dict[str, str]:
        """Recipe, rig and scene texts, versions, seed."""
        return dict(self._rows("SELECT key, value FROM about"))

    def _rows(self, query: str) -> Iterator[tuple[Any, ...]]:
        """The rows that a query finds, those before the damage if there is any; one at a time, for there are many."""
        try:
            yield from self._connection.execute(query)
        except sqlite3.Error as error:
            if not self.damage:
                raise JournalError(f"{self.path} cannot be read: {error}.") from error

    def close(self) -> None:
        """Close the file; SQLite folds its write-ahead log in."""
        self._connection.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
