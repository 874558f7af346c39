"""An output stream that falls silent, instead of failing, when nobody reads it any more."""

from __future__ import annotations

import os
import sys
from contextlib import suppress
from typing import TextIO


class LastingStream:
    """Passes text on until the reader is gone, then drops it: what is shown must never end a scan.

    A closed pipe (``goniometer run … | head``), a closed terminal and a full disk under a redirected output all end the
    showing and nothing else; the journal has every reading. The stream's file descriptor is turned to the null device,
    so that the interpreter's last flush has nobody to fail at either (Python manual, `signal`, "Note on SIGPIPE").

    Parameters
    ----------
    stream : text stream
        Where the text goes; characters its encoding lacks are written as ``?``. None for a program without one.
    """

    def __init__(self, stream: TextIO | None) -> None:
        self._stream = stream
        self.encoding = getattr(stream, "encoding", None) or "utf-8"
        self._terminal = stream is not None and stream.isatty()

    def write(self, text: str) -> int:
        """Write text and let it go out at once."""
        if self._stream is not None:
            try:
                self._stream.write(text.encode(self.encoding, "replace").decode(self.encoding))
                self._stream.flush()
            except OSError as error:
                self._fall_silent(self._stream, error)
        return len(text)

    def flush(self) -> None:
        """Do nothing: every write has gone out."""

    def isatty(self) -> bool:
        """Whether the stream is, or was, a terminal."""
        return self._terminal

    def fileno(self) -> int:
        """The file descriptor, by which the width of a terminal is found; OSError when there is none."""
        if self._stream is None:
            raise OSError("nobody reads this stream any more")
        return self._stream.fileno()

    def _fall_silent(self, stream: TextIO, reason: OSError) -> None:
        self._stream = None
        with suppress(OSError):  # the standard error may be gone with the same terminal
            print(f"Nothing more is shown ({reason.strerror}); the scan goes on and is stored.", file=sys.stderr)
        try:
            descriptor = stream.fileno()
        except OSError:  # a stream in memory has none
            return
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, descriptor)
        os.close(null)
