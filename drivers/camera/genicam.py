"""GenICam cameras, through the `harvesters` library and the transport library (.cti) of the camera's maker.

Not tried on a real camera: written from the documentation and source of harvesters 1.4.3 and the Standard Features
Naming Convention, and tested with the producer without hardware that comes with harvesters.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

from drivers.camera import genicam_errors as errors
from drivers.camera.frame import Frame
from drivers.camera.gentl import Fetched, GentlCamera, Library, harvesters
from drivers.camera.photometer import Photometer
from drivers.camera.reads_pictures import ReadsPictures
from drivers.clock import Clock, Deadline
from drivers.same_device import same_device

_SAME = 0.01
_ROUNDING = 1 - 1e-9
_MOST_ATTEMPTS = 3
_TRANSFER_S = 5.0
_WARM_UP_POLL_S = 0.005

_TRIGGER = {"TriggerSelector": "FrameStart", "TriggerSource": "Software", "TriggerMode": "On"}
_ALWAYS_BY_HAND = {"ExposureAuto": "Off", "GainAuto": "Off", "BlackLevelAuto": "Off", "AcquisitionMode": "Continuous"}
_SWITCHED_OFF = dict.fromkeys(("GammaEnable", "LUTEnable", "ReverseX", "ReverseY"), False)
_ONE_BY_ONE = dict.fromkeys(("BinningHorizontal", "BinningVertical", "DecimationHorizontal", "DecimationVertical"), 1)
_PLAIN = _SWITCHED_OFF | _ONE_BY_ONE
"""Counts in proportion to light, of single pixels of the sensor, not mirrored: a viewer may have left it otherwise, and
no picture shows it. Binning limits the size, which is set behind it."""


class GenicamCamera(ReadsPictures):
    """A camera, satisfying the engine's `Camera`: each reading is one picture.

    A camera with `TriggerMode` is triggered by software. Another one runs only during a reading, so that its first
    picture is one that was begun after the reading was.

    Parameters
    ----------
    transport_library, serial_number : str
        As of `GentlCamera`.
    clock : Clock
        The bench's.
    photometer : Photometer
        Reads the region; has the camera's name.
    size : tuple of int
        Width and height, which the camera is set to.
    bits : {8, 10, 12, 14, 16}
        Of a pixel, which the camera is set to: Mono8 and so on, unpacked.
    gain_db : float
        Which the camera is set to; one that has no `Gain` takes 0 only.
    warm_up_frames : int
        Pictures thrown away when it is connected.
    load : callable
        Loads harvesters.

    Attributes
    ----------
    actual_exposure_s : float
        What the camera made of the exposure asked for last.
    dropped_frames : int
        Pictures that were missing by the camera's own count, or came incomplete.
    identity : str
        Maker, model and serial number.
    """

    def __init__(
        self,
        transport_library: str,
        serial_number: str,
        clock: Clock,
        photometer: Photometer,
        *,
        size: tuple[int, int],
        bits: int,
        gain_db: float = 0.0,
        warm_up_frames: int = 0,
        load: Callable[[], Library] = harvesters,
    ) -> None:
        self.name, self.identity = photometer.name, ""
        self.actual_exposure_s, self.dropped_frames = 0.0, 0
        self._clock, self._photometer = clock, photometer
        self._open = partial(GentlCamera, self.name, transport_library, serial_number, load)
        self._size, self._bits, self._gain_db, self._warm_up_frames = size, bits, gain_db, warm_up_frames
        self._camera: GentlCamera | None = None
        self._is_triggered = self._is_running = self._is_reading = False
        self._attempts = self._incomplete = 0
        self._begun_s = self._exposed_s = 0.0
        self._last: Fetched | None = None
        self._deadline = Deadline(clock, 0.0)
        self._frame: Frame | None = None

    def connect(self) -> tuple[str, ...]:
        """Open the camera if it is not, set it up, and take its first pictures, which are thrown away.

        Returns
        -------
        tuple of str
            Nothing: a camera keeps no errors.

        Raises
        ------
        NotConnectedError
            When harvesters, the transport library or the camera is not there.
        DeviceFaultError
            When the camera does not take a setting, or is another one than the last time.
        """
        if self._camera is None:
            self.reconnect()
        camera = self._opened()
        self._stop()
        self.identity = same_device(self.name, self.identity, camera.identity)
        self._set_up(camera)
        exposure_s = float(camera.get("ExposureTime")) / 1e6
        for _ in range(self._warm_up_frames):
            self.start_reading(exposure_s)
            while self.is_reading():
                self._clock.sleep(_WARM_UP_POLL_S)
        self._frame = None
        return ()

    def start_reading(self, exposure_s: float) -> None:
        """Begin a picture.

        Raises
        ------
        LimitError
            When the camera has no exposure within 1 % of `exposure_s`; no picture is begun.
        NotConnectedError
            When the camera is not open, or is gone.
        """
        camera = self._opened()
        least_s, most_s = (limit / 1e6 for limit in camera.limits("ExposureTime"))
        if not least_s * _ROUNDING <= exposure_s <= most_s / _ROUNDING:
            raise errors.impossible_exposure(self.name, exposure_s, least_s, most_s)
        self.actual_exposure_s = camera.settled("ExposureTime", exposure_s * 1e6) / 1e6
        if not math.isclose(self.actual_exposure_s, exposure_s, rel_tol=_SAME):
            raise errors.other_exposure(self.name, exposure_s, self.actual_exposure_s)
        self._attempts = 0
        self._begin()

    def is_exposing(self) -> bool:
        """Whether light is still collected: until the picture has come, nobody knows when it was begun."""
        return self.is_reading()

    def is_reading(self) -> bool:
        """Whether the picture is still to come; one that came incomplete, or behind a lost one, is taken again, twice.

        Raises
        ------
        ReplyTimeoutError
            When it has not come after twice its exposure and 5 s.
        DeviceFaultError
            When it was lost for the third time, or is not what the camera was set to.
        NotConnectedError
            When the camera is gone.
        """
        if not self._is_reading or self._clock.now() < self._exposed_s:
            return self._is_reading
        camera = self._opened()
        fetched = camera.fetch()
        missing = camera.incomplete_frames - self._incomplete + (self._missing_before(fetched) if fetched else 0)
        if missing:
            self.dropped_frames += missing
            if self._attempts == _MOST_ATTEMPTS:
                raise errors.dropped(self.name, self._attempts)
            self._is_reading = False  # nothing of this attempt is still to come
            self._begin()
        elif fetched is not None:
            self._frame = self._frame_of(fetched)
            self._is_reading = False
            if not self._is_triggered:
                self._stop()
        elif self._deadline.has_passed():
            raise errors.overdue(self.name, self.actual_exposure_s)
        return self._is_reading

    def reconnect(self) -> None:
        """Open the camera afresh, once; raises NotConnectedError. The reading that was being taken is lost."""
        self.close()
        self._camera = self._open()

    def close(self) -> None:
        """Let go of the camera."""
        self._is_reading = self._is_running = False
        self._frame = self._last = None
        if self._camera is not None:
            self._camera.close()
            self._camera = None

    def _opened(self) -> GentlCamera:
        if self._camera is None:
            raise self._not_open()
        return self._camera

    def _set_up(self, camera: GentlCamera) -> None:
        width, height = self._size
        for feature, value in (_ALWAYS_BY_HAND | _PLAIN).items():
            if camera.has(feature):
                camera.set(feature, value)
        if camera.has("Gamma") and not camera.has("GammaEnable"):
            camera.set("Gamma", 1.0)
        for feature, wanted in (("PixelFormat", f"Mono{self._bits}"), ("Width", width), ("Height", height)):
            camera.set(feature, wanted)
        if camera.has("Gain") or self._gain_db:
            camera.set("Gain", self._gain_db)
        self._is_triggered = camera.has("TriggerMode")
        if self._is_triggered:
            for feature, value in _TRIGGER.items():
                camera.set(feature, value)

    def _begin(self) -> None:
        camera = self._opened()
        self._attempts += 1
        self._frame, self._incomplete = None, camera.incomplete_frames
        if self._is_reading or not self._is_triggered:
            self._stop()  # what may still come of the reading that was given up
        self._begun_s = self._clock.now()
        if not self._is_running:
            self._last = None  # pictures are counted afresh
            camera.start()
            self._is_running = True
        if self._is_triggered:
            camera.execute("TriggerSoftware")
        self._exposed_s = self._begun_s + self.actual_exposure_s * _ROUNDING
        self._deadline = Deadline(self._clock, 2 * self.actual_exposure_s + _TRANSFER_S)
        self._is_reading = True

    def _stop(self) -> None:
        if self._is_running:
            self._opened().stop()
            self._is_running = False

    def _missing_before(self, fetched: Fetched) -> int:
        """How many pictures the camera took and did not deliver, or 1 for an old one that it delivers again."""
        last, self._last = self._last, fetched
        if last is None:
            return 0
        is_old = fetched.stamp_ns is not None and last.stamp_ns is not None and fetched.stamp_ns <= last.stamp_ns
        return 1 if is_old else max(0, fetched.frame_id - last.frame_id - 1)

    def _frame_of(self, fetched: Fetched) -> Frame:
        height, width = fetched.counts.shape
        found, wanted = (width, height, fetched.pixel_format), (*self._size, f"Mono{self._bits}")
        if found != wanted:
            raise errors.other_picture(self.name, _words(found), _words(wanted))
        largest = (1 << self._bits) - 1
        if fetched.counts.max() > largest:
            raise errors.other_picture(self.name, f"{fetched.counts.max()} counts", f"{largest} at most")
        return Frame(fetched.counts, self._bits, self.actual_exposure_s, self._gain_db, self._begun_s, fetched.frame_id)


def _words(picture: tuple[int, int, str]) -> str:
    width, height, pixel_format = picture
    return f"{width} x {height} pixels in {pixel_format}"
