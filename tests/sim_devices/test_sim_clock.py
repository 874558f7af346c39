"""Simulated clocks keep their time."""

import time

import pytest
from numpy.testing import assert_allclose

from sim_devices.serving.clock import ScaledClock, VirtualClock


@pytest.fixture
def real_time(monkeypatch):
    """Real time that passes only where something sleeps."""

    class RealTime:
        now_s = 1000.0

        def sleep(self, duration_s):
            self.now_s += duration_s

    stand_in = RealTime()
    monkeypatch.setattr(time, "monotonic", lambda: stand_in.now_s)
    monkeypatch.setattr(time, "sleep", stand_in.sleep)
    return stand_in


def test_scaled_time_is_real_time_times_the_speed(real_time):
    clock = ScaledClock(40)
    clock.sleep(10.0)
    assert_allclose(real_time.now_s, 1000.25)
    assert_allclose(clock.now(), 10.0)
    assert clock.speed == 40
    assert clock.reach(10.0)
    assert not clock.reach(10.4)
    assert_allclose(clock.real_s_until(14.0), 0.1)
    assert clock.real_s_until(9.0) == 0


@pytest.mark.parametrize("speed", [0, -1, float("inf"), float("nan")])
def test_a_speed_is_a_positive_number(speed):
    with pytest.raises(ValueError, match="positive number"):
        ScaledClock(speed)


@pytest.mark.parametrize("clock", [ScaledClock(1), VirtualClock()], ids=["scaled", "virtual"])
@pytest.mark.parametrize("duration_s", [-0.1, float("inf"), float("nan")])
def test_a_clock_cannot_wait_backwards_nor_for_ever(clock, duration_s):
    with pytest.raises(ValueError, match="zero seconds or more"):
        clock.sleep(duration_s)


def test_virtual_time_passes_at_once_and_never_goes_back(real_time):
    clock = VirtualClock()
    clock.sleep(3600.0)
    assert clock.reach(10.0)
    assert clock.now() == 3600.0
    assert clock.reach(3601.5)
    assert clock.now() == 3601.5
    assert real_time.now_s == 1000.0
    assert clock.speed == "max"


def test_virtual_time_serves_the_bench_before_it_passes_and_when_it_has_passed():
    clock = VirtualClock()

    class Bench:
        def __init__(self):
            self.served_at_s = []

        def serve(self):
            self.served_at_s.append(clock.now())

    bench = Bench()
    clock.attach(bench)
    clock.sleep(5.0)
    assert bench.served_at_s == [0.0, 5.0]
    assert clock.now() == 5.0
