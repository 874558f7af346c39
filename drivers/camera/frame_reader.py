"""A thread that takes pictures as they come, so that nobody has to wait for a camera."""

from __future__ import annotations

import math
import threading
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from drivers.camera import video_errors as errors
from drivers.camera.capture import Capture, Kind, Picture
from drivers.camera.frame_dates import FrameDates
from drivers.camera.frame_sum import FrameSum
from drivers.clock import Clock
from goniometer.errors import DeviceError

_JOIN_BEYOND_S = 1.0
_FEWEST_INTERVALS = 5


@dataclass
class Reading:
    """The pictures of a reading, as far as they have come.

    Attributes
    ----------
    wanted, frames : int
        How many it is to have, and has.
    from_s : float
        Pictures begun before are not of it; on the bench's clock.
    begun_s, last_s : float
        When its first picture was begun, and its last one.
    number : int
        Of its first picture, counted from 0 as they came.
    lost : int
        Pictures that were missing or damaged since it was begun.
    """

    wanted: int
    from_s: float
    begun_s: float = 0.0
    last_s: float = 0.0
    number: int = 0
    lost: int = 0
    frames: int = 0
    sum: FrameSum = field(default_factory=FrameSum)

    @property
    def is_complete(self) -> bool:
        """Whether all of its pictures have come."""
        return self.frames >= self.wanted

    def add(self, counts: NDArray[np.uint8], begun_s: float) -> None:
        """Add a picture, begun at `begun_s`."""
        self.sum.add(counts)
        self.frames += 1
        self.last_s = begun_s

    def lose(self, frames: int) -> None:
        """Count pictures that are missing or damaged, while there are still some to come."""
        if not self.is_complete:
            self.lost += frames

    @property
    def interval_s(self) -> float | None:
        """Mean time from one of its pictures to the next; None where there are too few to tell."""
        intervals = self.frames - 1
        return (self.last_s - self.begun_s) / intervals if intervals >= _FEWEST_INTERVALS else None


class FrameReader:
    """Takes the pictures of a `Capture`; keeps the sum of the reading under way, and the newest one.

    Those of a file are taken when a reading wants them, each once; those of a camera always, because whatever waits in
    a buffer grows old. The thread that reads is also the one that closes the capture, which no other may do meanwhile.

    Parameters
    ----------
    capture : Capture
        Opened.
    clock : Clock
        The bench's.
    frame_s, latency_s : float
        As of `FrameDates`.
    most_identical : int
        So many pictures in a row may be the same; 0 for any number.
    timeout_s : float
        How long a read of the capture lasts at most.

    Attributes
    ----------
    frames : int
        How many pictures have come.
    dropped_frames : int
        How many pictures were missing, by their dates.
    damaged_frames : int
        How many came, but could not be used.
    """

    def __init__(
        self,
        capture: Capture,
        clock: Clock,
        *,
        frame_s: float,
        latency_s: float,
        most_identical: int,
        timeout_s: float,
    ) -> None:
        self.frames = self.dropped_frames = self.damaged_frames = 0
        self._capture, self._clock = capture, clock
        self._is_live = capture.kind is not Kind.FILE
        self._most_identical, self._join_s = most_identical, timeout_s + _JOIN_BEYOND_S
        self._dates = FrameDates(frame_s, latency_s)
        self._identical = 0
        self._newest: Picture | None = None
        self._reading = Reading(0, 0.0)
        self._failure: DeviceError | None = None
        self._is_closing = False
        self._changed = threading.Condition()
        self._thread = threading.Thread(target=self._run, name=f"pictures of {capture.name}", daemon=True)
        self._thread.start()

    def begin(self, frames: int) -> None:
        """Begin a reading of so many pictures, none of them begun before now; it takes the place of an earlier one."""
        with self._changed:
            self._reading = Reading(frames, self._clock.now())
            self._changed.notify_all()

    def reading(self) -> Reading:
        """The reading as it is now, complete or under way; raises DeviceError when it will never be complete.

        What comes later changes nothing of what is returned, except the sum of a reading that is not complete.
        """
        with self._changed:
            if self._failure is not None and not self._reading.is_complete:
                raise self._failure
            return replace(self._reading)

    def wait(self, timeout_s: float) -> Reading:
        """Wait for the reading, so long at most in real time, and return it as `reading` does."""
        with self._changed:
            self._changed.wait_for(lambda: self._reading.is_complete or self._failure is not None, timeout_s)
        return self.reading()

    def close(self) -> None:
        """End the thread; one that is held up in a read is left to end by itself when that returns."""
        with self._changed:
            self._is_closing = True
            self._changed.notify_all()
        self._thread.join(self._join_s)

    def _run(self) -> None:
        try:
            while self._is_wanted():
                picture = self._capture.read()
                self._take(picture, self._clock.now())
        except DeviceError as error:
            self._fail(error)
        except Exception as error:  # noqa: BLE001 (whatever it is, the next poll tells it)
            self._fail(errors.crashed(self._capture.name, error))
        finally:
            self._capture.close()

    def _is_wanted(self) -> bool:
        with self._changed:
            self._changed.wait_for(lambda: self._is_closing or self._is_live or not self._reading.is_complete)
            return not self._is_closing

    def _take(self, picture: Picture | None, arrived_s: float) -> None:
        with self._changed:
            reading = self._reading
            begun_s, missing = self._dates.date(arrived_s, math.nan if picture is None else picture.position_s)
            self.dropped_frames += missing
            reading.lose(missing)
            if picture is None:
                self.damaged_frames += 1
                reading.lose(1)
                return
            if self._is_live:
                self._require_another(picture)
            if not reading.is_complete and (begun_s >= reading.from_s or not self._is_live):
                if reading.frames == 0:
                    reading.begun_s, reading.number = begun_s if self._is_live else reading.from_s, self.frames
                reading.add(picture.counts, begun_s)
            self._newest = picture
            self.frames += 1
            self._changed.notify_all()

    def _require_another(self, picture: Picture) -> None:
        """Refuse a picture that has stood still too long; one without any detail, such as the dark, may."""
        if not self._most_identical or self._newest is None:
            return
        counts = picture.counts
        is_same = np.array_equal(counts, self._newest.counts) and int(counts.min()) != int(counts.max())
        self._identical = self._identical + 1 if is_same else 0
        if self._identical >= self._most_identical:
            raise errors.frozen(self._capture.name, self._identical + 1)

    def _fail(self, error: DeviceError) -> None:
        with self._changed:
            self._failure = error
            self._changed.notify_all()
