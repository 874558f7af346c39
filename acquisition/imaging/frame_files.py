"""The pictures of a run: one PNG file each, on disk before the reading that they belong to is in the journal."""

from __future__ import annotations

import os
import zlib
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from drivers.camera.frame import Frame
from drivers.camera.quiet_opencv import quiet_opencv
from goniometer.errors import JournalError

FOLDER = "frames"
_FASTEST = 1
"""Of PNG's levels of compression: higher ones gain a few percent on noise, and the next reading would have to wait."""


@dataclass(frozen=True)
class StoredFrame:
    """What the journal keeps of a picture: its file in the run's folder, and all of `Frame` but the counts.

    `crc32` is that of the counts, low byte first, so that a file which was damaged or exchanged is noticed.
    """

    file: str
    bits: int
    exposure_s: float
    gain_db: float
    time_s: float
    number: int | None
    crc32: int
    averaged: int = 1


class FrameFiles:
    """Writes the pictures of one run.

    Parameters
    ----------
    folder : Path
        The run's.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        there = [int(path.stem) for path in (folder / FOLDER).glob("*.png") if path.stem.isdigit()]
        self._next = max(there, default=-1) + 1

    def save(self, frames: Sequence[Frame]) -> tuple[StoredFrame, ...]:
        """Write pictures; when this returns they are on disk.

        Raises
        ------
        JournalError
            When one cannot be written.
        """
        return tuple(map(self._save, frames))

    def _save(self, frame: Frame) -> StoredFrame:
        import cv2

        file = f"{FOLDER}/{self._next:06d}.png"
        self._next += 1
        _, encoded = cv2.imencode(".png", frame.counts, [cv2.IMWRITE_PNG_COMPRESSION, _FASTEST])
        path = self._folder / file
        part = path.with_name(f"{path.name}.part")  # all that a writer that is killed leaves behind
        try:
            path.parent.mkdir(exist_ok=True)
            with part.open("wb") as opened:
                opened.write(encoded.tobytes())
                opened.flush()
                os.fsync(opened.fileno())
            part.replace(path)
        except OSError as error:
            with suppress(OSError):
                part.unlink(missing_ok=True)
            raise JournalError(
                f"The picture {path} could not be stored: {error}. Its reading is lost; all before it are stored with "
                "their pictures. Is the disk full?"
            ) from error
        kept = frame.bits, frame.exposure_s, frame.gain_db, frame.time_s, frame.number
        return StoredFrame(file, *kept, _crc32(frame.counts), frame.averaged)


def load_frame(folder: Path, stored: StoredFrame) -> Frame:
    """A picture of the run in `folder`.

    Raises
    ------
    JournalError
        When its file is missing, or does not hold what was stored.
    """
    import cv2

    quiet_opencv()
    path = folder / stored.file
    try:
        decoded = cv2.imdecode(np.frombuffer(path.read_bytes(), np.uint8), cv2.IMREAD_UNCHANGED)
    except (OSError, cv2.error) as error:
        raise JournalError(f"The picture {path} cannot be read: {error}. Is there a copy of the run?") from error
    counts = None if decoded is None else np.asarray(decoded, np.uint16)
    if counts is None or _crc32(counts) != stored.crc32:
        raise JournalError(
            f"The picture {path} is not the one that was stored with its reading: it was damaged or exchanged. Look "
            "for a copy of the run's folder."
        )
    kept = stored.bits, stored.exposure_s, stored.gain_db, stored.time_s, stored.number, stored.averaged
    return Frame(counts, *kept)


def _crc32(counts: NDArray[np.uint16]) -> int:
    return zlib.crc32(np.ascontiguousarray(counts, "<u2").tobytes())
