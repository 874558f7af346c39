"""Cameras that OpenCV opens as a video: by number, device path, network stream, or a file that stands for one."""

from __future__ import annotations

from collections.abc import Mapping

from drivers.camera import video_errors as errors
from drivers.camera.capture import Capture, Channel, Kind, kind_of, without_password
from drivers.camera.frame import Frame
from drivers.camera.frame_dates import TOLD_AFTER
from drivers.camera.frame_reader import FrameReader, Reading
from drivers.camera.frame_sum import BITS
from drivers.camera.photometer import Photometer
from drivers.camera.reads_pictures import ReadsPictures
from drivers.clock import Clock, Deadline
from drivers.same_device import same_device
from goniometer.errors import LimitError, ReplyTimeoutError

_LONGEST_S = 3600.0
_SAME_RATE = 1.25
"""Rates of cameras wander by some percent with the light and the computer's load, but are not wrong by a quarter."""


class VideoCamera(ReadsPictures):
    """A camera, satisfying the engine's `Camera`.

    A reading is the mean of the whole number of pictures nearest to its exposure, all of them begun after it was; where
    some are missing or damaged it takes longer, and others are in it. See `FrameSum` for the counts. Each frame's
    `exposure_s` is that of one picture, `frame_s`, because so much light makes its counts, and its `number` counts the
    pictures since the video was opened.

    Parameters
    ----------
    address : str
        A number, a path below /dev, http://, https:// or rtsp://, or the path of a file.
    clock : Clock
        The bench's.
    photometer : Photometer
        Reads the region; has the camera's name.
    size : tuple of int
        Width and height that its pictures must have.
    frame_s : float
        From one picture to the next.
    latency_s : float
        From the end of a picture's exposure until it arrives, at least.
    gain_db : float
        As set in the camera, for its frames.
    settings : mapping of str to float
        What OpenCV is to set (`drivers.camera.capture.SETTINGS`), in the units of the camera's driver.
    channel : {"red", "green", "blue", "gray"}, optional
        What is taken of pictures in colours.
    warm_up_frames : int
        Pictures thrown away when it is connected.
    most_identical : int
        So many pictures of a camera in a row may be the same; 0 for any number.
    timeout_s : float
        How long a stream may be silent.

    Attributes
    ----------
    actual_exposure_s : float
        Exposure of the reading begun last: the whole number of pictures nearest to what was asked for.
    identity : str
        Address and size.
    """

    def __init__(
        self,
        address: str,
        clock: Clock,
        photometer: Photometer,
        *,
        size: tuple[int, int],
        frame_s: float,
        latency_s: float = 0.0,
        gain_db: float = 0.0,
        settings: Mapping[str, float] | None = None,
        channel: Channel | None = None,
        warm_up_frames: int = 0,
        most_identical: int = 0,
        timeout_s: float = 5.0,
    ) -> None:
        self.name, self.identity = photometer.name, ""
        self.actual_exposure_s = 0.0
        self._address, self._clock, self._photometer = address, clock, photometer
        self._shown = without_password(address)
        self._size, self._frame_s, self._latency_s, self._gain_db = size, frame_s, latency_s, gain_db
        self._settings, self._channel = dict(settings or {}), channel
        self._warm_up_frames, self._most_identical, self._timeout_s = warm_up_frames, most_identical, timeout_s
        self._reader: FrameReader | None = None
        self._deadline = Deadline(clock, 0.0)
        self._is_reading = False
        self._frame: Frame | None = None

    @property
    def frames(self) -> int:
        """How many pictures have come since it was opened."""
        return self._reader.frames if self._reader else 0

    @property
    def dropped_frames(self) -> int:
        """How many pictures were missing since it was opened, by their dates."""
        return self._reader.dropped_frames if self._reader else 0

    def connect(self) -> tuple[str, ...]:
        """Open it if it is not, give it its settings, and wait for its first pictures, which are thrown away.

        Returns
        -------
        tuple of str
            Nothing: a camera keeps no errors.

        Raises
        ------
        NotConnectedError, ReplyTimeoutError
            When it cannot be opened, or its pictures do not come.
        DeviceFaultError
            When it did not take its settings, or has pictures of another size or rate, or in colours.
        """
        if self._reader is None:
            self.reconnect()
        reader = self._opened()
        if self._warm_up_frames:
            warm_up_s = self._warm_up_frames * self._frame_s
            reader.begin(self._warm_up_frames)
            reading = reader.wait(2 * (warm_up_s + self._latency_s) + self._timeout_s)
            if not reading.is_complete:
                raise self._overdue(warm_up_s, reading)
            if not self._is_file:
                self._require_rate(reading.interval_s, reading.lost)
        return ()

    def start_reading(self, exposure_s: float) -> None:
        """Begin a reading of the whole number of pictures, one at least, nearest to `exposure_s`.

        Raises
        ------
        LimitError
            When the exposure is no positive number, or longer than an hour.
        NotConnectedError
            When the camera is not open.
        """
        if not 0 < exposure_s <= _LONGEST_S:
            raise LimitError(
                self.name,
                f"an exposure of {exposure_s:g} s is not between 0 and {_LONGEST_S:g} s",
                not_done="the reading was not begun",
                to_do="change exposure_s in the recipe",
            )
        wanted = max(1, round(exposure_s / self._frame_s))
        self.actual_exposure_s = wanted * self._frame_s
        self._frame = None
        in_doubt_s = TOLD_AFTER * self._frame_s
        longest_s = 2 * (self.actual_exposure_s + self._latency_s) + in_doubt_s + self._timeout_s
        reader = self._opened()
        self._deadline = Deadline(self._clock, longest_s)
        reader.begin(wanted)
        self._is_reading = True

    def is_exposing(self) -> bool:
        """Whether light is still collected: until the last picture has come, nobody knows that it has."""
        return self.is_reading()

    def is_reading(self) -> bool:
        """Whether pictures are still to come.

        Raises
        ------
        NotConnectedError
            When the stream is lost.
        ReplyTimeoutError
            When they have not come after twice the time they take, and the time a stream may be silent.
        DeviceFaultError
            When a file has ended, the picture stands still, has another size or is in colours.
        """
        if not self._is_reading:
            return False
        reading = self._opened().reading()
        if not reading.is_complete:
            if self._deadline.has_passed():
                raise self._overdue(self.actual_exposure_s, reading)
            return True
        self._frame = self._frame_of(reading)
        self._is_reading = False
        return False

    def reconnect(self) -> None:
        """Open it afresh, once; raises NotConnectedError. The reading that was being taken is lost."""
        self.close()
        capture = Capture(self._address, name=self.name, channel=self._channel, timeout_s=self._timeout_s)
        try:
            self._set_up(capture)
        except BaseException:
            capture.close()
            raise
        self._reader = FrameReader(
            capture,
            self._clock,
            frame_s=self._frame_s,
            latency_s=self._latency_s,
            most_identical=self._most_identical,
            timeout_s=self._timeout_s,
        )

    def close(self) -> None:
        """Let go of the camera; waits little longer than the stream may be silent."""
        self._is_reading, self._frame = False, None
        if self._reader is not None:
            self._reader.close()
            self._reader = None

    @property
    def _is_file(self) -> bool:
        return kind_of(self._address) is Kind.FILE

    def _set_up(self, capture: Capture) -> None:
        capture.set(self._settings)
        if capture.size != self._size:
            raise errors.other_size(self.name, capture.size, self._size)
        if self._is_file and capture.frames_per_s > 0:
            self._require_rate(1 / capture.frames_per_s)
        width, height = capture.size
        self.identity = same_device(self.name, self.identity, f"{self._shown}, {width} x {height}")

    def _require_rate(self, interval_s: float | None, lost: int = 0) -> None:
        if interval_s is not None and not 1 / _SAME_RATE < interval_s / self._frame_s < _SAME_RATE:
            raise errors.other_rate(self.name, interval_s, self._frame_s, lost)

    def _opened(self) -> FrameReader:
        if self._reader is None:
            raise self._not_open()
        return self._reader

    def _overdue(self, exposure_s: float, reading: Reading) -> ReplyTimeoutError:
        came = reading.frames, reading.wanted, reading.lost
        return errors.overdue(self.name, self._shown, exposure_s, *came)

    def _frame_of(self, reading: Reading) -> Frame:
        return Frame(
            reading.sum.mean_counts(),
            BITS,
            self._frame_s,
            self._gain_db,
            reading.begun_s,
            reading.number,
            reading.wanted,
        )
