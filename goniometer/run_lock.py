"""Who writes a run: a locked file in its folder, which the system unlocks when the process ends, however it ends."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

from drivers.clock import Deadline, WallClock
from goniometer.errors import JournalError

FILE_NAME = ".lock"

_LOOK_S = 0.01
_LOOKERS_NEED_S = 0.5
"""Who only asks whether a run is being written holds its lock for a moment."""

if sys.platform == "win32":
    import msvcrt

    def _lock(file: IO[bytes], *, shared: bool) -> None:
        msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)

else:
    import fcntl

    def _lock(file: IO[bytes], *, shared: bool) -> None:
        fcntl.flock(file, (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | fcntl.LOCK_NB)


@contextmanager
def sole_writer(folder: Path) -> Iterator[None]:
    """Be the one process that writes a run while the block lasts.

    Raises
    ------
    JournalError
        When another process writes it, or the folder cannot be written to.
    """
    path = folder / FILE_NAME
    try:
        file = path.open("ab")
    except OSError as error:
        raise JournalError(f"{path} cannot be written: {error.strerror}. No device was moved.") from error
    with file:  # the file stays: removed, it could be locked by two that opened it before and after
        _wait_for_lock(file, folder)
        yield


def is_being_written(folder: Path) -> bool:
    """Whether a process, of this machine or of one that shares the folder's locks, is writing a run now."""
    try:
        file = (folder / FILE_NAME).open("rb")
    except FileNotFoundError:
        return False
    with file:
        try:
            _lock(file, shared=True)
        except OSError:
            return True
    return False


def _wait_for_lock(file: IO[bytes], folder: Path) -> None:
    clock = WallClock()
    deadline = Deadline(clock, _LOOKERS_NEED_S)
    while True:
        try:
            _lock(file, shared=False)
        except OSError as error:
            if deadline.has_passed():
                raise JournalError(
                    f"Another process is writing the run {folder}. Nothing was read or moved. Wait until it has ended, "
                    "or end it."
                ) from error
            clock.sleep(_LOOK_S)
        else:
            return
