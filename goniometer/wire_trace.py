"""`--trace`: every byte between the program and the devices, in a file that a person can read."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from drivers.clock import Clock
from drivers.wire.wire_log import WireLog
from goniometer.errors import GoniometerError

WIRE_LOG = "wire.log"
"""The file's name: in the folder of a run, else in the working directory."""


@contextmanager
def wire_log(path: Path | None, clock: Clock) -> Iterator[WireLog | None]:
    """A log of the wire while the block lasts, closed on every way out of it; None without a path.

    Parameters
    ----------
    path : Path or None
        The file, whose folder exists; an earlier log there is continued.
    clock : Clock
        The bench's clock.

    Raises
    ------
    GoniometerError
        When it cannot be written.
    """
    if path is None:
        yield None
        return
    try:
        log = WireLog(path, clock)
    except OSError as error:
        raise GoniometerError(
            f"The wire log {path} cannot be written: {error.strerror}. No device was opened. Make it writable, go to "
            "another folder, or leave out --trace."
        ) from error
    try:
        yield log
    except BaseException as error:
        error.add_note(f"Every byte until then is in {path}")
        raise
    finally:
        log.close()
