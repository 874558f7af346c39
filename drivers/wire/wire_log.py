"""Every byte sent and received, written to a file that never outgrows its limit."""

from __future__ import annotations

import logging
import threading
from datetime import UTC, datetime
from pathlib import Path

from drivers.clock import Clock

_log = logging.getLogger(__name__)


class WireLog:
    r"""A text file with one line for each piece of bytes, as it was sent or came.

    A line holds, with tabs between: wall time (UTC), seconds on the clock, device, ``>`` for sent, ``<`` for received
    or ``!`` for an event of the link, the bytes as text (``\r``, ``\x80``) and in hexadecimal. A full file is renamed
    to ``.1``, what was ``.1`` to ``.2``, and so on; the oldest is deleted.

    Every line is with the system before the next byte goes out, so that a program that is killed leaves whole lines.
    When the disk is full or gone the log ends, with one warning, and the scan goes on. Devices in several threads may
    share a log.

    Parameters
    ----------
    path : Path
        The newest file; its folder exists. An earlier log there is continued.
    clock : Clock
        The clock of the scan.
    file_bytes : int
        How long a file grows before the next one is begun.
    files : int
        How many files are kept, the newest included; 1 or more.
    """

    def __init__(self, path: Path, clock: Clock, *, file_bytes: int = 10_000_000, files: int = 5) -> None:
        self._path, self._clock = path, clock
        self._file_bytes, self._files = file_bytes, files
        self._file = path.open("ab", buffering=0)  # nothing is lost in a buffer when the program is killed
        self._one_at_a_time = threading.Lock()

    def sent(self, device: str, data: bytes) -> None:
        """Note bytes that go to a device."""
        self._write(device, ">", _text(data), data.hex(" "))

    def received(self, device: str, data: bytes) -> None:
        """Note bytes that came from a device, whole answers or pieces."""
        self._write(device, "<", _text(data), data.hex(" "))

    def event(self, device: str, text: str) -> None:
        """Note what happened to the link itself."""
        self._write(device, "!", text.encode("unicode_escape").decode("ascii"), "")

    def close(self) -> None:
        """Close the file; may be called again, and nothing is noted afterwards."""
        with self._one_at_a_time:
            self._file.close()

    def _write(self, *columns: str) -> None:
        with self._one_at_a_time:
            if not self._file.closed:
                now = datetime.now(UTC).isoformat(timespec="microseconds").replace("+00:00", "Z")
                self._append("\t".join((now, f"{self._clock.now():.6f}", *columns)).encode() + b"\n")

    def _append(self, line: bytes) -> None:
        try:
            if self._file.tell() and self._file.tell() + len(line) > self._file_bytes:
                self._begin_next()
            if self._file.write(line) < len(line):
                raise OSError("it took a part of a line only, as a full disk does")
        except OSError as error:
            self._file.close()
            _log.warning(
                "The wire log %s ends here, because it cannot be written (%s). The scan goes on without it. Make room "
                "on the disk before the next one.",
                self._path,
                error,
            )

    def _begin_next(self) -> None:
        self._file.close()
        for number in range(self._files - 1, 0, -1):
            kept = self._numbered(number - 1)
            if kept.exists():
                kept.replace(self._numbered(number))
        self._path.unlink(missing_ok=True)
        self._file = self._path.open("ab", buffering=0)  # as at the start: other programs may append to it, too

    def _numbered(self, number: int) -> Path:
        return self._path.with_name(f"{self._path.name}.{number}") if number else self._path


def _text(data: bytes) -> str:
    return data.decode("latin-1").encode("unicode_escape").decode("ascii")
