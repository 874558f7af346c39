"""Devices, with a stand-in for OpenCV's `VideoCapture`: what it is told, and how its dates are used."""

from __future__ import annotations

import queue

import cv2
import numpy as np
import pytest
from numpy.testing import assert_array_equal

from goniometer.errors import DeviceFaultError, NotConnectedError


class Video:
    """A webcam that dates its pictures, and takes only the settings that it has."""

    def __init__(self, *opened):
        self.opened = opened
        self.held = {
            cv2.CAP_PROP_FRAME_WIDTH: 640.0,
            cv2.CAP_PROP_FRAME_HEIGHT: 480.0,
            cv2.CAP_PROP_EXPOSURE: 156.0,
            cv2.CAP_PROP_FPS: 10.0,
        }
        self.told = []
        self.pictures = queue.SimpleQueue()
        self.released = False

    def isOpened(self):
        return self.opened != (7,)

    def get(self, setting):
        return self.held.get(setting, 0.0)

    def set(self, setting, value):
        self.told.append(setting)
        self.held[setting] = value if setting in self.held else 0.0
        return True  # as many backends say, whatever they did

    def read(self):
        picture, self.held[cv2.CAP_PROP_POS_MSEC] = self.pictures.get()
        return picture is not None, picture

    def release(self):
        self.released = True


@pytest.fixture
def videos_opened(monkeypatch):
    opened = []

    def open_video(*parameters):
        opened.append(Video(*parameters))
        return opened[-1]

    monkeypatch.setattr(cv2, "VideoCapture", open_video)
    yield opened
    for video in opened:
        video.pictures.put((None, 0.0))


SIZE = {"frame_width": 64, "frame_height": 48}


@pytest.mark.parametrize(("address", "opened"), [("0", (0,)), ("/dev/video2", ("/dev/video2",))])
def test_opened_by_number_or_path_and_set_size_first(make_camera, videos_opened, address, opened):
    make_camera(address, settings={"exposure": 200, **SIZE}).connect()
    (video,) = videos_opened
    assert video.opened == opened
    assert video.told == [cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT, cv2.CAP_PROP_EXPOSURE]


def test_what_the_camera_did_not_take_is_a_fault(make_camera, videos_opened):
    camera = make_camera("0", settings={"gain": 3.0, "exposure": 20, **SIZE})
    with pytest.raises(DeviceFaultError, match=r"did not take its settings: gain is 0 and not 3\. Not done"):
        camera.connect()
    assert videos_opened[0].released
    with pytest.raises(NotConnectedError, match="not open"):
        camera.start_reading(0.1)


def test_device_that_is_not_there(make_camera, videos_opened):
    with pytest.raises(NotConnectedError, match="cannot open 7 as a video"):
        make_camera("7").connect()


def test_pictures_that_waited_in_a_buffer_are_too_old(make_camera, videos_opened, clock, until, videos):
    camera = make_camera("0", settings=SIZE)
    camera.connect()
    (video,) = videos_opened

    def arrive(at_s, *dated):
        clock.time_s = at_s
        before = camera.frames
        for number in dated:
            video.pictures.put((videos.noise(50, number), 500_000 + 100.0 * number))
        until(lambda: camera.frames == before + len(dated))

    arrive(1.0, 0)
    arrive(1.1, 1)
    clock.time_s = 1.45
    camera.start_reading(0.1)
    arrive(1.6, 2, 3, 4, 5, 6)  # the computer was busy: those up to number 5 were begun before 1.45 s
    assert not camera.is_reading()
    assert_array_equal(camera.frame().counts, videos.noise(50, 6) * np.uint16(257))
    assert camera.frame().time_s == pytest.approx(1.5)
    assert camera.dropped_frames == 0


class Ticking:
    """A picture every 0.25 s, as fast as the computer can."""

    def __init__(self, clock, noise):
        self.clock, self.noise, self.number, self.has_ended = clock, noise, 0, False

    def get(self):
        self.number += 1
        self.clock.time_s = 0.25 * self.number
        return None if self.has_ended else self.noise(50, self.number), 250.0 * self.number

    def put(self, _):
        self.has_ended = True


def test_warm_up_of_another_rate(make_camera, videos_opened, clock, videos, monkeypatch):
    def ticking(*parameters):
        videos_opened.append(Video(*parameters))
        videos_opened[-1].pictures = Ticking(clock, videos.noise)
        return videos_opened[-1]

    monkeypatch.setattr(cv2, "VideoCapture", ticking)
    camera = make_camera("0", settings=SIZE, warm_up_frames=8)
    with pytest.raises(DeviceFaultError, match=r"every 0\.25 s, where .* sample_s: 0\.1; \d+ more seem to be missing"):
        camera.connect()


def test_pictures_of_more_bits_are_refused(make_camera, videos_opened, until):
    camera = make_camera("0", settings=SIZE)
    camera.connect()
    camera.start_reading(0.1)
    videos_opened[0].pictures.put((np.zeros((48, 64), np.uint16), 0.0))
    with pytest.raises(DeviceFaultError, match="its pictures are of uint16, not of 8 bits"):
        until(lambda: not camera.is_reading())


def test_unplugged(make_camera, videos_opened, until):
    camera = make_camera("/dev/video0", settings=SIZE)
    camera.connect()
    camera.start_reading(0.1)
    videos_opened[0].pictures.put((None, 0.0))
    with pytest.raises(NotConnectedError, match="cam: /dev/video0 gives no more pictures"):
        until(lambda: not camera.is_reading())
    until(lambda: videos_opened[0].released)
