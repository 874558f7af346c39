"""What goes wrong with a camera's pictures: with an exposure, or with the file of it."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, ClassVar, Literal

import numpy as np
from pydantic import Field

from sim_devices.faults.entry import DeviceFault, Random
from sim_devices.faults.hooks import TakesPictures

if TYPE_CHECKING:
    from sim_devices.camera.camera import Camera, File, Picture
    from sim_devices.camera.exposure import Exposure
    from sim_devices.faults.switchboard import Switchboard

_MOST_FRAMES = 1_000_000


class FrameFault(DeviceFault):
    """A fault of the next `frames` pictures, stills and frames of a film alike."""

    needs: ClassVar[tuple[type, ...]] = (TakesPictures,)

    frames: int = Field(default=1, ge=1, le=_MOST_FRAMES, description="how many pictures in a row it spoils")

    def camera(self, board: Switchboard) -> Camera:
        """The one that it strikes."""
        device = board.device(self.device)
        assert isinstance(device, TakesPictures)
        return device.camera


class ExposureFault(FrameFault):
    """A fault of what the camera makes of an exposure."""

    def strike(self, board: Switchboard, random: Random, time_s: float) -> None:
        """Stand before the camera until all are spoilt."""
        camera, left = self.camera(board), self.frames
        usual = camera.shoot

        def shoot(exposure: Exposure) -> Picture:
            nonlocal left
            if not left:
                return usual(exposure)
            left -= 1
            return self.shot(camera, usual, exposure)

        camera.shoot = shoot

    @abstractmethod
    def shot(self, camera: Camera, usual: Callable[[Exposure], Picture], exposure: Exposure) -> Picture:
        """What becomes of an exposure."""


class FileFault(FrameFault):
    """A fault of a picture's file."""

    def strike(self, board: Switchboard, random: Random, time_s: float) -> None:
        """Stand behind the camera until all are spoilt."""
        camera, left = self.camera(board), self.frames
        usual = camera.file

        def file(picture: Picture, kind: str) -> File:
            nonlocal left
            if not left:
                return usual(picture, kind)
            left -= 1
            return self.spoilt(usual(picture, kind), random)

        camera.file = file

    @abstractmethod
    def spoilt(self, file: File, random: Random) -> File:
        """What becomes of a file."""


class FrameCorrupt(FileFault):
    """Files in which bytes are wrong; they are as long as they should be."""

    fault: Literal["frame_corrupt"] = Field(description="the fault's name")
    wrong_bytes: int = Field(default=64, ge=1, le=_MOST_FRAMES, description="how many bytes of a file are wrong")

    def spoilt(self, file: File, random: Random) -> File:
        """Turn bits over in some of its bytes."""
        content = np.frombuffer(file.content, np.uint8).copy()
        wrong = random.choice(content.size, size=min(self.wrong_bytes, content.size), replace=False)
        content[wrong] ^= random.integers(1, 256, size=wrong.size, dtype=np.uint8)
        return replace(file, content=content.tobytes())


class FrameCut(FileFault):
    """Files that end before the length that was told, and with them the connection."""

    fault: Literal["frame_cut"] = Field(description="the fault's name")
    lost_bytes: int = Field(default=1000, ge=1, le=10**9, description="how many bytes are lost at the end")

    def spoilt(self, file: File, random: Random) -> File:
        """Cut it."""
        return replace(file, content=file.content[: max(0, len(file.content) - self.lost_bytes)])


class FrameWrongSize(ExposureFault):
    """Pictures of half the width and half the height, as of a camera that somebody has set to another region."""

    fault: Literal["frame_wrong_size"] = Field(description="the fault's name")

    def shot(self, camera: Camera, usual: Callable[[Exposure], Picture], exposure: Exposure) -> Picture:
        """Keep the upper left part."""
        picture = usual(exposure)
        rows, columns = picture.counts.shape
        return replace(picture, counts=picture.counts[: rows // 2, : columns // 2])


class FrameStale(ExposureFault):
    """The picture before once more, with its number and its time, instead of a new one."""

    fault: Literal["frame_stale"] = Field(description="the fault's name")

    def shot(self, camera: Camera, usual: Callable[[Exposure], Picture], exposure: Exposure) -> Picture:
        """Take none, unless there has been none."""
        return camera.last or usual(exposure)


class FrameTimeShifted(ExposureFault):
    """Pictures that were taken earlier than they should have been, for example while the arm was still on its way."""

    fault: Literal["frame_time_shifted"] = Field(description="the fault's name")
    early_s: float = Field(default=2.0, gt=0, le=3600, description="how much earlier, in s")

    def shot(self, camera: Camera, usual: Callable[[Exposure], Picture], exposure: Exposure) -> Picture:
        """Take it as the bench was then; its number is the next, and its time the true one."""
        return usual(replace(exposure, start_s=exposure.start_s - self.early_s))


class FrameDropped(ExposureFault):
    """Pictures that are lost in the camera: the number of the next one shows it."""

    fault: Literal["frame_dropped"] = Field(description="the fault's name")

    def shot(self, camera: Camera, usual: Callable[[Exposure], Picture], exposure: Exposure) -> Picture:
        """Count one that nobody sees."""
        camera.count()
        return usual(exposure)


class FrameSaturated(ExposureFault):
    """Pictures with more light than the sensor takes, for example from a lamp in the room."""

    fault: Literal["frame_saturated"] = Field(description="the fault's name")
    share: float = Field(default=1.0, gt=0, le=1, description="which share of the columns, from the left, it falls on")

    def shot(self, camera: Camera, usual: Callable[[Exposure], Picture], exposure: Exposure) -> Picture:
        """Let its light fall on the left side."""
        picture = usual(exposure)
        counts = picture.counts.copy()
        counts[:, : max(1, round(self.share * counts.shape[1]))] = (1 << picture.exposure.bits) - 1
        return replace(picture, counts=counts)


class FrameDark(ExposureFault):
    """Pictures behind a shutter that is stuck."""

    fault: Literal["frame_dark"] = Field(description="the fault's name")

    def shot(self, camera: Camera, usual: Callable[[Exposure], Picture], exposure: Exposure) -> Picture:
        """Expose to the dark."""
        return camera.expose(exposure, None)
