"""What is left of a journal whose file was cut off or damaged, as a full disk, a copy or a dying drive may do it."""

from __future__ import annotations

import sqlite3
from pathlib import Path

_MAGIC = b"SQLite format 3\0"
_HEADER_BYTES = 100
_PAGE_SIZE = slice(16, 18)
_IS_LOGGED = slice(18, 20)
"""Where the header says that there is a write-ahead log, which a copy in memory has not."""


def damage(path: Path, connection: sqlite3.Connection) -> str:
    """What is wrong with a journal, empty if nothing is; every page is looked at. Raises DatabaseError if it is none.

    SQLite takes what is missing of a last page for zeros, and so for readings that nobody took. While there is a
    write-ahead log the last page may be missing in part, and is in the log.
    """
    log = path.with_name(f"{path.name}-wal")
    has_log = log.exists() and log.stat().st_size > 0
    with path.open("rb") as file:
        header = file.read(_HEADER_BYTES)
    size = path.stat().st_size
    if size and not header.startswith(_MAGIC):
        raise sqlite3.DatabaseError("it is not a database")
    if size and size % _page_size(header) and not has_log:
        return f"it ends in the middle of a page, after {size} bytes"
    try:
        found = [str(row[0]) for row in connection.execute("PRAGMA quick_check")]
    except sqlite3.DatabaseError as error:
        found = [str(error)]
    return "" if found == ["ok"] else "; ".join(found[:3])


def readable_part(path: Path) -> sqlite3.Connection:
    """A copy in memory of the whole pages of a damaged journal; its file is not touched.

    Raises
    ------
    sqlite3.Error
        When not even the tables can be found in it.
    """
    data = bytearray(path.read_bytes())
    page_size = _page_size(data)
    whole = len(data) // page_size * page_size
    if not whole:
        raise sqlite3.DatabaseError("nothing of it is left")
    data[_IS_LOGGED] = b"\x01\x01"
    connection = sqlite3.connect(":memory:", isolation_level=None)
    try:
        connection.deserialize(bytes(data[:whole]))
        connection.execute("PRAGMA writable_schema=ON")  # else the number of pages must be what the header says
        connection.execute("PRAGMA query_only=ON")
        connection.execute("SELECT count(*) FROM about").fetchone()
    except BaseException:
        connection.close()
        raise
    return connection


def _page_size(data: bytes | bytearray) -> int:
    size = int.from_bytes(data[_PAGE_SIZE], "big")
    return size if size > 1 else 65536
