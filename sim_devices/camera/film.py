"""The frames of a film: one JPEG after the other, at the camera's pace, as far as its client can follow."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from sim_devices.camera.camera import Camera
from sim_devices.camera.exposure import Exposure
from sim_devices.device import Due, Passing, hang_up

HEAD = (
    b"HTTP/1.1 200 OK\r\nContent-Type: multipart/x-mixed-replace;boundary=frame\r\n"
    b"Cache-Control: no-store\r\nConnection: close\r\n\r\n"
)


class Film(Passing):
    """What one client watches; a frame is made when it has been read out, so that it shows what has truly been.

    A still takes the sensor away from the frame under way. Frames that nobody can be sent are counted and not made.

    Parameters
    ----------
    camera : Camera
        Whose frames.
    exposure : Exposure
        The first one.
    """

    def __init__(self, camera: Camera, exposure: Exposure) -> None:
        self._camera, self._exposure = camera, exposure
        self.patience_s = max(camera.frame_s, exposure.exposure_s + camera.readout_s)

    def next(self) -> Due:
        """The next frame, at its time."""
        return self._camera.ready_s(self._exposure), self

    def __call__(self, due_s: float) -> Sequence[Due]:
        """A frame, and then the next."""
        free_s = self._camera.still_during(self._exposure)
        if free_s is not None:
            self._exposure = replace(self._exposure, start_s=free_s)
            return [self.next()]
        picture = self._camera.shoot(self._exposure)
        file = self._camera.file(picture, "jpg")
        self._go_on(1)
        said = (due_s, _part(file.content, file.said_bytes, self._camera.headers(picture)))
        # whoever is told a wrong length never finds the next frame
        return [said, self.next()] if len(file.content) == file.said_bytes else [said, (due_s, hang_up)]

    def passed(self, now_s: float) -> Sequence[Due]:
        """Go on to the newest frame that there is, or to the next."""
        frames = max(1, math.floor((now_s - self._camera.ready_s(self._exposure)) / self.patience_s))
        self._camera.count(frames)
        self._go_on(frames)
        return [self.next()]

    def _go_on(self, frames: int) -> None:
        self._exposure = replace(self._exposure, start_s=self._exposure.start_s + frames * self.patience_s)


def _part(content: bytes, said_bytes: int, headers: Sequence[tuple[str, str]]) -> bytes:
    """A frame with its boundary, in one piece, because what is said in one piece is sent whole or not at all."""
    lines = ["--frame", "Content-Type: image/jpeg", f"Content-Length: {said_bytes}"]
    lines += [f"{name}: {value}" for name, value in headers]
    return "\r\n".join([*lines, "", ""]).encode("ascii") + content + b"\r\n"
