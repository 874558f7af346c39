"""The journal of a run: one SQLite file, one transaction a reading, on disk before anybody is told.

Write-ahead logging with ``synchronous=FULL`` keeps every acknowledged reading through a kill or a power cut;
docs/decisions/journal.md says why.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Mapping
from dataclasses import astuple, fields
from pathlib import Path
from types import TracebackType
from typing import Self

from acquisition.readings import Reading
from goniometer.errors import JournalError

FILE_NAME = "journal.sqlite"
_FORMAT = "2"
_COLUMNS = tuple(field.name for field in fields(Reading))
_MISSING = {"1": ("retarder_deg", "retardance_deg"), _FORMAT: ()}
"""Columns that the journals of each format do not have; nothing stood in their place."""

_TYPES = {"point": "INTEGER", "kind": "TEXT", "repeat": "INTEGER", "slot": "INTEGER"}
_CREATE = (
    "CREATE TABLE about (key TEXT PRIMARY KEY, value TEXT NOT NULL) STRICT",
    f"""CREATE TABLE readings (
    id INTEGER PRIMARY KEY,
    {", ".join(f"{name} {_TYPES.get(name, 'REAL')}" for name in _COLUMNS)},
    stored_at TEXT NOT NULL DEFAULT (strftime('%Y-%m-%dT%H:%M:%fZ', 'now'))
) STRICT""",
)
_NAMES = ", ".join(_COLUMNS)
_APPEND = f"INSERT INTO readings ({_NAMES}) VALUES ({', '.join('?' * len(_COLUMNS))})"  # noqa: S608 (names are ours)


class Journal:
    """The readings of one run, and what is needed to understand them.

    Use `create` for a new run and `open` for a stored one.
    """

    def __init__(self, connection: sqlite3.Connection, path: Path, stored: str = _FORMAT) -> None:
        self._connection, self.path = connection, path
        names = ("NULL" if name in _MISSING[stored] else name for name in _COLUMNS)
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
            connection.execute("PRAGMA synchronous=FULL")
            connection.execute("BEGIN")
            for table in _CREATE:
                connection.execute(table)
            connection.executemany("INSERT INTO about VALUES (?, ?)", [("format", _FORMAT), *sorted(about.items())])
            connection.execute("COMMIT")
        except sqlite3.Error as error:
            raise JournalError(f"{path} cannot be begun: {error}. No device was moved. Is the disk full?") from error
        return cls(connection, path)

    @classmethod
    def open(cls, path: Path) -> Journal:
        """Open a stored journal for reading, whole or cut short by a kill.

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
            has_begun = connection.execute("SELECT count(*) FROM sqlite_schema").fetchone() != (0,)
            stored = connection.execute("SELECT value FROM about WHERE key='format'").fetchone() if has_begun else None
        except sqlite3.Error as error:
            raise JournalError(f"{path} cannot be read as a journal: {error}.") from error
        if not has_begun:
            connection.close()
            raise JournalError(
                f"{path} is empty: the run was cut off before its first step. There is nothing to look at."
            )
        (number,) = stored or ("none",)
        if number not in _MISSING:
            connection.close()
            raise JournalError(
                f"{path} has journal format {number}; this version of goniometer reads {' and '.join(_MISSING)}. Read "
                "it with the version that wrote it, or a newer one."
            )
        return cls(connection, path, number)

    def append(self, reading: Reading) -> None:
        """Store one reading; when this returns it is on disk.

        Raises
        ------
        JournalError
            When it cannot be stored; everything stored before stays readable.
        """
        try:
            self._connection.execute(_APPEND, astuple(reading))
        except sqlite3.Error as error:
            raise JournalError(
                f"{self.path}: reading at point {reading.point} could not be stored: {error}. "
                "All earlier readings are safe; the scan stops. Free disk space, then run the recipe again."
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

    def readings(self) -> tuple[Reading, ...]:
        """All stored readings, in the order they were taken."""
        try:
            return tuple(Reading(*row) for row in self._connection.execute(self._select))
        except sqlite3.Error as error:
            raise JournalError(f"{self.path}: the readings cannot be read: {error}.") from error

    def about(self) -> dict[str, str]:
        """Recipe, rig and scene texts, versions, seed."""
        return dict(self._connection.execute("SELECT key, value FROM about"))

    def close(self) -> None:
        """Close the file; SQLite folds its write-ahead log in."""
        self._connection.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
