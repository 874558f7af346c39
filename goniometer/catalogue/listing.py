"""All runs in a folder, those that a person looks for, and the one that is meant."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from acquisition import journal
from goniometer.catalogue.entry import Entry, read_entry
from goniometer.errors import ConfigurationError


def catalogue(runs: Path, words: Sequence[str] = ()) -> tuple[Entry, ...]:
    """The runs in a folder, the newest first.

    Parameters
    ----------
    runs : Path
        The folder that holds the runs' folders.
    words : sequence of str
        Only runs are given that have all of them, in whatever case, in their folder's name, recipe, rig, scene or
        provenance.

    Raises
    ------
    ConfigurationError
        When there is no such folder.
    """
    if not runs.is_dir():
        raise ConfigurationError(
            [f"There is no folder {runs}. Name the one with the runs: goniometer runs --in FOLDER."]
        )
    entries = [read_entry(path) for path in runs.iterdir() if path.is_dir() and _holds_a_run(path)]
    wanted = [word.casefold() for word in words]
    found = [entry for entry in entries if all(word in entry.text.casefold() for word in wanted)]
    return tuple(sorted(found, key=lambda entry: (entry.begun, entry.folder.name), reverse=True))


def _holds_a_run(folder: Path) -> bool:
    try:
        return (folder / journal.FILE_NAME).exists()
    except OSError:  # nobody may look into it, which the list must show
        return True


def picked(entries: Sequence[Entry], name: str) -> Entry:
    """The run that a person means by its number in a list, from 1, or by a part of its folder's name.

    Raises
    ------
    ConfigurationError
        When there is none, or several.
    """
    if name.isdecimal() and 1 <= int(name) <= len(entries):
        return entries[int(name) - 1]
    found = [entry for entry in entries if name.casefold() in entry.folder.name.casefold()]
    if len(found) == 1:
        return found[0]
    if not found:
        raise ConfigurationError(
            [f"No run is called '{name}'. Write a number from the list, or part of a folder's name."]
        )
    raise ConfigurationError([f"'{name}' stands for {len(found)} runs: {', '.join(run.folder.name for run in found)}."])
