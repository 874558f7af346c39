"""Fits as they come in, kept beside their table, so that what is done once need not be done again."""

from __future__ import annotations

import errno
import hashlib
import json
import os
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from acquisition.journal import FILE_NAME
from goniometer import __version__
from goniometer.errors import JournalError
from goniometer.many_fits.row import CRASHED, Asked, Row
from goniometer.recipe_includes import whole_recipe
from goniometer.yaml_file import read_yaml

_FORMAT = 1


@dataclass(frozen=True)
class Input:
    """An input as it is at one time: size in bytes and time of the last change in ns, -1 if it is not there."""

    path: Path
    size: int
    changed_ns: int

    @classmethod
    def now(cls, path: Path) -> Input:
        """An input as it is now; of a run, its journal."""
        try:
            status = (path / FILE_NAME if path.is_dir() else path).stat()
        except OSError:
            return cls(path, -1, -1)
        return cls(path, status.st_size, status.st_mtime_ns)


class ProgressFile:
    """One line of JSON for each input that is done, on disk before the next is taken in.

    A line says what was fitted: the input's path, size and time of change, a digest of what was asked, and the
    program's version. If one of these is different now, the input counts as not done.

    Parameters
    ----------
    path : Path
        The file; made if it does not exist.
    asked : Asked
        What is fitted now.

    Raises
    ------
    JournalError
        If the file cannot be read or written, or is not of this kind.
    """

    def __init__(self, path: Path, asked: Asked) -> None:
        self.path = path
        self._asked = _digest(asked)
        self._done: dict[tuple[Any, ...], Row] = {}
        try:
            content = path.read_bytes() if path.exists() else b""
            end = content.rfind(b"\n") + 1
            self._take(content[:end])
            if end < len(content):
                os.truncate(path, end)  # the program was ended while it wrote: that input is done again
            self._file = path.open("ab", buffering=0)
        except JournalError:
            raise
        except OSError as error:
            raise self._trouble("opened", error) from error

    def row(self, given: Input) -> Row | None:
        """What became of an input; None if it is not done, was another then, or the program failed on it."""
        row = self._done.get(_key(self._about(given)))
        return None if row is None or row["status"] == CRASHED else row

    def keep(self, given: Input, row: Row) -> None:
        """Store what became of an input.

        Raises
        ------
        JournalError
            If the disk does not take it.
        """
        line = {**self._about(given), "row": row}
        text = (json.dumps(line, allow_nan=False) + "\n").encode()
        try:
            if self._file.write(text) != len(text):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            os.fsync(self._file.fileno())
        except OSError as error:
            raise self._trouble("written", error) from error
        self._done[_key(line)] = row

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._file.close()

    def _about(self, given: Input) -> dict[str, Any]:
        return {
            "format": _FORMAT,
            "version": __version__,
            "path": str(given.path),
            "size": given.size,
            "changed_ns": given.changed_ns,
            "asked": self._asked,
        }

    def _take(self, content: bytes) -> None:
        for number, text in enumerate(content.splitlines(), start=1):
            try:
                line = json.loads(text)
                self._done[_key(line)] = line["row"] if line["row"]["status"] else {}
            except (ValueError, KeyError, TypeError) as error:
                raise JournalError(
                    f"{self.path}, line {number}, is not a stored fit. Nothing was fitted. Remove the line, or the "
                    "file, to have what it holds done again."
                ) from error

    def _trouble(self, what: str, error: OSError) -> JournalError:
        return JournalError(
            f"{self.path} cannot be {what}: {error.strerror}. What was stored before is safe. Make room or choose "
            "another folder, then go on with --resume."
        )


def _key(line: dict[str, Any]) -> tuple[Any, ...]:
    return tuple(line[name] for name in ("format", "version", "path", "size", "changed_ns", "asked"))


def _digest(asked: Asked) -> str:
    """What identifies a choice: the texts of the recipe and of the rig that it names, and the changes."""
    digest = hashlib.sha256(json.dumps(dict(asked.changes), sort_keys=True).encode())
    if asked.recipe is not None:
        digest.update(asked.recipe.read_bytes())
        whole = whole_recipe(read_yaml(asked.recipe))
        digest.update(whole.text.encode())
        rig = (whole.data or {}).get("rig")
        if isinstance(rig, str) and (asked.recipe.parent / rig).is_file():
            digest.update((asked.recipe.parent / rig).read_bytes())
    return digest.hexdigest()
