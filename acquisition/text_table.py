"""A table of numbers as people and programs save it: read where it is unambiguous, refused with its line where not."""

from __future__ import annotations

import csv
import difflib
import math
import re
from collections.abc import Collection
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from goniometer.errors import FitError, JournalError
from model.geometry import FloatArray

_DELIMITERS = {",": "comma", ";": "semicolon", "\t": "tab"}
_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?", re.ASCII)
_COMMA_NUMBER = re.compile(r"[-+]?\d+,\d+([eE][-+]?\d+)?", re.ASCII)
_THOUSANDS = re.compile(r"[-+]?[1-9]\d{0,2},\d{3}", re.ASCII)
_MOST_FAULTS = 10


@dataclass
class TextTable:
    """Columns of numbers with the line of every row, and what is wrong with them.

    Attributes
    ----------
    path : Path
        The file.
    header_line : int
        Line of the columns' names.
    lines : list of int
        Line of every row.
    columns : dict of str to ndarray
        Shape (rows,) each.
    """

    path: Path
    header_line: int = 1
    lines: list[int] = field(default_factory=list)
    columns: dict[str, FloatArray] = field(default_factory=dict)
    _faults: list[str] = field(default_factory=list)

    def add(self, line: int, what: str) -> None:
        """Note a fault."""
        self._faults.append(f"{self.path}:{line}: {what}")

    def refuse(self, column: str, is_bad: ArrayLike, allowed: str) -> None:
        """Note a fault for every row of a column where `is_bad` is true."""
        for row in np.flatnonzero(is_bad):
            self.add(self.lines[row], f"column {column}: found {self.columns[column][row]:.10g}; {allowed}")

    def check(self) -> None:
        """Refuse the file for all faults that were noted; without any, do nothing.

        Raises
        ------
        FitError
            Names each fault with its line.
        """
        if self._faults:
            shown = self._faults[:_MOST_FAULTS]
            more = len(self._faults) - len(shown)
            rest = [f"and {more} more like these"] if more else []
            raise FitError("\n".join([*shown, *rest, f"{self.path} was not used. Nothing was fitted."]))


def read_table(path: Path, known: Collection[str]) -> TextTable:
    """Read a table of text: a line of column names, then numbers; lines that begin with # are comments.

    Columns are separated by commas, semicolons or tabs. Numbers may have a decimal comma where it can be nothing else.

    Parameters
    ----------
    path : Path
        The file, in UTF-8.
    known : collection of str
        Names that columns may have.

    Raises
    ------
    JournalError
        If the file cannot be read.
    FitError
        If it is no such table: lists what is wrong, with lines.
    """
    table = TextTable(path)
    numbered = [
        (number, line) for number, line in enumerate(_lines(path), 1) if line.strip() and line.lstrip()[0] != "#"
    ]
    if not numbered:
        table.add(1, "there is no table here; write a line of column names, then one line a direction")
        table.check()
    table.header_line, header = numbered[0]
    delimiter = _delimiter(table, header)
    names = [name.strip() for name in _cells(table, table.header_line, header, delimiter)]
    _check_names(table, names, known)
    table.check()
    rows = []
    for number, line in numbered[1:]:
        cells = [cell.strip() for cell in _cells(table, number, line, delimiter)]
        if len(cells) == len(names):
            table.lines.append(number)
            rows.append(cells)
        elif cells:
            hint = ""
            if len(cells) < len(names):
                hint = "; is one missing?"
            elif delimiter == ",":
                hint = "; are these decimal commas? Write 0.5, or separate columns by semicolons"
            table.add(number, f"found {len(cells)} values; the {len(names)} columns need as many{hint}")
    if not rows:
        table.add(table.header_line, "there is no row of numbers below the column names; write one line a direction")
    table.check()
    _read_numbers(table, names, rows)
    table.check()
    return table


def _lines(path: Path) -> list[str]:
    try:
        return path.read_text(encoding="utf-8-sig").split("\n")
    except OSError as error:
        raise JournalError(f"{path} cannot be read: {error.strerror or error}. Nothing was fitted.") from error
    except UnicodeDecodeError as error:
        line = error.object.count(b"\n", 0, error.start) + 1
        raise FitError(
            f"{path}:{line}: this is not UTF-8 text. Nothing was fitted. Save the table as CSV with the encoding UTF-8."
        ) from error


def _delimiter(table: TextTable, header: str) -> str:
    found = [delimiter for delimiter in _DELIMITERS if delimiter in header]
    if len(found) > 1:
        names = " and ".join(_DELIMITERS[delimiter] for delimiter in found)
        table.add(table.header_line, f"the column names are separated by {names}; separate them by one of these alone")
        table.check()
    return found[0] if found else ","


def _cells(table: TextTable, number: int, line: str, delimiter: str) -> list[str]:
    try:
        return next(csv.reader([line], delimiter=delimiter, strict=True))
    except csv.Error as error:
        table.add(number, f"the quotes of this line are broken ({error}); write numbers without quotes")
        return []


def _check_names(table: TextTable, names: list[str], known: Collection[str]) -> None:
    if not {name.lower() for name in names} & set(known):
        table.add(
            table.header_line,
            f"found '{', '.join(names)[:60]}' where the names of columns should be, and none of them is known; write "
            "names such as incidence_deg,exit_deg,dolp,dolp_stderr, separated by commas, semicolons or tabs",
        )
        return
    for name in dict.fromkeys(names):
        if names.count(name) > 1:
            table.add(
                table.header_line, f"column {name or 'without a name'} stands {names.count(name)} times; write it once"
            )
        if not name:
            table.add(table.header_line, "a column has no name; give it one, or take it out of the file")
        elif name not in known:
            near = _like(name.lower(), known)
            what = f"did you mean {near[0]}?" if near else "take it out of the file; docs/fit.md lists all columns"
            table.add(table.header_line, f"column {name} is not known; {what}")


def _like(name: str, known: Collection[str]) -> list[str]:
    """Known names that a name may stand for, the likeliest first: those that only add the unit, then similar ones."""
    fuller = sorted((other for other in known if other.startswith(f"{name}_")), key=len)
    return [*fuller, *difflib.get_close_matches(name, known, n=1)]


def _read_numbers(table: TextTable, names: list[str], rows: list[list[str]]) -> None:
    is_comma = _has_decimal_commas(table, names, rows)
    for place, name in enumerate(names):
        texts = [cells[place] for cells in rows]
        if is_comma:
            texts = [text.replace(",", ".") if _COMMA_NUMBER.fullmatch(text) else text for text in texts]
        numbers = [float(text) if _NUMBER.fullmatch(text) else math.nan for text in texts]
        table.columns[name] = np.array(numbers)
        for row in np.flatnonzero(~np.isfinite(numbers)):
            found = f"'{rows[row][place][:40]}'" if rows[row][place] else "nothing"
            what = f"found {found}; write a finite number such as 0.5 or 1e-5, or take the row out"
            table.add(table.lines[row], f"column {name}: {what}")


def _has_decimal_commas(table: TextTable, names: list[str], rows: list[list[str]]) -> bool:
    """Whether numbers have decimal commas; notes a fault where a comma could be something else."""
    if not any("," in text for cells in rows for text in cells):
        return False
    commas, point = [], None
    for number, cells in zip(table.lines, rows, strict=True):
        for name, text in zip(names, cells, strict=True):
            if _COMMA_NUMBER.fullmatch(text):
                commas.append((number, name, text))
            elif point is None and "." in text and _NUMBER.fullmatch(text):
                point = number, text
    if not commas:
        return False
    number, name, text = commas[0]
    if point is not None:
        table.add(
            number, f"column {name}: found '{text}', and in line {point[0]} '{point[1]}'; write points throughout"
        )
    elif all(_THOUSANDS.fullmatch(text) for _, _, text in commas):
        table.add(
            number,
            f"column {name}: found '{text}', which may be {text.replace(',', '.')} or {text.replace(',', '')}; write "
            "decimal points, and no sign between thousands",
        )
    return True
