"""A camera that serves pictures over HTTP, on the bench."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from pydantic import Field, model_validator

from goniometer.errors import ConfigurationError
from sim_devices.bench_devices.entry import SimulatedDevice
from sim_devices.camera.optics import AnyOptics
from sim_devices.camera.plate import Plate
from sim_devices.camera.sensor import SensorParts
from sim_devices.camera.view import View
from sim_devices.device import Device
from sim_devices.effects.entry import Effect
from sim_devices.effects.measurement import seeded

if TYPE_CHECKING:
    from sim_devices.world import World

_Pixels = Annotated[int, Field(ge=8, le=4096)]
_Coefficient = Annotated[float, Field(ge=-10, le=10)]

_SENSORS = {
    "shot_noise": "electrons_per_count",
    "read_noise": "read_counts",
    "dark_current": "dark_counts and dark_counts_per_s",
    "nonlinearity": "nonlinearity",
}
"""What a camera's sensor has instead of an effect of the detector."""

_OF_FILES = "quantisation", "saturation"
_CONES = "acceptance_cone", "source_cone"


class HttpCameraDevice(SimulatedDevice):
    """A camera on the detector arm, behind the analyzer; it sees the scene's `plate`."""

    part: ClassVar[str] = "detector"

    type: Literal["http_camera"] = Field(description="the device's family")
    width_px: _Pixels = Field(description="columns of pixels")
    height_px: _Pixels = Field(description="rows of pixels")
    bits: Annotated[tuple[Literal[8, 10, 12, 14, 16], ...], Field(strict=False, min_length=1)] = Field(
        default=(8, 12, 16), description="depths in which it can be asked for stills; the last one is the usual"
    )
    focal_px: float = Field(gt=0, le=1e6, description="focal length over the size of a pixel")
    centre_px: Annotated[tuple[float, float], Field(strict=False)] | None = Field(
        default=None,
        description="where the optical axis meets the picture, column and row; the middle if not given. Whole numbers "
        "are centres of pixels",
    )
    distortion: Annotated[
        tuple[_Coefficient, _Coefficient, _Coefficient, _Coefficient, _Coefficient], Field(strict=False)
    ] = Field(default=(0.0, 0.0, 0.0, 0.0, 0.0), description="k1, k2, p1, p2, k3, as OpenCV has them")
    distance_mm: float = Field(gt=0, le=1e5, description="from its projection centre to the middle of the plate")
    acceptance_sr: float = Field(gt=0, le=0.1, description="solid angle of its aperture, in sr")
    pixel_share: float = Field(
        gt=0,
        le=1,
        description="share of the beam that falls, at normal incidence, on what one pixel sees from straight above",
    )
    joules_per_count: float = Field(
        gt=0, le=1, description="energy on a pixel for each count at a gain of 0 dB, whatever the bits"
    )
    readout_s: float = Field(default=0.03, ge=0, le=10, description="from the end of an exposure to its file")
    frame_s: float = Field(default=0.05, ge=1e-3, le=60, description="from frame to frame of the film")
    lens: Annotated[tuple[AnyOptics, ...], Field(strict=False)] = Field(
        default=(), description="what lens and polarizer do to pictures; without it they are sharp"
    )
    sensor: SensorParts = Field(
        default=SensorParts(), description="what the sensor does beside counting; without it it is ideal"
    )

    @model_validator(mode="after")
    def _can_be_made(self) -> HttpCameraDevice:
        pixels = self.width_px * self.height_px
        for name in ("hot_pixels", "dead_pixels"):
            if (getattr(self.sensor, name) or 0) > pixels:
                raise ValueError(f"sensor: {name} is {getattr(self.sensor, name)}, and the sensor has {pixels} pixels")
        if list(self.bits) != sorted(set(self.bits)):
            raise ValueError("bits are given once each, in rising order")
        self.view()
        return self

    @property
    def scheme(self) -> str:
        """How its port is addressed over TCP."""
        return "http"

    def view(self) -> View:
        """Where it looks."""
        centre_px = self.centre_px or ((self.width_px - 1) / 2, (self.height_px - 1) / 2)
        return _view(self.width_px, self.height_px, self.focal_px, centre_px, self.distance_mm, self.distortion)

    def install(self, world: World) -> Device:
        """Put the camera at the end of the beam."""
        try:
            from sim_devices.camera.camera import Camera
            from sim_devices.camera.exposure import Means
            from sim_devices.camera.http import HttpCamera
            from sim_devices.camera.light import PlateLight
            from sim_devices.camera.sensor import Sensor
        except ImportError as error:
            raise ConfigurationError(
                [
                    f"The scene has a camera, and {error.name} is not installed. Nothing was started. "
                    "Run: pip install 'goniometer[camera]'."
                ]
            ) from error
        scene = world.scene
        world.acceptance_sr = self.acceptance_sr
        light = PlateLight(world, self.view(), self.lens, self.pixel_share)
        world.when_whole.append(light.look)
        camera = Camera(
            light,
            Sensor(self.sensor, self.height_px, self.width_px, self.joules_per_count, scene.seed),
            height=self.height_px,
            width=self.width_px,
            means=Means(self.bits),
            readout_s=self.readout_s,
            frame_s=self.frame_s,
            zero_s=round(float(seeded(scene.seed, 0, "clock of the camera").uniform(10.0, 1e5)), 3),
        )
        return HttpCamera(camera, serial=f"SC{scene.seed:06d}")


@lru_cache(maxsize=1)
def _view(*about: Any) -> View:
    """The rays of all pixels of a large camera take a second, and are asked for by each check of the files."""
    return View(*about)


def camera_faults(
    devices: Collection[SimulatedDevice], plate: Plate | None, effects: Sequence[Effect]
) -> Iterator[str]:
    """What keeps a bench from having its camera, or its plate without one."""
    if not any(isinstance(device, HttpCameraDevice) for device in devices):
        if plate is not None:
            yield "the scene has a plate, which only a camera sees; add a device of type http_camera, or leave it out"
        return
    if plate is None:
        yield "a camera needs a plate to look at; give for example plate: {size_mm: [60, 40]}"
    if any(device.part == "generator" for device in devices):
        yield "a camera cannot be simulated with a generator; use a detector that sees the whole spot"
    if any("detector_azimuth" in device.roles() for device in devices):
        yield "a camera cannot be simulated out of the plane of incidence; leave detector_azimuth out"
    for effect in effects:
        if (key := _SENSORS.get(effect.effect)) is not None:
            yield f"the effect {effect.effect} is one of a detector without pixels; name {key} in the camera's sensor"
        elif effect.effect in _OF_FILES:
            yield f"a camera's bits do what the effect {effect.effect} does to other detectors: leave it out"
        elif effect.effect in _CONES:
            yield f"{effect.effect} is not simulated for a camera, of which a pixel sees one direction: leave it out"
