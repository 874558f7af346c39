"""A simulated camera: exposures one after the other, each with a number, and files of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from sim_devices.camera.exposure import Exposure, Means, Refused
from sim_devices.camera.sensor import Image, Sensor
from sim_devices.effects.measurement import Moment

Counts = NDArray[np.uint8] | NDArray[np.uint16]

_WRITING: dict[str, list[int]] = {
    "png": [cv2.IMWRITE_PNG_COMPRESSION, 1],
    "tiff": [],
    "jpg": [cv2.IMWRITE_JPEG_QUALITY, 95],
}


class CameraLight(Protocol):
    """What falls on the pixels."""

    def power_w(self, moment: Moment) -> Image | None:
        """Mean power on each pixel over an exposure, (height, width); None in the dark."""
        ...


@dataclass(frozen=True, eq=False)
class Picture:
    """What was read out of an exposure, and the exposure's number."""

    counts: Counts
    number: int
    exposure: Exposure


@dataclass(frozen=True)
class File:
    """A picture's file; `said_bytes` is how long its sender says that it is."""

    content: bytes
    said_bytes: int


class Camera:
    """What all clients share; one still at a time, and between stills the frames of whoever watches.

    What an exposure gives, and what file becomes of it, are two functions which a fault may wrap.

    Parameters
    ----------
    light : CameraLight
        What falls on the pixels.
    sensor : Sensor
        What makes counts of it.
    height, width : int
        Its pixels.
    means : Means
        What it can be asked for.
    readout_s : float
        From the end of an exposure to its file.
    frame_s : float
        From frame to frame of a film, unless exposure and read-out last longer.
    zero_s : float
        What the camera's own clock shows when the bench's begins.

    Attributes
    ----------
    shoot : callable
        From an exposure to its picture.
    file : callable
        From a picture and "png", "tiff" or "jpg" to its file.
    last : Picture or None
        The newest picture.
    """

    def __init__(
        self,
        light: CameraLight,
        sensor: Sensor,
        *,
        height: int,
        width: int,
        means: Means,
        readout_s: float,
        frame_s: float,
        zero_s: float = 0.0,
    ) -> None:
        self.light, self._sensor = light, sensor
        self.height, self.width = height, width
        self.means, self.readout_s, self.frame_s, self.zero_s = means, readout_s, frame_s, zero_s
        self.shoot: Callable[[Exposure], Picture] = self._shoot
        self.file: Callable[[Picture, str], File] = _file
        self.last: Picture | None = None
        self._exposures = 0
        self._still_s = (-np.inf, -np.inf)

    def still(self, exposure: Exposure) -> Picture:
        """Take a picture.

        Raises
        ------
        Refused
            With status 503, while another one is under way.
        """
        if exposure.start_s < self._still_s[1]:
            raise Refused(503, "another still is being exposed or read out. No picture was taken; ask again after it.")
        self._still_s = exposure.start_s, self.ready_s(exposure)
        return self.shoot(exposure)

    def ready_s(self, exposure: Exposure) -> float:
        """When an exposure has been read out."""
        return exposure.start_s + exposure.exposure_s + self.readout_s

    def still_during(self, exposure: Exposure) -> float | None:
        """When the still ends that takes the sensor away during an exposure; None where there is none."""
        start_s, end_s = self._still_s
        return end_s if start_s < self.ready_s(exposure) and exposure.start_s < end_s else None

    def count(self, exposures: int = 1) -> int:
        """Count exposures; the number of the last one, from 1."""
        self._exposures += exposures
        return self._exposures

    def headers(self, picture: Picture) -> list[tuple[str, str]]:
        """What is told of a picture beside it; the time is that of the camera's own clock."""
        exposure = picture.exposure
        return [
            ("X-Frame-Number", str(picture.number)),
            ("X-Exposure-Start-s", f"{self.zero_s + exposure.start_s:.6f}"),
            ("X-Exposure-s", f"{exposure.exposure_s:.6f}"),
            ("X-Gain-dB", f"{exposure.gain_db:.1f}"),
        ]

    def expose(self, exposure: Exposure, power_w: Image | None) -> Picture:
        """Expose the sensor to light on its pixels, (height, width), or to the dark."""
        number = self.count()
        counts = self._sensor.counts(power_w, exposure.exposure_s, exposure.gain_db, exposure.bits, number)
        self.last = Picture(counts, number, exposure)
        return self.last

    def _shoot(self, exposure: Exposure) -> Picture:
        return self.expose(exposure, self.light.power_w(Moment(exposure.middle_s, exposure.exposure_s)))


def _file(picture: Picture, kind: str) -> File:
    is_written, content = cv2.imencode(f".{kind}", picture.counts, _WRITING[kind])
    assert is_written
    return File(content.tobytes(), content.size)
