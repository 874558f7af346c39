"""What all cameras do with a finished picture."""

from __future__ import annotations

from drivers.camera.frame import Frame
from drivers.camera.photometer import Photometer
from drivers.camera.region import RegionMean
from goniometer.errors import NotConnectedError


class ReadsPictures:
    """A camera that has a picture in hand, or none as yet."""

    name: str
    _photometer: Photometer
    _frame: Frame | None

    def power_w(self) -> float:
        """Mean power on a pixel of the region, in watts; raises SaturatedError, or ReplyError without a picture."""
        return self._photometer.power_w(self._frame)

    def read(self) -> RegionMean:
        """Mean and variance of the region's counts; raises as `power_w` does."""
        return self._photometer.mean(self._frame)

    def frame(self) -> Frame:
        """The picture of the finished reading, saturated or not; raises ReplyError when there is none."""
        return self._photometer.finished(self._frame)

    def _not_open(self) -> NotConnectedError:
        """For a camera that is asked for something before it was connected, or after it was closed."""
        return NotConnectedError(
            self.name, "the camera is not open", not_done="no picture was taken", to_do="connect it first"
        )
