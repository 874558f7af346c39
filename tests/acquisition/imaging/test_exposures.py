"""A reading in several exposures: which are taken, when the light is over, and which one the power comes from."""

from dataclasses import replace

import numpy as np
import pytest

from acquisition.imaging.exposures import Exposures
from acquisition.protocols import Detector, TakesFrames
from drivers.camera.frame import Frame
from drivers.camera.region import Region
from goniometer.errors import LimitError, ReplyError, SaturatedError


class StandInCamera:
    """A camera in a world of even light: counts = light x exposure up to 1000, ready a few looks later."""

    name = "camera"

    def __init__(self, light):
        self.light, self.asked_s, self.looks, self.now = light, [], 0, None

    def connect(self):
        return ()

    def reconnect(self):
        self.now = None

    def start_reading(self, exposure_s):
        if exposure_s > 10:
            raise LimitError("camera", "too long", not_done="nothing", to_do="less")
        self.asked_s.append(exposure_s)
        self.looks = 0
        counts = np.full((4, 5), min(round(self.light * exposure_s), 1000), np.uint16)
        self.now = Frame(counts, 10, exposure_s, 0.0, float(len(self.asked_s)), len(self.asked_s))

    def is_exposing(self):
        self.looks += 1
        return self.looks < 2

    def is_reading(self):
        self.looks += 1
        return self.looks < 4

    def read(self):
        return Region(0, 0, 5, 4).mean(self.frame(), saturation_counts=1001)

    def power_w(self):
        if self.read().mean_counts >= 1000:
            raise SaturatedError(
                "camera", f"saturated at {self.now.exposure_s:g} s", not_done="none", to_do="less light"
            )
        return self.read().mean_counts / self.now.exposure_s

    def frame(self):
        if self.now is None or self.looks < 4:
            raise ReplyError("camera", "there is no finished reading", not_done="nothing", to_do="begin one")
        return self.now


def taken(light, ratios=(1.0, 0.1, 0.01)):
    camera = StandInCamera(light)
    exposures = Exposures(camera, ratios)
    assert isinstance(exposures, TakesFrames)
    exposures.start_reading(2.0)
    looks = 0
    while exposures.is_exposing():
        looks += 1
        assert looks < 50
    assert len(camera.asked_s) == len(ratios), "the bench may only leave when the last exposure has its light"
    while exposures.is_reading():
        looks += 1
    return camera, exposures


def test_every_exposure_is_taken_once_the_longest_first():
    camera, exposures = taken(light=100.0)
    np.testing.assert_allclose(camera.asked_s, [2.0, 0.2, 0.02])
    assert [frame.exposure_s for frame in exposures.frames()] == camera.asked_s
    assert (exposures.power_w(), exposures.used_s) == (100.0, 2.0)


def test_the_power_comes_from_the_longest_exposure_that_is_not_saturated():
    _, exposures = taken(light=3000.0)
    assert (exposures.power_w(), exposures.used_s) == (3000.0, 0.2)
    assert len(exposures.frames()) == 3


def test_a_reading_whose_shortest_exposure_is_saturated_says_so_and_keeps_its_pictures():
    _, exposures = taken(light=60000.0)
    with pytest.raises(SaturatedError, match=r"saturated at 0\.02 s"):
        exposures.power_w()
    assert len(exposures.frames()) == 3


def test_a_reading_has_nothing_of_the_one_before():
    _, exposures = taken(light=3000.0)
    exposures.start_reading(2.0)
    with pytest.raises(ReplyError, match="no finished reading"):
        exposures.power_w()
    assert exposures.frames() == ()


def test_one_exposure_is_the_camera_itself():
    camera, exposures = taken(light=7.0, ratios=(1.0,))
    assert camera.asked_s == [2.0]
    assert exposures.power_w() == 7.0


def test_a_mean_of_pictures_was_exposed_for_all_of_them():
    camera, exposures = taken(light=7.0, ratios=(1.0,))
    exposures.start_reading(0.5)
    camera.now = replace(camera.now, averaged=4)
    while exposures.is_reading():
        pass
    assert exposures.power_w() == 8.0  # 4 counts: 3.5 are rounded
    assert exposures.used_s == 2.0


def test_an_exposure_that_cannot_be_is_refused_before_anything_is_begun():
    exposures: Detector = Exposures(StandInCamera(1.0))
    with pytest.raises(LimitError, match="too long"):
        exposures.start_reading(11.0)
