"""Files that are there whole or not at all."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from goniometer.errors import JournalError


@contextmanager
def written_whole(path: Path) -> Iterator[Path]:
    """Give a neighbouring name to write to, and move it to `path` once the writing has ended well.

    A writer that is killed leaves at most a file that ends in ``.part``; what stood at `path` before stays untouched.

    Parameters
    ----------
    path : Path
        Where the finished file belongs.

    Raises
    ------
    JournalError
        The file cannot be written, for example because the disk is full.
    """
    part = path.with_name(path.name + ".part")
    try:
        yield part
        part.replace(path)
    except OSError as error:
        raise JournalError(
            f"The file {path} cannot be written: {error}. The readings are safe in the run's journal. "
            "Make room or choose another folder, then write the file again from the journal."
        ) from error
    finally:
        part.unlink(missing_ok=True)
