"""Cameras that serve still pictures over HTTP: every picture is a new exposure, begun by the question for it."""

from __future__ import annotations

import logging
import math

from drivers.camera import still_errors as errors
from drivers.camera.frame import Frame
from drivers.camera.http_dialogue import HttpDialogue
from drivers.camera.http_exchange import HttpResponse
from drivers.camera.photometer import Photometer
from drivers.camera.picture_file import counts_of
from drivers.camera.reads_pictures import ReadsPictures
from drivers.camera.status import CameraStatus, parse_status
from drivers.camera.still_checks import StillChecks
from drivers.camera.still_headers import read_headers
from drivers.camera.still_settings import StillSettings
from drivers.clock import Clock, Deadline
from drivers.same_device import same_device
from drivers.wire.link import Link
from goniometer.errors import DeviceError, LimitError

_STATUS = "/status.json"
_OK, _SERVER_ERRORS = 200, 500
_MOST_ATTEMPTS = 3
_PAUSE_S = 0.2
"""Before a picture is asked for again: a camera that was busy, or is in trouble, gets a moment."""
_POLL_S = 0.005
_WARM_UP_S = 0.01
_STATUS_S = 5.0
_ALLOWANCE_S = 2.0
_SLOWEST_BYTES_S = 2e6
_ROUNDING = 1 - 1e-9

_log = logging.getLogger(__name__)


class HttpStillCamera(ReadsPictures):
    """A camera, satisfying the engine's `Camera`.

    Parameters
    ----------
    link : Link
        ``http://host:port``.
    clock : Clock
        Counts exposures and deadlines, and stamps the frames.
    photometer : Photometer
        What makes readings of the frames; it has the camera's name in the rig file.
    settings : StillSettings
        What the camera is asked for, and what its pictures are to be.

    """

    def __init__(self, link: Link, clock: Clock, *, photometer: Photometer, settings: StillSettings) -> None:
        self.name, self.identity = photometer.name, ""
        self._link, self._clock, self._photometer, self._settings = link, clock, photometer, settings
        self._dialogue = HttpDialogue(link, name=self.name, most_bytes=settings.most_bytes)
        self._status = CameraStatus()
        self._checks = StillChecks(self.name)
        self._unchecked: tuple[str, ...] = ()
        self._attempts = 0
        self._exposure_s = self._asked_s = self._exposed_s = 0.0
        self._answered_s: float | None = None
        self._whole_s: float | None = None
        self._again_s: float | None = None
        self._limit_s = 0.0
        self._deadline = Deadline(clock, 0.0)
        self._is_taking = False
        self._frame: Frame | None = None

    @property
    def dropped_frames(self) -> int:
        """Frames that the camera has counted since it was connected and that were not asked for here.

        Others have taken them, or they were lost. The next `connect` tells of them and begins again at 0.
        """
        return self._checks.dropped_frames

    def connect(self) -> tuple[str, ...]:
        """Check that it is the camera of the rig file, take the first pictures and throw them away; learn its clock.

        Returns
        -------
        tuple of str
            What it does not say and is therefore not checked, and how many frames were dropped since the last time.

        Raises
        ------
        DeviceFaultError
            When it is another camera than the rig file describes, or another one than the last time.
        ReplyError
            When its status or its pictures are none.
        """
        notes = []
        if self.dropped_frames:
            notes.append(f"{self.dropped_frames} frames were dropped, or taken by another program")
        self._forget()
        status = self._ask_status()
        if status is None:
            notes.append(f"the camera has no {_STATUS}: that it is the camera of the rig file is not checked")
        self._status = status or CameraStatus()
        contradictions = tuple(self._settings.contradictions(self._status))
        if contradictions:
            raise errors.contradicted(self.name, contradictions)
        self.identity = same_device(self.name, self.identity, self._status.identity)
        low_s, high_s = self._status.exposure_s
        for _ in range(self._settings.warm_up_frames):
            self.start_reading(min(max(_WARM_UP_S, low_s), high_s))
            while self.is_reading():
                self._clock.sleep(_POLL_S)
        self._frame = None
        return (*notes, *self._unchecked)

    def start_reading(self, exposure_s: float) -> None:
        """Ask for a new exposure.

        Raises
        ------
        LimitError
            When the camera has no such exposure; nothing is sent.
        """
        low_s, high_s = self._status.exposure_s
        if not (0 < exposure_s < math.inf and low_s * _ROUNDING <= exposure_s * _ROUNDING <= high_s):
            raise errors.not_an_exposure(self.name, exposure_s, (max(low_s, 0.0), high_s))
        self._exposure_s, self._attempts, self._is_taking = exposure_s, 0, True
        self._ask()

    def is_exposing(self) -> bool:
        """Whether light is still collected: the exposure goes on, or no answer begins to come that is still awaited."""
        if not self._is_taking:
            return False
        if self._is_pausing() or self._is_before_its_end():
            return True
        return not self._look() and not self._deadline.has_passed()

    def is_reading(self) -> bool:
        """Whether the picture is still to come; one that is broken, not new or not as asked is taken again, twice.

        Raises
        ------
        ReplyTimeoutError
            When it has not come in time, for the third time.
        ReplyError
            When what has come is no such picture.
        DeviceFaultError
            When the camera reports an error, when it sends pictures that it has taken earlier, or with another exposure
            or gain than was asked for.
        LimitError
            When the camera refuses what it is asked for.
        """
        if not self._is_taking:
            return False
        if self._is_pausing() or self._is_before_its_end():
            return True
        try:
            response = self._dialogue.poll() if self._look() else None
            if response is None:
                if self._deadline.has_passed():
                    raise errors.overdue(self.name, self._link.port, self._exposure_s, self._limit_s, self._attempts)
                return True
            self._frame = self._judged(response)
        except DeviceError as error:
            if self._attempts == _MOST_ATTEMPTS or isinstance(error, LimitError):
                self._is_taking = False
                raise
            _log.warning("%s: attempt %d failed and is repeated: %s", self.name, self._attempts, error.happened)
            self._again_s = self._clock.now() + _PAUSE_S
            return True
        self._is_taking = False
        return False

    def reconnect(self) -> None:
        """Open the port afresh, once; raises NotConnectedError. The picture that was being taken is lost."""
        self._link.reconnect()
        self._is_taking, self._frame = False, None

    def close(self) -> None:
        """Close the port."""
        self._link.close()

    def _forget(self) -> None:
        self._checks, self._is_taking, self._frame = StillChecks(self.name), False, None

    def _ask_status(self) -> CameraStatus | None:
        self._dialogue.ask(_STATUS)
        deadline = Deadline(self._clock, _STATUS_S)
        while (response := self._dialogue.poll()) is None:
            if deadline.has_passed():
                raise errors.silent(self.name, self._link.port, _STATUS, _STATUS_S)
            self._clock.sleep(_POLL_S)
        if response.status >= _SERVER_ERRORS:
            raise errors.refused(self.name, _STATUS, response)
        if response.status != _OK or "json" not in response.headers.get("content-type", ""):
            return None
        return parse_status(self.name, response.body)

    def _ask(self) -> None:
        settings = self._settings
        self._attempts += 1
        self._checks.asked()
        self._frame = self._again_s = self._answered_s = self._whole_s = None
        self._limit_s = self._exposure_s + settings.readout_s + settings.most_bytes / _SLOWEST_BYTES_S + _ALLOWANCE_S
        self._asked_s = self._clock.now()
        self._dialogue.ask(settings.path(self._exposure_s))
        self._exposed_s = self._clock.now() + self._exposure_s * _ROUNDING
        self._deadline = Deadline(self._clock, self._limit_s)

    def _is_pausing(self) -> bool:
        """Whether the picture is not yet asked for again; asks for it when it is time."""
        if self._again_s is not None and self._clock.now() >= self._again_s:
            self._ask()
        return self._again_s is not None

    def _is_before_its_end(self) -> bool:
        """Whether the exposure cannot be over; notes when an answer is whole nevertheless."""
        if self._clock.now() >= self._exposed_s:
            return False
        if self._whole_s is None and self._dialogue.is_whole():
            self._whole_s = self._clock.now()
        return True

    def _look(self) -> bool:
        """Whether the answer has begun to come; notes when."""
        if self._answered_s is None and self._dialogue.has_begun():
            self._answered_s = self._clock.now()
        return self._answered_s is not None

    def _judged(self, response: HttpResponse) -> Frame:
        settings = self._settings
        if response.status != _OK:
            raise errors.refused(self.name, settings.path(self._exposure_s), response)
        said = read_headers(self.name, response.headers)
        self._checks.says_all(said)
        counts = counts_of(self.name, response.body, width=settings.width, height=settings.height, bits=settings.bits)
        exposure_s, gain_db = self._checks.as_asked(
            said, self._exposure_s, settings.gain_db, step_s=settings.exposure_step_s
        )
        if said.number is not None:
            self._checks.is_new(said.number)
        if self._whole_s is not None:
            self._checks.had_time(self._whole_s - self._asked_s, self._exposure_s, step_s=settings.exposure_step_s)
        time_s = self._asked_s
        if said.start_s is not None:
            assert self._answered_s is not None, "an answer has begun before it is judged"
            times = {"asked_s": self._asked_s, "answered_s": self._answered_s}
            time_s = self._checks.begun_s(said.start_s, exposure_s, **times)
        self._unchecked = tuple(said.unchecked())
        return Frame(counts, settings.bits, exposure_s, gain_db, time_s, said.number)
