"""Whether a still picture is the one that was asked for: new, of that moment, and taken as asked."""

from __future__ import annotations

import time

from drivers.camera import still_errors as errors
from drivers.camera.camera_clock import TOLERANCE_S, CameraClock
from drivers.camera.still_headers import StillHeaders

_SAME_EXPOSURE = 1e-3
_SAME_DB = 0.005
_TICK_S = time.get_clock_info("monotonic").resolution
"""What two looks at the bench's clock may take from the time between them: a 64th of a second on some systems."""


class StillChecks:
    """What is known of a camera from its pictures so far; each check raises DeviceError.

    Attributes
    ----------
    dropped_frames : int
        Frames that the camera has counted and that were not asked for here.
    """

    def __init__(self, name: str) -> None:
        self.dropped_frames = 0
        self._name, self._clock = name, CameraClock()
        self._number: int | None = None
        self._asked = 0
        self._never_said: tuple[str, ...] | None = None

    def asked(self) -> None:
        """Note that a picture was asked for, whatever comes of it."""
        self._asked += 1

    def says_all(self, said: StillHeaders) -> None:
        """Check that a picture says all that any before it has said: else it would be taken without its checks."""
        never_said = said.missing if self._never_said is None else self._never_said
        if left_out := [name for name in said.missing if name not in never_said]:
            raise errors.says_less(self._name, left_out)
        self._never_said = said.missing

    def as_asked(self, said: StillHeaders, exposure_s: float, gain_db: float, *, step_s: float) -> tuple[float, float]:
        """Exposure and gain as they were applied; where the camera does not say, as asked."""
        applied_s = exposure_s if said.exposure_s is None else said.exposure_s
        applied_db = gain_db if said.gain_db is None else said.gain_db
        if applied_s <= 0 or abs(applied_s - exposure_s) > _rounding_s(exposure_s, step_s):
            raise errors.not_as_asked(self._name, "an exposure in s of", applied_s, exposure_s)
        if abs(applied_db - gain_db) > _SAME_DB:
            raise errors.not_as_asked(self._name, "a gain in dB of", applied_db, gain_db)
        return applied_s, applied_db

    def is_new(self, number: int) -> None:
        """Check that the camera has counted on; count the frames that are left out."""
        if self._number is not None:
            if number <= self._number:
                raise errors.stale(self._name, number, self._number)
            self.dropped_frames += max(0, number - self._number - self._asked)
        self._number, self._asked = number, 0

    def had_time(self, since_s: float, exposure_s: float, *, step_s: float) -> None:
        """Check that a picture that was whole `since_s` after it was asked for can have been exposed in between."""
        if since_s < exposure_s - _rounding_s(exposure_s, step_s) - TOLERANCE_S - _TICK_S:
            raise errors.too_soon(self._name, since_s, exposure_s)

    def begun_s(self, start_s: float, exposure_s: float, *, asked_s: float, answered_s: float) -> float:
        """When the exposure began on the bench's clock; parameters as of `CameraClock.off_by_s`."""
        off_by_s = self._clock.off_by_s(start_s, exposure_s, asked_s=asked_s, answered_s=answered_s)
        if off_by_s:
            raise errors.shifted(self._name, off_by_s)
        self._clock.learn(start_s, exposure_s, asked_s=asked_s, answered_s=answered_s)
        return self._clock.on_bench_s(start_s)


def _rounding_s(exposure_s: float, step_s: float) -> float:
    """By how much a camera may round an exposure."""
    return max(_SAME_EXPOSURE * exposure_s, 0.5 * step_s)
