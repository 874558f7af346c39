"""A simulated camera before an even light, and a bench with one."""

import numpy as np
import pytest

from sim_devices.camera.camera import Camera
from sim_devices.camera.exposure import Means
from sim_devices.camera.http import HttpCamera
from sim_devices.camera.sensor import Sensor, SensorParts

JOULES_PER_COUNT = 1e-15


class EvenLight:
    """100 000 counts a second on each pixel until 100 s, and nothing from then on; it notes when it is looked at."""

    def __init__(self, height=24, width=32):
        self._power_w = np.full((height, width), 1e5 * JOULES_PER_COUNT)
        self.middles_s = []

    def power_w(self, moment):
        self.middles_s.append(moment.middle_s)
        return self._power_w if moment.middle_s < 100 else None


@pytest.fixture
def light():
    """An even light."""
    return EvenLight()


@pytest.fixture
def device(light):
    """A camera of 32 by 24 pixels before the even light."""
    sensor = Sensor(SensorParts(dark_counts=10.0), 24, 32, JOULES_PER_COUNT, seed=1)
    camera = Camera(
        light, sensor, height=24, width=32, means=Means((8, 12, 16)), readout_s=0.03, frame_s=0.05, zero_s=500.0
    )
    return HttpCamera(camera, "SC000001")


CAMERA = {
    "type": "http_camera",
    "width_px": 48,
    "height_px": 36,
    "focal_px": 60.0,
    "distance_mm": 100.0,
    "acceptance_sr": 1e-3,
    "pixel_share": 1e-4,
    "joules_per_count": 1e-15,
}


@pytest.fixture
def camera_scene(scene_document, scene_with):
    """Make a scene whose detector is a camera, with some of its parts replaced, and keys of the camera."""

    def make(camera=None, devices=None, **parts):
        held = {name: entry for name, entry in scene_document["devices"].items() if name != "meter"}
        held |= {"camera": CAMERA | (camera or {}), **(devices or {})}
        return scene_with(**({"plate": {"size_mm": [60, 40]}, "devices": held} | parts))

    return make
