"""The real harvesters with `viky`, the producer without hardware that its genicam package brings.

It has no exposure and no gain, so these two features are added to those that it has; all else is its own.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from drivers.camera.genicam import GenicamCamera
from drivers.camera.gentl import GentlCamera
from drivers.camera.photometer import Photometer
from drivers.camera.region import Region
from drivers.clock import WallClock
from goniometer.errors import DeviceFaultError, NotConnectedError, ReplyTimeoutError

genicam = pytest.importorskip("genicam")
pytest.importorskip("harvesters")

PRODUCER = Path(genicam.__file__).with_name("viky.cti")
pytestmark = pytest.mark.skipif(not PRODUCER.is_file(), reason="this genicam package brings no producer")


class Exposure:
    min, max, value = 1.0, 1e7, 1000.0


@pytest.fixture
def make(monkeypatch):
    real_node, real_has = GentlCamera._node, GentlCamera.has
    monkeypatch.setattr(
        GentlCamera, "_node", lambda camera, name: Exposure if name == "ExposureTime" else real_node(camera, name)
    )
    monkeypatch.setattr(GentlCamera, "has", lambda camera, name: name == "ExposureTime" or real_has(camera, name))
    cameras = []

    def camera(serial_number="1", **parameters):
        photometer = Photometer(
            "cam", region=Region(0, 0, 120, 100), watts_per_count_per_s=1e-12, saturation_counts=256, most_saturated=0.0
        )
        cameras.append(
            GenicamCamera(
                str(PRODUCER), serial_number, WallClock(), photometer, **{"size": (120, 100), "bits": 8} | parameters
            )
        )
        return cameras[-1]

    yield camera
    for each in cameras:
        each.close()


def read(camera, until, exposure_s=0.001):
    camera.start_reading(exposure_s)
    until(lambda: not camera.is_reading())
    return camera.frame()


def test_pictures_one_after_the_other(make, until):
    camera = make(warm_up_frames=1)
    camera.connect()
    assert camera.identity == "Machine Vision Games Ltd. Viky 1"
    pictures = [read(camera, until) for _ in range(3)]
    assert {picture.counts.shape for picture in pictures} == {(100, 120)}
    assert all(picture.counts.max() <= 255 and picture.counts.std() > 0 for picture in pictures)
    assert camera.power_w() == pytest.approx(pictures[-1].counts.mean() / 0.001 * 1e-12)
    assert camera.dropped_frames == 0


def test_opened_again(make, until):
    camera = make()
    camera.connect()
    read(camera, until)
    camera.reconnect()
    camera.connect()
    assert read(camera, until).counts.shape == (100, 120)


def test_two_at_a_time_are_refused_and_let_go(make, until):
    first, second = make(), make()
    first.connect()
    with pytest.raises(
        NotConnectedError, match=r"no camera has the serial number 1; there are none.*another program uses it"
    ):
        second.connect()
    first.close()
    second.connect()
    assert read(second, until).counts.shape == (100, 120)


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({"bits": 12}, "did not take PixelFormat = Mono12"),
        ({"size": (10, 100)}, r"did not take Width = 10: .*Min = 100"),
        ({"gain_db": 1.0}, "the camera has no Gain"),
        ({"serial_number": "9"}, "no camera has the serial number 9; there are 0, 1, 2"),
    ],
)
def test_what_it_is_refused(make, parameters, words):
    camera = make(**parameters)
    with pytest.raises((DeviceFaultError, NotConnectedError), match=words):
        camera.connect()


def test_no_picture_in_time(make, until, monkeypatch):
    monkeypatch.setattr("drivers.camera.genicam._TRANSFER_S", 0.0)
    camera = make()
    camera.connect()
    camera._opened().set("AcquisitionFrameRate", 1.0)
    camera.start_reading(0.01)
    with pytest.raises(ReplyTimeoutError, match="has not come in more than twice the time"):
        until(lambda: not camera.is_reading())
