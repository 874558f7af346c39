"""The table of many fits: one row an input, as CSV or Parquet."""

from __future__ import annotations

import csv
import importlib.util
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from goniometer.errors import ConfigurationError, JournalError
from goniometer.many_fits.row import MEASURES, Row

CSV, PARQUET = ".csv", ".parquet"
_FIRST = ("path", "status", "message")


def require_table(out: Path) -> None:
    """Refuse a file that no table can be written into, or that holds anything but an earlier table of many fits.

    Raises
    ------
    ConfigurationError
        If it is so.
    """
    if out.suffix.lower() not in (CSV, PARQUET):
        raise ConfigurationError(
            [f"--out is {out}; a table of many fits is a {CSV} or a {PARQUET} file. Nothing was fitted."]
        )
    if out.suffix.lower() == PARQUET and importlib.util.find_spec("pyarrow") is None:
        raise ConfigurationError(
            [
                f"{out} needs pyarrow, which is not installed. Nothing was fitted. "
                f"Run: pip install 'goniometer[distributed]', or write a {CSV} file."
            ]
        )
    if not out.parent.is_dir():
        raise ConfigurationError([f"--out is {out}; the folder {out.parent} does not exist. Nothing was fitted."])
    if out.is_dir() or (out.exists() and out.stat().st_size and not is_table(out)):
        raise ConfigurationError(
            [
                f"--out is {out}, which is there already and is no table of many fits. Nothing was fitted, and it is "
                "as it was. Choose another name, or move it away."
            ]
        )


def is_table(path: Path) -> bool:
    """Whether a file is a table of many fits, by its first columns."""
    if path.suffix.lower() == PARQUET:
        return _is_parquet_table(path)
    start = ",".join(_FIRST).encode() + b","
    with path.open("rb") as file:
        return file.read(len(start)) == start


def _is_parquet_table(path: Path) -> bool:
    import pyarrow
    from pyarrow import parquet

    try:
        return tuple(parquet.read_schema(path).names[: len(_FIRST)]) == _FIRST
    except pyarrow.ArrowInvalid:
        return False


def write_table(out: Path, rows: Sequence[tuple[Path, Row]]) -> None:
    """Write the rows of inputs, in this order, into a file that is replaced as a whole.

    Columns are path, status and message; for every parameter that any input has its value, standard error and whether
    it is at a bound; and the measures of the fit. What an input does not have is empty.

    Parameters
    ----------
    out : Path
        The file; its ending decides what it is.
    rows : sequence of (Path, Row)
        Inputs, and what became of them.

    Raises
    ------
    JournalError
        If the file cannot be written.
    """
    columns = _columns(rows)
    part = out.with_name(out.name + ".part")
    try:
        (_write_parquet if out.suffix.lower() == PARQUET else _write_csv)(part, columns)
        part.replace(out)
    except OSError as error:
        raise JournalError(
            f"The table {out} cannot be written: {error.strerror or error}. The fits themselves are stored. Make room, "
            "then run the same command with --resume."
        ) from error
    finally:
        part.unlink(missing_ok=True)


def _columns(rows: Sequence[tuple[Path, Row]]) -> dict[str, list[Any]]:
    first = [[_readable(str(path)), row["status"], _readable(row["message"])] for path, row in rows]
    columns: dict[str, list[Any]] = {name: [cells[place] for cells in first] for place, name in enumerate(_FIRST)}
    for name in dict.fromkeys(name for _, row in rows for name in row.get("parameters", {})):
        estimates = [row.get("parameters", {}).get(name, (None, None, None)) for _, row in rows]
        for place, column in enumerate((name, f"{name}_stderr", f"{name}_at_bound")):
            columns[column] = [estimate[place] for estimate in estimates]
    for name in MEASURES:
        columns[name] = [row.get(name) for _, row in rows]
    return columns


def _readable(text: str) -> str:
    """A text without what no encoding has: bytes of a file's name that are no text, as their numbers."""
    return text.encode(errors="backslashreplace").decode()


def _write_csv(path: Path, columns: Mapping[str, list[Any]]) -> None:
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows([_cell(value) for value in row] for row in zip(*columns.values(), strict=True))


def _cell(value: Any) -> str:
    match value:
        case None:
            return ""
        case bool():
            return "true" if value else "false"
        case float():
            return repr(value)
    return str(value)


def _write_parquet(path: Path, columns: Mapping[str, list[Any]]) -> None:
    import pyarrow
    from pyarrow import parquet

    text, truth, whole = pyarrow.string(), pyarrow.bool_(), pyarrow.int64()
    kinds = {**dict.fromkeys(_FIRST, text), "degrees_of_freedom": whole}
    arrays = {
        name: pyarrow.array(values, kinds.get(name, truth if name.endswith("_at_bound") else pyarrow.float64()))
        for name, values in columns.items()
    }
    parquet.write_table(pyarrow.table(arrays), path)
