"""Pictures of OpenCV's `VideoCapture`, each as counts of one channel."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum, auto
from typing import Literal
from urllib.parse import urlsplit

import cv2
import numpy as np
from numpy.typing import NDArray

from drivers.camera import video_errors as errors
from drivers.camera.quiet_opencv import quiet_opencv

Channel = Literal["red", "green", "blue", "gray"]

SETTINGS = {
    "frame_width": cv2.CAP_PROP_FRAME_WIDTH,
    "frame_height": cv2.CAP_PROP_FRAME_HEIGHT,
    "frames_per_s": cv2.CAP_PROP_FPS,
    "auto_exposure": cv2.CAP_PROP_AUTO_EXPOSURE,
    "exposure": cv2.CAP_PROP_EXPOSURE,
    "gain": cv2.CAP_PROP_GAIN,
}
"""What may be set, in the order in which it is: the size changes what rates there are, and the rate what exposures."""

_BLUE_GREEN_RED = ("blue", "green", "red")
_SAME = 0.005
_JPEG_START, _JPEG_END = b"\xff\xd8", b"\xff\xd9"
_MJPG = int.from_bytes(b"MJPG", "little")
_RAW = -1


class Kind(Enum):
    """What a video comes from."""

    DEVICE = auto()
    FILE = auto()
    STREAM = auto()


def kind_of(address: str) -> Kind:
    """Whether an address is that of a device (0, /dev/video0), a stream (http://, https://, rtsp://) or a file."""
    if address.isdecimal() or address.startswith("/dev/"):
        return Kind.DEVICE
    return Kind.STREAM if re.match(r"(https?|rtsp)://", address) else Kind.FILE


def without_password(address: str) -> str:
    """Return the address as it may be shown."""
    if kind_of(address) is not Kind.STREAM:
        return address
    parts = urlsplit(address)
    return parts._replace(netloc=parts.netloc.rpartition("@")[2]).geturl()


@dataclass(frozen=True, eq=False)
class Picture:
    """Counts (height, width), and when it is by the stream's own clock; nan where that has none."""

    counts: NDArray[np.uint8]
    position_s: float


class Capture:
    """An opened video.

    Parameters
    ----------
    address : str
        See `kind_of`.
    name : str
        The device's name in the rig file, for messages.
    channel : {"red", "green", "blue", "gray"}, optional
        What is taken of a picture in colours; without it the three must be equal.
    timeout_s : float
        How long a stream may take until it is there, and until its next picture is.

    Attributes
    ----------
    size : tuple of int
        Width and height of every picture.
    frames_per_s : float
        As the video says, 0 where it does not; streams of JPEG pictures are always said to have 25.

    Raises
    ------
    NotConnectedError
        When it cannot be opened, or its first picture does not come.
    """

    def __init__(self, address: str, *, name: str, channel: Channel | None = None, timeout_s: float = 5.0) -> None:
        self.name, self.shown = name, without_password(address)
        self.kind = kind_of(address)
        self._channel = channel
        self._frames = 0
        self._video = _opened(address, self.kind, timeout_s)
        if not self._video.isOpened():
            raise errors.not_opened(name, self.shown, self.kind is Kind.FILE)
        self.size = self._held_size()
        self.frames_per_s = self._video.get(cv2.CAP_PROP_FPS)
        # OpenCV stretches pictures of another size, and makes up what is missing of a damaged one, without a word
        self._is_raw = (
            self.kind is Kind.STREAM
            and int(self._video.get(cv2.CAP_PROP_FOURCC)) == _MJPG
            and self._video.set(cv2.CAP_PROP_FORMAT, _RAW)
        )

    def set(self, settings: Mapping[str, float]) -> None:
        """Set what `SETTINGS` names, and read it back; raises DeviceFaultError when the camera holds another value."""
        refused = []
        for setting in sorted(settings, key=list(SETTINGS).index):
            self._video.set(SETTINGS[setting], settings[setting])
        for setting, wanted in settings.items():
            held = self._video.get(SETTINGS[setting])
            if not math.isclose(held, wanted, rel_tol=_SAME, abs_tol=1e-9):
                refused.append(f"{setting} is {held:g} and not {wanted:g}")
        if refused:
            raise errors.not_set(self.name, refused)
        self.size = self._held_size()
        self.frames_per_s = self._video.get(cv2.CAP_PROP_FPS)

    def read(self) -> Picture | None:
        """Wait for the next picture; None when it came damaged.

        Raises
        ------
        NotConnectedError
            When a device or a stream gives no more pictures.
        DeviceFaultError
            When a file has ended, or a picture is of another size or in colours.
        """
        is_there, picture = self._video.read()
        if not is_there:
            raise (
                errors.file_ended(self.name, self.shown, self._frames)
                if self.kind is Kind.FILE
                else errors.lost(self.name, self.shown, self._frames)
            )
        self._frames += 1
        if self._is_raw:
            decoded = _decoded(picture.tobytes())
            if decoded is None:
                return None
            picture = decoded
        if picture.dtype != np.uint8:
            raise errors.not_8_bits(self.name, str(picture.dtype))
        if picture.shape[1::-1] != self.size:
            raise errors.other_size(self.name, picture.shape[1::-1], self.size)
        milliseconds = math.nan if self._is_raw else self._video.get(cv2.CAP_PROP_POS_MSEC)
        return Picture(self._one_channel(picture.astype(np.uint8, copy=False)), milliseconds / 1000)

    def close(self) -> None:
        """Let go of it; not while another thread reads."""
        self._video.release()

    def _held_size(self) -> tuple[int, int]:
        return int(self._video.get(cv2.CAP_PROP_FRAME_WIDTH)), int(self._video.get(cv2.CAP_PROP_FRAME_HEIGHT))

    def _one_channel(self, picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
        if picture.ndim == 2:
            return picture
        if self._channel in _BLUE_GREEN_RED:
            return np.ascontiguousarray(picture[:, :, _BLUE_GREEN_RED.index(self._channel)])
        if self._channel == "gray":
            return cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY).astype(np.uint8, copy=False)
        blue, green, red = (picture[:, :, channel] for channel in range(3))
        if not (np.array_equal(blue, green) and np.array_equal(green, red)):
            raise errors.in_colours(self.name)
        return np.ascontiguousarray(green)


def _opened(address: str, kind: Kind, timeout_s: float) -> cv2.VideoCapture:
    quiet_opencv()
    if kind is Kind.DEVICE:
        return cv2.VideoCapture(int(address)) if address.isdecimal() else cv2.VideoCapture(address)
    timeouts: Sequence[int] = []
    if kind is Kind.STREAM:
        milliseconds = max(1, round(1000 * timeout_s))
        timeouts = [cv2.CAP_PROP_OPEN_TIMEOUT_MSEC, milliseconds, cv2.CAP_PROP_READ_TIMEOUT_MSEC, milliseconds]
    # one thread: each further one would hold a picture back
    return cv2.VideoCapture(address, cv2.CAP_FFMPEG, [*timeouts, cv2.CAP_PROP_N_THREADS, 1])


def _decoded(jpeg: bytes) -> NDArray[np.uint8] | None:
    if not (jpeg.startswith(_JPEG_START) and jpeg.rstrip(b"\0\r\n").endswith(_JPEG_END)):
        return None
    picture: NDArray[np.uint8] | None = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_UNCHANGED)  # type: ignore[assignment]
    return picture
