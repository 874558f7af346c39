"""A stand-in for harvesters, as its documentation describes it, with a camera that can be told what to do wrong."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from acquisition.protocols import Camera
from drivers.camera import gentl
from drivers.camera.genicam import GenicamCamera
from drivers.camera.gentl import Library
from drivers.camera.photometer import Photometer
from drivers.camera.region import Region
from goniometer.errors import (
    DeviceFaultError,
    LimitError,
    NotConnectedError,
    ReplyError,
    ReplyTimeoutError,
    SaturatedError,
)

SIZE = (20, 10)


class GenTlError(Exception):
    pass


class Node:
    def __init__(self, value, low=-math.inf, high=math.inf, step=0.0, execute=None):
        self._value, self.min, self.max, self._step, self.execute = value, low, high, step, execute
        self.is_available = True

    @property
    def value(self):
        return self._value

    @value.setter
    def value(self, value):
        if isinstance(value, float) and self._step:
            value = round(value / self._step) * self._step
        if isinstance(value, str) and value not in (
            "Off",
            "On",
            "FrameStart",
            "Software",
            "Continuous",
            "Mono8",
            "Mono12",
        ):
            raise GenTlError(f"{value} is invalid")
        self._value = value


class NodeMap(SimpleNamespace):
    def has_node(self, name):
        return hasattr(self, name)


class Buffer:
    def __init__(self, camera, counts, frame_id, pixel_format, stamp_ns):
        self.camera = camera
        height, width = counts.shape
        component = SimpleNamespace(data=counts.ravel(), width=width, height=height, data_format=pixel_format)
        self.payload = SimpleNamespace(components=[component])
        self.module = SimpleNamespace(frame_id=frame_id, timestamp_ns=stamp_ns)

    def __enter__(self):
        self.camera.held += 1
        return self

    def __exit__(self, *_):
        self.camera.held -= 1
        self.payload.components[0].data[:] = 0  # the library uses its memory again


class FakeCamera:
    """An acquirer, its device info and its harvester in one."""

    vendor, model, serial_number = "Maker", "M1", "0815"

    def __init__(self, *, is_triggered=True):
        self.remote_device = SimpleNamespace(node_map=NodeMap())
        nodes = self.remote_device.node_map
        nodes.ExposureTime = Node(5000.0, 20.0, 1e7, 10.0)
        nodes.Gain, nodes.PixelFormat = Node(0.0, 0.0, 24.0, 0.1), Node("Mono8")
        nodes.Width, nodes.Height, nodes.ExposureAuto = Node(64), Node(48), Node("Continuous")
        if is_triggered:
            nodes.TriggerMode, nodes.TriggerSource, nodes.TriggerSelector = Node("Off"), Node("Line1"), Node("?")
            nodes.TriggerSoftware = Node(None, execute=self._expose)
        self.log, self.queue, self.frame_id, self.held = [], [], 0, 0
        self.counts = np.full(SIZE[::-1], 100, np.uint16)
        self.skip = 0
        self.makes_incomplete = self.is_unplugged = self.is_silent = False
        self.device_info_list = [SimpleNamespace(serial_number="1"), self]

    def add_file(self, path):
        self.log.append("add_file")

    def update(self):
        self.log.append("update")

    def create(self, device):
        assert device is self
        return self

    def destroy(self):
        self.log.append("destroy")
        if self.is_unplugged:
            raise GenTlError("device is gone")

    def reset(self):
        self.log.append("reset")

    def start(self):
        self.log.append("start")
        if not hasattr(self.remote_device.node_map, "TriggerMode"):
            self.frame_id = 0
            self._expose()

    def stop(self):
        self.log.append("stop")
        self.queue.clear()

    def try_fetch(self, *, timeout):
        assert timeout > 0
        if self.is_unplugged:
            raise GenTlError("device is gone")
        if self.makes_incomplete and self.queue:
            self.queue.clear()
            self.tell_incomplete()
            return None
        return self.queue.pop(0) if self.queue else None

    def _expose(self):
        self.log.append("expose")
        self.frame_id += 1 + self.skip
        if not self.is_silent:
            pixel_format = self.remote_device.node_map.PixelFormat.value
            self.queue.append(Buffer(self, self.counts.copy(), self.frame_id, pixel_format, 1000 * self.frame_id))


@pytest.fixture
def fake():
    return FakeCamera()


@pytest.fixture
def make(clock, tmp_path):
    cti = tmp_path / "maker.cti"
    cti.write_bytes(b"")

    def camera(fake, serial_number="0815", path=None, **parameters):
        def on_incomplete(acquirer, function):
            acquirer.tell_incomplete = function

        photometer = Photometer(
            "cam", region=Region(2, 3, 5, 4), watts_per_count_per_s=1e-12, saturation_counts=4095, most_saturated=0.0
        )
        return GenicamCamera(
            path or str(cti),
            serial_number,
            clock,
            photometer,
            load=lambda: Library(lambda: fake, (GenTlError,), on_incomplete, lambda node: node.is_available),
            **{"size": SIZE, "bits": 12} | parameters,
        )

    return camera


def read(camera, clock, exposure_s=0.1):
    camera.start_reading(exposure_s)
    clock.sleep(exposure_s)
    while camera.is_reading():
        clock.sleep(0.05)
    return camera.frame()


def test_set_up_by_hand_and_triggered_by_software(make, fake):
    camera = make(fake, gain_db=6.0)
    assert isinstance(camera, Camera)
    assert camera.connect() == ()
    nodes = fake.remote_device.node_map
    held = {name: getattr(nodes, name).value for name in ("ExposureAuto", "PixelFormat", "Width", "Height", "Gain")}
    assert held == {"ExposureAuto": "Off", "PixelFormat": "Mono12", "Width": 20, "Height": 10, "Gain": 6.0}
    assert (nodes.TriggerMode.value, nodes.TriggerSource.value) == ("On", "Software")
    assert camera.identity == "Maker M1 0815"
    assert "expose" not in fake.log


class BinnedWidth(Node):
    """How many columns there are depends on the binning."""

    def __init__(self, nodes):
        super().__init__(8)
        self.nodes = nodes

    @property
    def value(self):
        return self._value

    @value.setter
    def value(self, value):
        if value > 20 // self.nodes.BinningHorizontal.value:
            raise GenTlError(f"{value} columns are too many")
        self._value = value


def test_what_a_viewer_has_left_on_is_taken_back(make, fake):
    nodes = fake.remote_device.node_map
    left = {"GammaEnable": True, "LUTEnable": True, "ReverseX": True, "ReverseY": True}
    left |= {"BinningHorizontal": 2, "BinningVertical": 2, "DecimationHorizontal": 2, "DecimationVertical": 4}
    for name, value in left.items():
        setattr(nodes, name, Node(value))
    nodes.Gamma, nodes.Width = Node(0.45), BinnedWidth(nodes)
    make(fake).connect()
    held = {name: getattr(nodes, name).value for name in left}
    assert held == {name: False if value is True else 1 for name, value in left.items()}
    assert nodes.Gamma.value == 0.45, "it is switched off"
    del nodes.GammaEnable
    make(fake).connect()
    assert nodes.Gamma.value == 1.0


def test_what_a_camera_has_in_name_only_is_left_alone(make, fake):
    class Nameless(Node):
        @property
        def value(self):
            raise GenTlError("node is not implemented")

    nodes = fake.remote_device.node_map
    for name in ("GammaEnable", "BlackLevelAuto"):
        setattr(nodes, name, Nameless(None))
        getattr(nodes, name).is_available = False
    make(fake).connect()


def test_what_cannot_be_taken_back_is_an_error(make, fake):
    class Fixed(Node):
        @property
        def value(self):
            return True

        @value.setter
        def value(self, value):
            raise GenTlError("node is not writable")

    fake.remote_device.node_map.ReverseX = Fixed(True)
    with pytest.raises(
        DeviceFaultError, match=r"did not take ReverseX = False: node is not writable.* maker's software"
    ):
        make(fake).connect()


def test_a_reading_is_one_picture_begun_by_the_trigger(make, fake, clock):
    camera = make(fake)
    camera.connect()
    clock.time_s = 5.0
    fake.counts[3:7, 2:7] = 400
    camera.start_reading(0.2)
    assert fake.log.count("expose") == 1
    clock.time_s = 5.19
    assert camera.is_reading()
    assert camera.is_exposing()
    clock.time_s = 5.2
    assert not camera.is_reading()
    frame = camera.frame()
    assert_array_equal(frame.counts, fake.counts)
    assert (frame.bits, frame.exposure_s, frame.time_s, frame.number) == (12, 0.2, 5.0, 1)
    assert camera.read().mean_counts == 400
    assert camera.power_w() == pytest.approx(400 / 0.2 * 1e-12)
    assert fake.held == 0


def test_warm_up(make, fake, clock):
    camera = make(fake, warm_up_frames=3)
    camera.connect()
    assert fake.log.count("expose") == 3
    with pytest.raises(ReplyError, match="no finished reading"):
        camera.frame()


def test_camera_without_a_trigger_runs_only_during_a_reading(make, clock):
    fake = FakeCamera(is_triggered=False)
    camera = make(fake)
    camera.connect()
    for _ in range(2):
        fake.log.clear()
        read(camera, clock)
        assert fake.log == ["start", "expose", "stop"]


def test_reading_that_was_given_up_is_not_taken_for_the_next(make, fake, clock):
    camera = make(fake)
    camera.connect()
    camera.start_reading(0.5)
    fake.counts[:] = 7
    assert read(camera, clock).counts.max() == 7


@pytest.mark.parametrize("fault", ["skip", "makes_incomplete"])
def test_lost_picture_is_taken_again_twice(make, fake, clock, fault):
    camera = make(fake)
    camera.connect()
    read(camera, clock)
    setattr(fake, fault, 1)
    camera.start_reading(0.1)
    for attempt in range(2):
        clock.sleep(0.1)
        assert camera.is_reading()
        assert camera.dropped_frames == attempt + 1
    clock.sleep(0.1)
    with pytest.raises(DeviceFaultError, match="lost or came incomplete in each of 3 attempts"):
        camera.is_reading()
    assert fake.held == 0
    setattr(fake, fault, 0)
    assert read(camera, clock).counts.max() == 100


def test_saturated(make, fake, clock):
    camera = make(fake)
    camera.connect()
    fake.counts[4, 4] = 4095
    read(camera, clock)
    with pytest.raises(SaturatedError, match="1 of the region's 20 pixels have 4095 counts"):
        camera.power_w()


@pytest.mark.parametrize(
    ("counts", "words"),
    [
        (np.full((10, 20), 4096, np.uint16), "a picture of 4096 counts came, where the camera was set to 4095 at most"),
        (np.full((5, 20), 1, np.uint16), "a picture of 20 x 5 pixels in Mono12 came"),
    ],
)
def test_picture_that_the_camera_was_not_set_to(make, fake, clock, counts, words):
    camera = make(fake)
    camera.connect()
    fake.counts = counts
    with pytest.raises(DeviceFaultError, match=words):
        read(camera, clock)


def test_padded_lines_are_refused(make, fake, clock):
    camera = make(fake)
    camera.connect()
    camera.start_reading(0.1)
    fake.queue[0].payload.components[0].data = np.zeros(24 * 10, np.uint16)
    clock.sleep(0.1)
    with pytest.raises(DeviceFaultError, match="a picture of 20 x 10 pixels came with 240 values"):
        camera.is_reading()


@pytest.mark.parametrize("exposure_s", [0.0, 11.0, math.nan])
def test_impossible_exposure(make, fake, exposure_s):
    camera = make(fake)
    camera.connect()
    with pytest.raises(LimitError, match="is not between 2e-05 and 10 s"):
        camera.start_reading(exposure_s)
    assert "expose" not in fake.log


def test_exposure_that_the_camera_rounds(make, fake, clock):
    camera = make(fake)
    camera.connect()
    assert read(camera, clock, 0.010004).exposure_s == pytest.approx(0.01)
    with pytest.raises(LimitError, match=r"the camera made 3e-05 s of an exposure of 2\.6e-05 s"):
        camera.start_reading(2.6e-5)


@pytest.mark.usefixtures("no_real_grace")
def test_picture_that_does_not_come(make, fake, clock):
    camera = make(fake)
    camera.connect()
    fake.is_silent = True
    camera.start_reading(1.0)
    clock.sleep(6.9)
    assert camera.is_reading()
    clock.sleep(0.2)
    with pytest.raises(ReplyTimeoutError, match="has not come in more than twice the time"):
        camera.is_reading()


def test_unplugged_and_plugged_in_again(make, fake, clock):
    camera = make(fake)
    camera.connect()
    camera.start_reading(0.1)
    clock.sleep(0.1)
    fake.is_unplugged = True
    with pytest.raises(NotConnectedError, match="transport library says: device is gone"):
        camera.is_reading()
    camera.close()
    assert fake.log[-2:] == ["destroy", "reset"]
    fake.is_unplugged = False
    camera.reconnect()
    camera.connect()
    assert read(camera, clock).counts.max() == 100
    fake.model = "M2"
    camera.reconnect()
    with pytest.raises(DeviceFaultError, match="another device answers since the link was lost: 'Maker M2 0815'"):
        camera.connect()


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({"bits": 16}, "the camera did not take PixelFormat = Mono16: Mono16 is invalid"),
        ({"gain_db": 6.17}, r"the camera did not take Gain = 6\.17: it holds 6\.2"),
    ],
)
def test_setting_that_the_camera_does_not_have(make, fake, parameters, words):
    with pytest.raises(DeviceFaultError, match=words):
        make(fake, **parameters).connect()


def test_gain_of_a_camera_without_one(make, fake):
    del fake.remote_device.node_map.Gain
    make(fake).connect()
    with pytest.raises(DeviceFaultError, match="the camera has no Gain"):
        make(fake, gain_db=3.0).connect()


def test_other_cameras_are_named(make, fake):
    with pytest.raises(NotConnectedError, match="no camera has the serial number 4711; there are 1, 0815"):
        make(fake, serial_number="4711").connect()
    assert fake.log[-1] == "reset"


def test_no_transport_library(make, fake):
    with pytest.raises(NotConnectedError, match=r"there is no transport library /nowhere/x\.cti"):
        make(fake, path="/nowhere/x.cti").connect()


def test_harvesters_not_installed(tmp_path, monkeypatch):
    def import_module(name):
        raise ModuleNotFoundError(name)

    monkeypatch.setattr(gentl, "import_module", import_module)
    (tmp_path / "maker.cti").write_bytes(b"")
    with pytest.raises(NotConnectedError, match=r"not installed.*pip install 'goniometer\[genicam\]'"):
        gentl.GentlCamera("cam", str(tmp_path / "maker.cti"), "0815")
