"""What can be said of one run without reducing or fitting it, read so that a scan that writes it notices nothing."""

from __future__ import annotations

import json
import re
import sqlite3
from contextlib import closing
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Literal

import yaml

from acquisition import journal
from goniometer.run_lock import is_being_written

FIT_FILE = "fit.json"

State = Literal["finished", "cut short", "running", "unreadable"]

_BUSY_S = 1.0
_NAME = {key: re.compile(rf"^{key}:\s+(\S.*)$", re.MULTILINE) for key in ("recipe", "scene")}


@dataclass(frozen=True)
class Entry:
    """One run of a catalogue.

    Attributes
    ----------
    folder : Path
        The run's folder.
    begun : datetime
        When the run began, in the local time zone; of an unreadable run, when its folder was last changed.
    state : State
        Whether its scan has ended as it was asked to, was cut short, is being written now, or cannot be read.
    recipe, sample : str
        The recipe's name, and that of the scene that a simulated bench held; empty where there is none.
    readings : int
        How many are stored.
    chi_square_reduced : float or None
        Of the fit in the folder, chi-square for each degree of freedom; None without one.
    fault : str
        Why it cannot be read; empty otherwise.
    text : str
        Everything in which a person may search: folder, recipe, rig, scene, versions, provenance.
    """

    folder: Path
    begun: datetime
    state: State
    recipe: str = ""
    sample: str = ""
    readings: int = 0
    chi_square_reduced: float | None = None
    fault: str = ""
    text: str = ""


def read_entry(folder: Path) -> Entry:
    """Look at one run; whatever is wrong with it becomes its `fault`."""
    try:
        about, readings, first_stored_at = _looked_at(folder / journal.FILE_NAME)
        begun = _begun(about, first_stored_at) or _changed(folder)
        return Entry(
            folder,
            begun.astimezone(),
            _state(folder, about),
            recipe=_named(about, "recipe"),
            sample=_named(about, "scene"),
            readings=readings,
            chi_square_reduced=_chi_square_reduced(folder / FIT_FILE),
            text="\n".join([folder.name, *about.values()]),
        )
    except (OSError, ValueError, TypeError, KeyError, sqlite3.Error, yaml.YAMLError) as error:
        return Entry(folder, _changed(folder), "unreadable", fault=" ".join(str(error).split()), text=folder.name)


def _looked_at(path: Path) -> tuple[dict[str, str], int, str | None]:
    """What a journal remembers of its run, how many readings it has, and when the first of them was stored."""
    # Without a write-ahead log nobody is writing, and a look that takes the file as it is leaves no traces beside it.
    is_closed = not path.with_name(f"{path.name}-wal").exists()
    address = f"{path.resolve().as_uri()}?mode=ro{'&immutable=1' if is_closed else ''}"
    with closing(sqlite3.connect(address, timeout=_BUSY_S, uri=True)) as connection:
        if connection.execute("SELECT count(*) FROM sqlite_schema").fetchone() == (0,):
            return {}, 0, None  # cut off before its first step
        about = dict(connection.execute("SELECT key, value FROM about"))
        # readings are numbered from 1 and never removed: to count a long scan would take much longer
        (readings,) = connection.execute("SELECT coalesce(max(id), 0) FROM readings").fetchone()
        first = connection.execute("SELECT stored_at FROM readings ORDER BY id LIMIT 1").fetchone()
    return about, readings, first and first[0]


def _state(folder: Path, about: dict[str, str]) -> State:
    if is_being_written(folder):
        return "running"
    # Runs of versions that did not write down how they ended have results if they ended well.
    has_ended = "ended" in about if "started" in about else (folder / FIT_FILE).exists()
    return "finished" if has_ended else "cut short"


def _begun(about: dict[str, str], first_stored_at: str | None) -> datetime | None:
    written = about.get("started") or first_stored_at
    return datetime.fromisoformat(written) if written else None


def _changed(folder: Path) -> datetime:
    return datetime.fromtimestamp(folder.stat().st_mtime, UTC).astimezone()


def _named(about: dict[str, str], key: str) -> str:
    """The name in the first line of a recipe or a scene; to read the whole YAML would take most of the time."""
    text = about.get(key, "")
    found = _NAME[key].search(text)
    content = yaml.safe_load(found.group() if found else text)
    return str(content[key]) if content else ""


def _chi_square_reduced(path: Path) -> float | None:
    try:
        fit: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return None
    freedom = fit.get("degrees_of_freedom")
    return fit["chi_square"] / freedom if freedom else None
