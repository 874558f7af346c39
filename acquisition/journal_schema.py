"""The tables of a journal, and the statements that fill them."""

from __future__ import annotations

from dataclasses import fields

from acquisition.imaging.frame_files import StoredFrame
from acquisition.readings import Reading

_ADDED: dict[str, tuple[str, ...]] = {
    "1": (),
    "2": ("retarder_deg", "retardance_deg"),
    "3": (),  # what was planned, and interruptions
    "4": ("exit_azimuth_deg", "generator_slot", "generator_deg", "generator_retarder_deg", "generator_retardance_deg"),
    "5": ("wavelength_nm", "analyzer_sweep_deg", "retarder_sweep_deg"),
    "6": (),  # pictures
}
"""Columns of a reading that each format has beside those of the one before."""

FORMAT = max(_ADDED)
KNOWN = f"{', '.join([*_ADDED][:-1])} and {FORMAT}"
COLUMNS = tuple(field.name for field in fields(Reading))
MISSING = {known: tuple(name for later, names in _ADDED.items() if later > known for name in names) for known in _ADDED}
"""Columns of a reading that the journals of each format do not have; nothing stood in their place."""

WITHOUT_PLAN = ("1", "2")
"""Formats that do not say which readings were planned."""

WITH_FRAMES = ("6",)
"""Formats that can hold pictures."""

FRAME_COLUMNS = tuple(field.name for field in fields(StoredFrame))
_FRAME_TYPES = {
    "file": "TEXT NOT NULL",
    "bits": "INTEGER",
    "number": "INTEGER",
    "crc32": "INTEGER",
    "averaged": "INTEGER",
}

_TYPES = {"point": "INTEGER", "kind": "TEXT", "repeat": "INTEGER", "slot": "INTEGER", "generator_slot": "INTEGER"}
CREATE = (
    "CREATE TABLE about (key TEXT PRIMARY KEY, value TEXT NOT NULL) STRICT",
    f"""CREATE TABLE readings (
    id INTEGER PRIMARY KEY,
    {", ".join(f"{name} {_TYPES.get(name, 'REAL')}" for name in COLUMNS)},
    is_planned INTEGER NOT NULL,
    stored_at TEXT NOT NULL DEFAULT (strftime('%Y-%m-%dT%H:%M:%fZ', 'now'))
) STRICT""",
    f"""CREATE TABLE frames (
    reading INTEGER NOT NULL REFERENCES readings (id),
    {", ".join(f"{name} {_FRAME_TYPES.get(name, 'REAL')}" for name in FRAME_COLUMNS)}
) STRICT""",
    """CREATE TABLE interruptions (
    id INTEGER PRIMARY KEY,
    readings INTEGER NOT NULL,
    last_stored_at TEXT,
    why TEXT,
    resumed_at TEXT NOT NULL,
    resumed_with TEXT NOT NULL
) STRICT""",
)
APPEND = (
    f"INSERT INTO readings ({', '.join(COLUMNS)}, is_planned) "  # noqa: S608 (names are ours)
    f"VALUES ({', '.join('?' * (len(COLUMNS) + 1))})"
)
APPEND_FRAME = (
    f"INSERT INTO frames (reading, {', '.join(FRAME_COLUMNS)}) "  # noqa: S608 (names are ours)
    f"VALUES (?, {', '.join('?' * len(FRAME_COLUMNS))})"
)
INTERRUPTED = """INSERT INTO interruptions (readings, last_stored_at, why, resumed_at, resumed_with) VALUES (
    (SELECT count(*) FROM readings),
    (SELECT stored_at FROM readings ORDER BY id DESC LIMIT 1),
    (SELECT value FROM about WHERE key = ?),
    ?, ?
)"""
INTERRUPTIONS = "SELECT readings, last_stored_at, why, resumed_at, resumed_with FROM interruptions ORDER BY id"
