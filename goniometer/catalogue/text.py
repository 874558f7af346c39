"""A catalogue as a table for a terminal."""

from __future__ import annotations

from collections.abc import Sequence

from goniometer.catalogue.entry import Entry

_HEAD = ("", "when", "state", "readings", "chi²/dof", "recipe", "sample", "folder")
_TO_THE_RIGHT = {0, 3, 4}


def catalogue_text(entries: Sequence[Entry]) -> str:
    """One line a run, with the number by which it can be opened; why a run cannot be read stands below the table."""
    rows = [_HEAD, *(_row(number, entry) for number, entry in enumerate(entries, start=1))]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = ["  ".join(_padded(row, widths)).rstrip() for row in rows]
    faults = [f"{entry.folder}: {entry.fault}" for entry in entries if entry.fault]
    return "\n".join([*lines, *([""] if faults else []), *faults])


def _row(number: int, entry: Entry) -> tuple[str, ...]:
    chi_square = "" if entry.chi_square_reduced is None else f"{entry.chi_square_reduced:.2f}"
    return (
        str(number),
        f"{entry.begun:%Y-%m-%d %H:%M}",
        entry.state,
        "" if entry.state == "unreadable" else str(entry.readings),
        chi_square,
        entry.recipe,
        entry.sample,
        entry.folder.name,
    )


def _padded(row: Sequence[str], widths: Sequence[int]) -> list[str]:
    return [
        cell.rjust(width) if place in _TO_THE_RIGHT else cell.ljust(width)
        for place, (cell, width) in enumerate(zip(row, widths, strict=True))
    ]
