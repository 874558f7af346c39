"""What every axis does above its stage; the stage here is the text of an ESP301's answers, or a list of calls."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drivers.axis import Axis, Travel
from goniometer.errors import DeviceFaultError, LimitError, ReplyTimeoutError

pytestmark = pytest.mark.usefixtures("no_real_grace")


class Turntable:
    """A stage of one line of arithmetic: it is `speed_deg_s` nearer to its target whenever the clock has moved on."""

    name, velocity_deg_s, acceleration_deg_s2 = "sample_azimuth", 10.0, 40.0

    def __init__(self, clock, at_deg=0.0, speed_deg_s=10.0, reports_in_motion=True, homed=True):
        self.clock, self.speed_deg_s, self.reports_in_motion, self.homed = clock, speed_deg_s, reports_in_motion, homed
        self.start_deg, self.target_deg, self.start_s = at_deg, at_deg, 0.0
        self.targets_deg, self.stops = [], 0

    def connect(self):
        return ()

    def is_homed(self):
        return self.homed

    def start_homing(self):
        self.start_move(0.0)
        self.homed = True

    def start_move(self, target_deg):
        self.start_deg, self.start_s, self.target_deg = self.position_deg(), self.clock.now(), target_deg
        self.targets_deg.append(target_deg)

    def is_moving(self):
        return self.position_deg() != self.target_deg

    def position_deg(self):
        gone_deg = self.speed_deg_s * (self.clock.now() - self.start_s)
        way_deg = self.target_deg - self.start_deg
        return self.target_deg if gone_deg >= abs(way_deg) else self.start_deg + np.sign(way_deg) * gone_deg

    def stop(self):
        self.stops += 1
        self.start_deg = self.target_deg = self.position_deg()

    def reconnect(self): ...

    def close(self): ...


def axis_on(stage, limits_deg=(-170, 170), **travel):
    return Axis(stage, stage.clock, Travel(limits_deg, settle_s=0.1, tolerance_deg=0.01, **travel))


def arrive(axis, clock):
    for _ in range(10_000):
        if not axis.is_moving():
            return
        clock.time_s += 0.1
    raise AssertionError("the axis never arrives")


def test_every_target_is_approached_upwards(clock):
    stage = Turntable(clock)
    axis = axis_on(stage, backlash_deg=2.0)
    rng = np.random.default_rng(5)
    arrivals = []
    for target_deg in rng.uniform(-160, 160, 60):
        before = len(stage.targets_deg)
        axis.start_move(target_deg)
        arrive(axis, clock)
        assert_allclose(axis.position_deg(), target_deg)
        arrivals.append(stage.targets_deg[before:])
    at_deg = 0.0
    for number, legs in enumerate(arrivals):
        for leg_deg in legs:
            came_up, at_deg = leg_deg > at_deg, leg_deg
        assert came_up, number
        assert len(legs) == 1 or legs[1] - legs[0] == pytest.approx(2.0)


def test_small_steps_upwards_need_no_detour_once_the_play_is_out(clock):
    stage = Turntable(clock)
    axis = axis_on(stage, backlash_deg=2.0)
    for target_deg in (0.5, 1.0, 1.5, 1.5):
        axis.start_move(target_deg)
        arrive(axis, clock)
    assert stage.targets_deg == [-1.5, 0.5, 1.0, 1.5, 1.5]


def test_after_a_stop_the_play_is_unknown_and_taken_out_again(clock):
    stage = Turntable(clock)
    axis = axis_on(stage, backlash_deg=2.0)
    axis.start_move(10)
    clock.time_s += 0.5
    axis.is_moving()
    axis.stop()
    axis.start_move(6.0)
    arrive(axis, clock)
    assert stage.targets_deg == [10, 4, 6]


def test_the_approach_may_not_leave_the_limits(clock):
    stage = Turntable(clock)
    axis = axis_on(stage, backlash_deg=2.0)
    with pytest.raises(LimitError, match="the target -169 degrees is outside the limits -168 to 170 degrees"):
        axis.start_move(-169)
    assert stage.targets_deg == []


@pytest.mark.parametrize(("at_deg", "target_deg", "sent_deg"), [(170, -170, 190), (-350, 20, -340), (725, 0, 720)])
def test_a_table_that_turns_for_ever_goes_the_shorter_way(clock, at_deg, target_deg, sent_deg):
    stage = Turntable(clock, at_deg)
    axis = axis_on(stage, (-180, 180), wraps=True)
    axis.start_move(target_deg)
    arrive(axis, clock)
    assert stage.targets_deg == [sent_deg]
    assert_allclose(axis.position_deg(), target_deg)


def test_an_arm_never_takes_the_way_round(clock):
    stage = Turntable(clock, 170)
    axis_on(stage).start_move(-170)
    assert stage.targets_deg == [-170]


def test_the_zero_lies_between_the_stage_and_the_axis(clock):
    stage = Turntable(clock, at_deg=12.5)
    axis = axis_on(stage, (-10, 10), zero_deg=12.0)
    assert_allclose(axis.position_deg(), 0.5)
    axis.start_move(10)
    assert stage.targets_deg == [22.0]


def test_an_axis_that_stands_still_on_its_way_is_stopped_long_before_its_deadline(clock):
    stage = Turntable(clock)
    axis = axis_on(stage)
    axis.start_move(160)
    clock.time_s = 3.0
    assert axis.is_moving()
    stage.start_deg, stage.speed_deg_s = stage.position_deg(), 0.0
    with pytest.raises(DeviceFaultError, match="sample_azimuth: the axis has stood still at 30 degrees for 2 s on its"):
        arrive(axis, clock)
    assert stage.stops == 1
    assert clock.time_s < 3.0 + 3.5


def test_an_axis_slower_than_it_should_be_has_twice_its_time_and_five_seconds(clock):
    stage = Turntable(clock, speed_deg_s=1.0)
    axis = axis_on(stage)
    axis.start_move(100)
    with pytest.raises(ReplyTimeoutError, match="the motion to 100 degrees has not ended within twice its expected"):
        arrive(axis, clock)
    assert stage.stops == 1
    assert_allclose(clock.time_s, 2 * (100 / 10 + 10 / 40) + 5, atol=0.11)


def test_a_stage_that_cannot_tell_its_position_in_motion_is_not_asked(clock):
    stage = Turntable(clock, speed_deg_s=0.0, reports_in_motion=False)
    axis = axis_on(stage)
    axis.start_move(100)
    with pytest.raises(ReplyTimeoutError, match="has not ended"):
        arrive(axis, clock)


def test_a_stage_that_does_not_know_its_zero_is_homed_first(clock):
    stage = Turntable(clock, at_deg=30.0, homed=False)
    axis = axis_on(stage)
    with pytest.raises(DeviceFaultError, match=r"does not know where its zero is: .*goniometer home --axis"):
        axis.start_move(10)
    assert stage.targets_deg == []
    axis.start_homing()
    arrive(axis, clock)
    axis.start_move(10)
    assert stage.targets_deg == [0.0, 10]
