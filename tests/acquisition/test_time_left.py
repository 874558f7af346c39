"""The time left learns from the time that steps take."""

import pytest
from numpy.testing import assert_allclose

from acquisition.time_left import TimeLeft


class Clock:
    now_s = 100.0

    def now(self):
        return self.now_s


@pytest.mark.parametrize("pace", [0.5, 1.0, 1.3, 2.0])
def test_the_time_left_is_soon_that_of_the_pace_at_which_steps_are_done(pace):
    clock = Clock()
    left = TimeLeft(clock, 1000.0)
    assert left.left_s() == 1000.0
    off = []
    for step in range(1, 101):
        clock.now_s += 10.0 * pace
        left.step_done(10.0)
        truly_s = (100 - step) * 10.0 * pace
        off.append(abs(left.left_s() - truly_s))
    assert max(off[5:]) < 0.15 * 1000.0 * pace
    assert max(off[30:]) < 0.03 * 1000.0 * pace
    assert off == sorted(off, reverse=True)
    assert_allclose(left.elapsed_s(), 1000.0 * pace)
    assert left.left_s() == 0.0


def test_a_first_step_that_is_slow_does_not_upset_it():
    clock = Clock()
    left = TimeLeft(clock, 100.0)
    left.left_s()
    clock.now_s += 2.0
    left.step_done(1.0)
    assert 99.0 < left.left_s() < 1.15 * 99.0


def test_of_a_time_limit_is_left_what_is_left():
    clock = Clock()
    left = TimeLeft(clock, 100.0, is_limit=True)
    left.left_s()
    clock.now_s += 30.0
    left.step_done(10.0)
    assert left.left_s() == 70.0
    clock.now_s += 100.0
    assert left.left_s() == 0.0


def test_a_pause_tells_nothing_of_how_long_steps_take():
    clock = Clock()
    left = TimeLeft(clock, 100.0)
    left.left_s()
    clock.now_s += 50.0 + 1000.0
    left.step_done(50.0)
    left.held(1000.0)
    assert_allclose(left.left_s(), 50.0)
    assert_allclose(left.elapsed_s(), 1050.0)


def test_what_is_left_out_is_not_left_and_another_exposure_is():
    left = TimeLeft(Clock(), 100.0, readings=40, reading_s=lambda exposure_s: exposure_s + 0.5)
    left.left_out(20.0, 10)
    assert_allclose(left.left_s(), 80.0)
    left.exposure_changed(1.0, 2.0, 10, 0)
    assert_allclose(left.left_s(), 80.0 + (40 - 10 - 10) * 1.0)


def test_a_plan_of_no_duration_leaves_nothing_at_its_beginning():
    assert TimeLeft(Clock(), 0.0).left_s() == 0.0
