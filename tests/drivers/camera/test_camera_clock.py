from __future__ import annotations

import random

import pytest

from drivers.camera.camera_clock import TOLERANCE_S, CameraClock

EXPOSURE_S = 0.1


class Pictures:
    """Pictures of a camera whose clock has an offset and runs too fast, with delays of every kind."""

    def __init__(self, drift, seed=1):
        self.clock, self.random = CameraClock(), random.Random(seed)
        self.now_s, self.drift, self.begun_s = 50.0, drift, 0.0

    def take(self, shift_s=0.0, *, learn=True):
        self.now_s += self.random.uniform(0.1, 30.0)
        self.begun_s = self.now_s + self.random.uniform(0.001, 0.02)
        answered_s = self.begun_s + EXPOSURE_S + self.random.uniform(0.002, 0.05)
        start_s = 777.0 + self.begun_s * (1 + self.drift) + shift_s
        times = {"asked_s": self.now_s, "answered_s": answered_s}
        off_by_s = self.clock.off_by_s(start_s, EXPOSURE_S, **times)
        if learn and not off_by_s:
            self.clock.learn(start_s, EXPOSURE_S, **times)
        return start_s, off_by_s


@pytest.mark.parametrize("drift", [0.0, 5e-5, -9e-5])
def test_no_honest_picture_is_refused_and_its_time_is_known(drift):
    pictures = Pictures(drift)
    for _ in range(3000):
        start_s, off_by_s = pictures.take()
        assert off_by_s == 0.0
        assert abs(pictures.clock.on_bench_s(start_s) - pictures.begun_s) < 0.03


@pytest.mark.parametrize("drift", [0.0, 9e-5])
@pytest.mark.parametrize("shift_s", [-0.2, 0.2, -5.0, 3600.0])
def test_a_picture_of_another_moment_is_refused_by_how_much_it_is_off(drift, shift_s):
    pictures = Pictures(drift)
    for _ in range(200):
        pictures.take()
        _, off_by_s = pictures.take(shift_s, learn=False)
        assert off_by_s == pytest.approx(shift_s, abs=0.07)


def test_a_shift_within_the_tolerance_passes():
    clock = CameraClock()
    clock.learn(10.0, 0.1, asked_s=0.0, answered_s=0.1)
    for shift_s, off_by_s in ((0.9, 0.0), (-0.9, 0.0), (1.1, 1.1), (-1.1, -1.1)):
        found = clock.off_by_s(10.0 + shift_s * TOLERANCE_S, 0.1, asked_s=0.0, answered_s=0.1)
        assert found == pytest.approx(off_by_s * TOLERANCE_S, abs=1e-12)


def test_of_a_clock_that_nothing_is_known_of_anything_is_taken():
    assert CameraClock().off_by_s(1e9, 0.1, asked_s=0.0, answered_s=0.1) == 0.0
