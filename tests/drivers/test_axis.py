"""What every axis does above its stage; the stage here is the text of an ESP301's answers, or a list of calls."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from drivers.axis import Axis
from drivers.collision_zones import ArmsTooClose, Box
from drivers.interlock import Interlock
from drivers.travel import Travel
from goniometer.errors import CollisionError, DeviceFaultError, LimitError, PositionError

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
    with pytest.raises(DeviceFaultError, match="the motion to 100 degrees has not ended within twice its expected"):
        arrive(axis, clock)
    assert stage.stops == 1
    assert_allclose(clock.time_s, 2 * (100 / 10 + 10 / 40) + 5, atol=0.11)


def test_a_stage_that_cannot_tell_its_position_in_motion_is_not_asked(clock):
    stage = Turntable(clock, speed_deg_s=0.0, reports_in_motion=False)
    axis = axis_on(stage)
    axis.start_move(100)
    with pytest.raises(DeviceFaultError, match="has not ended"):
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


def test_a_home_position_that_is_not_found_in_time_is_said_to_be_that(clock):
    stage = Turntable(clock, at_deg=30.0, speed_deg_s=0.1, homed=False)
    axis = axis_on(stage)
    axis.start_homing()
    with pytest.raises(DeviceFaultError, match="the search for the home position has not ended within 180 s"):
        arrive(axis, clock)
    assert stage.stops == 1


@pytest.mark.parametrize("said_deg", [9.98, 10.0, 25.0, 40.02])
def test_after_a_lost_link_an_axis_may_stand_anywhere_on_its_way(clock, said_deg):
    axis = axis_sent_from_10_to_40(clock)
    axis._stage.start_deg = axis._stage.target_deg = said_deg
    assert axis.connect() == ()


@pytest.mark.parametrize("said_deg", [0.0, 9.96, 40.04, -320.0])
def test_after_a_lost_link_an_axis_that_cannot_stand_where_it_says_is_refused(clock, said_deg):
    """Such as a controller that was reset, or that of the other arm, when two cables were pulled."""
    axis = axis_sent_from_10_to_40(clock)
    axis._stage.start_deg = axis._stage.target_deg = said_deg
    with pytest.raises(PositionError, match=f"stands at {said_deg:g} degrees, where its last move between 10 and 40"):
        axis.connect()


def axis_sent_from_10_to_40(clock):
    stage = Turntable(clock, at_deg=10.0)
    axis = Axis(stage, clock, Travel((-170, 170), settle_s=0.1, tolerance_deg=0.03))
    assert not axis.is_moving()
    axis.start_move(40.0)
    clock.time_s += 1.0
    axis.stop()
    return axis


def test_whole_turns_are_no_other_place_for_a_table_that_turns_for_ever(clock):
    stage = Turntable(clock, at_deg=-350)
    axis = axis_on(stage, (-180, 180), wraps=True)
    axis.start_move(20)
    arrive(axis, clock)
    stage.start_deg = stage.target_deg = 20.0
    assert axis.connect() == ()
    stage.start_deg = stage.target_deg = 22.0 + 5 * 360
    with pytest.raises(PositionError, match="cannot have led"):
        axis.connect()


def test_stage_that_has_lost_its_home_meanwhile_is_refused_even_where_it_was_left(clock):
    stage = Turntable(clock)
    axis = axis_on(stage)
    axis.start_move(10)
    arrive(axis, clock)
    stage.homed = False
    with pytest.raises(DeviceFaultError, match="sample_azimuth: the stage does not know where its zero is"):
        axis.connect()


def test_stage_that_never_knew_its_home_is_connected_before_it_is_homed(clock):
    axis = axis_on(Turntable(clock, homed=False))
    assert axis.connect() == axis.connect() == ()


def test_a_move_to_where_the_axis_stands_leaves_its_play_out(clock):
    stage = Turntable(clock)
    axis = axis_on(stage, backlash_deg=2.0)
    for target_deg in (10.0, 10.0, 10.5):
        axis.start_move(target_deg)
        arrive(axis, clock)
    assert stage.targets_deg == [10.0, 10.0, 10.5]


def arms_on(clock, zone, source_deg=60.0, detector_deg=0.0, detector=Turntable, **travel):
    """A source arm and a detector arm on stages of their own, with an interlock over both."""
    stages = {"source_arm": Turntable(clock, source_deg), "detector_arm": detector(clock, detector_deg)}
    axes = {}
    for role, stage in stages.items():
        stage.name = role
        axes[role] = axis_on(stage, **travel)
    Interlock([zone], axes)
    return stages, axes["source_arm"], axes["detector_arm"]


def sent(stages):
    return {role: stage.targets_deg for role, stage in stages.items()}


def refused(axis, target_deg):
    with pytest.raises(CollisionError, match=f"{axis.name}: the way from .* to {target_deg:g} degrees enters"):
        axis.start_move(target_deg)
    return True


def test_an_axis_is_anywhere_on_its_way_from_the_moment_it_is_sent(clock):
    stages, source, detector = arms_on(clock, ArmsTooClose(15), detector_deg=30.0)
    detector.start_move(-40.0)
    assert refused(source, 40.0)  # 70 degrees off where the detector arm is now, and right where it goes
    assert sent(stages) == {"source_arm": [], "detector_arm": [-40.0]}
    arrive(detector, clock)
    detector.start_move(30.0)
    assert refused(source, 40.0)  # and where it comes from
    arrive(detector, clock)
    source.start_move(40.0)


def test_what_lies_between_belongs_to_the_way(clock):
    stages, _, detector = arms_on(clock, ArmsTooClose(15))
    assert refused(detector, -100.0)
    detector.start_move(-45.0)
    assert sent(stages)["detector_arm"] == [-45.0]


def test_a_table_that_turns_for_ever_needs_no_room_to_approach_its_lowest_angle(clock):
    stage = Turntable(clock)
    axis_on(stage, (-180, 180), wraps=True, backlash_deg=2.0).start_move(-180.0)
    assert stage.targets_deg == [-182.0]


def test_an_axis_that_turns_back_before_its_target_may_be_there_too(clock):
    zone = Box({"detector_arm": (-13, -11), "source_arm": (0, 40)})
    stages, source, detector = arms_on(clock, zone, backlash_deg=3.0)
    detector.start_move(-10.0)
    assert refused(source, 30.0)
    assert sent(stages) == {"source_arm": [], "detector_arm": [-13.0]}


class DeafInMotion(Turntable):
    """One that cannot be stopped on its way to a target, as Elliptec modules."""

    def stop(self):
        self.stops += 1


@pytest.mark.parametrize(("detector_stage", "rests_deg"), [(Turntable, 20.0), (DeafInMotion, -40.0)])
def test_an_axis_that_was_stopped_is_anywhere_on_its_way_until_it_is_seen_at_rest(clock, detector_stage, rests_deg):
    _, source, detector = arms_on(clock, ArmsTooClose(15), detector_deg=30.0, detector=detector_stage)
    detector.start_move(-40.0)
    clock.time_s += 1.0
    detector.stop()
    assert refused(source, 40.0)
    arrive(detector, clock)
    assert_allclose(detector.position_deg(), rests_deg)
    assert refused(source, -rests_deg)
    source.start_move(20.0 - rests_deg)


def test_an_axis_that_is_sent_elsewhere_on_its_way_may_still_go_where_it_was_sent(clock):
    """It brakes, and some do so for long: the source arm goes only once the detector arm is seen at rest."""
    stages, source, detector = arms_on(clock, Box({"detector_arm": (40, 60), "source_arm": (-10, 10)}))
    detector.start_move(50.0)
    clock.time_s += 1.0
    detector.start_move(0.0)
    assert refused(source, 5.0)
    arrive(detector, clock)
    source.start_move(5.0)
    clock.time_s += 1.0
    assert refused(detector, 45.0)
    assert sent(stages) == {"source_arm": [5.0], "detector_arm": [50.0, 0.0]}


def test_a_refused_move_leaves_the_one_under_way_as_it_was(clock):
    stages, source, detector = arms_on(clock, ArmsTooClose(15), detector_deg=30.0, backlash_deg=3.0)
    detector.start_move(0.0)
    clock.time_s += 1.0
    assert refused(detector, -70.0)
    arrive(detector, clock)
    assert sent(stages)["detector_arm"] == [-3.0, 0.0]
    source.start_move(30.0)


UNTOLD = "detector_arm: the axis moves although this program has not told it to: .* its motion was not stopped"


def test_nobody_watches_over_an_axis_that_moves_already(clock):
    stage = Turntable(clock)
    stage.name = "detector_arm"
    stage.start_move(30.0)
    axes = {"detector_arm": axis_on(stage)}
    with pytest.raises(DeviceFaultError, match=UNTOLD):
        Interlock([], axes)
    assert stage.stops == 0
    clock.time_s += 3.0
    Interlock([], axes)


def test_a_motion_that_begins_by_itself_keeps_every_axis_from_being_sent_anywhere(clock):
    stages, source, detector = arms_on(clock, ArmsTooClose(15), detector_deg=30.0)
    stages["detector_arm"].start_move(-70.0)
    with pytest.raises(DeviceFaultError, match=UNTOLD):
        source.start_move(61.0)
    with pytest.raises(DeviceFaultError, match=UNTOLD):
        detector.start_move(31.0)
    assert sent(stages) == {"source_arm": [], "detector_arm": [-70.0]}
    assert stages["detector_arm"].stops == 0


def test_an_axis_that_does_not_know_its_zero_may_be_anywhere_within_its_limits(clock):
    stages, source, detector = arms_on(clock, Box({"detector_arm": (160, 175), "source_arm": (0, 40)}))
    stages["detector_arm"].homed = detector._was_homed = False
    assert detector.span_deg() == (-170, 170)
    assert refused(source, 30.0)
    stages["detector_arm"].homed = True
    source.start_move(30.0)


def test_an_axis_that_searches_its_zero_may_be_anywhere_within_its_limits(clock):
    stages, source, detector = arms_on(clock, Box({"detector_arm": (160, 175), "source_arm": (0, 40)}))
    detector.start_move(20.0)
    arrive(detector, clock)
    detector.start_homing()
    assert stages["detector_arm"].is_homed()  # as drives say that keep their zero
    assert refused(source, 30.0)
    arrive(detector, clock)
    source.start_move(30.0)


def test_an_axis_without_a_zero_that_moves_is_not_refused_so_that_it_can_be_homed(clock):
    stage = Turntable(clock, homed=False)
    stage.start_move(30.0)
    axis = axis_on(stage)
    Interlock([], {"detector_arm": axis})
    axis.start_homing()
    arrive(axis, clock)
    assert axis.span_deg() == (0.0, 0.0)
