"""Cameras that OpenCV opens as a video, in a rig file."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Annotated, ClassVar, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from acquisition.detector_noise import NoiseModel
from acquisition.imaging.light.video_noise import video_noise
from acquisition.section import SectionFault, refuse_all
from acquisition.timing import DetectorTiming
from goniometer.rig_devices.camera import CameraEntry
from goniometer.rig_devices.connecting import Connecting

_DEVICE = re.compile(r"\d{1,3}|/dev/\S+")
_STREAM = re.compile(r"(https?|rtsp)://[^/\s]\S*")
_NO_FILE = re.compile(r"\s*|COM\d+|[A-Za-z][\w+.-]+:.*")  # a drive of Windows has one letter


def _check_video(port: str) -> str:
    if port == "simulated":
        raise ValueError(
            "got 'simulated'; allowed: the http:// address of the simulated camera's stream, at the port that "
            "goniometer simulate prints, because a video is opened by its address"
        )
    if not (_DEVICE.fullmatch(port) or _STREAM.fullmatch(port)) and _NO_FILE.fullmatch(port):
        raise ValueError(
            f"got {port!r}; allowed: a camera's number in quotes such as '0', /dev/video0, http:// or rtsp:// and the "
            "address of a stream, or the path of a video file"
        )
    return port


class VideoCameraEntry(CameraEntry):
    """Webcam, network stream or video file, through OpenCV; a reading is the mean of whole pictures of 8 bits."""

    averages_evenly = False  # it begins with the next picture
    to_dim = (
        "have the camera expose each picture for less, or with less gain (settings in the rig file, or at the camera)"
    )
    opened_by: ClassVar[str] = "OpenCV"
    driver: Literal["video_camera"] = Field(description="the device's family")
    port: Annotated[str, AfterValidator(_check_video)] = Field(
        description="a camera's number in quotes such as '0', /dev/video0, the http:// or rtsp:// address of a stream, "
        "or the path of a video file that stands for a camera"
    )
    sample_s: float = Field(gt=0, le=10, description="time from one picture to the next, in s")
    bits: Literal[16] = Field(
        default=16, description="of the mean of pictures of 8 bits: each of their counts makes 257 of it"
    )
    warm_up_frames: int = Field(
        default=10, ge=1, le=1000, description="pictures that are thrown away when it is connected; none of a file"
    )
    settings: Mapping[Literal["frames_per_s", "auto_exposure", "exposure", "gain"], float] = Field(
        default={}, description="what OpenCV is to set in the camera, in the units of the camera's own driver"
    )
    channel: Literal["red", "green", "blue", "gray"] | None = Field(
        default=None, description="what is taken of pictures in colours, which are refused if it is left out"
    )
    most_identical_frames: int = Field(
        default=25,
        ge=0,
        le=100_000,
        description="so many pictures of a camera may be the same bit for bit before it counts as frozen; 0 for any",
    )
    silence_s: float = Field(default=5.0, ge=0.1, le=60, description="how long a stream may be silent, in s")

    @model_validator(mode="after")
    def _check_settings(self) -> Self:
        refuse_all(self._setting_faults())
        return self

    def _setting_faults(self) -> Iterator[SectionFault]:
        if self.settings and not _DEVICE.fullmatch(self.port):
            yield (
                ("settings",),
                f"names {', '.join(sorted(self.settings))}, but only a camera has settings, no stream and no file",
            )

    @property
    def timing(self) -> DetectorTiming:
        """A reading begins with the next picture, at most as much later as one lasts."""
        return DetectorTiming(super().timing.overhead_s + self.sample_s)

    def noise_model(self, wavelength_nm: float) -> NoiseModel:
        """The noise of the region's mean over whole pictures."""
        pixels = self.region.width * self.region.height
        return video_noise(self.sensor.noise, self.watts_per_count_per_s, pixels, wavelength_nm, self.sample_s)

    def connect(self, name: str, bench: Connecting) -> None:
        """Open the video."""
        from drivers.camera.installed import camera_package

        camera_package("cv2")
        from drivers.camera.capture import Kind, kind_of
        from drivers.camera.video import VideoCamera

        address = bench.ports[name]
        kind = kind_of(address)
        size: dict[str, float] = (
            {"frame_width": self.width_px, "frame_height": self.height_px} if kind is Kind.DEVICE else {}
        )
        camera = VideoCamera(
            address,
            bench.clock,
            self.photometer(name),
            size=(self.width_px, self.height_px),
            frame_s=self.sample_s,
            latency_s=self.readout_s,
            gain_db=self.gain_db,
            settings=size | dict(self.settings),
            channel=self.channel,
            warm_up_frames=0 if kind is Kind.FILE else self.warm_up_frames,
            most_identical=self.most_identical_frames,
            timeout_s=self.silence_s,
        )
        bench.add(name, camera)
        bench.detectors[name] = camera
