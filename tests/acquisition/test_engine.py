"""What the engine refuses, and that every way out of a scan stops every device."""

import math
from dataclasses import dataclass, field, replace

import pytest

from acquisition.earlier import Earlier
from acquisition.engine import Bench, Engine, stopped_afterwards
from acquisition.events import LinkRestored, ReadingStored
from acquisition.expand import Step, Target
from acquisition.generator import GeneratorState
from acquisition.journal import Journal
from acquisition.signal_to_noise import as_planned
from acquisition.time_left import TimeLeft
from goniometer.errors import (
    DeviceFaultError,
    NotConnectedError,
    PositionError,
    ReplyError,
    ReplyTimeoutError,
    ScanInterrupted,
)


class Clock:
    def __init__(self):
        self.now_s = 0.0

    def now(self):
        return self.now_s

    def sleep(self, duration_s):
        self.now_s += duration_s


@dataclass
class Device:
    """Any device of a bench: moves for a second, arrives where it was sent plus `miss`."""

    name: str
    clock: Clock
    miss: float = 0.0
    stop_error: BaseException | None = None
    settle_s: float = 0.25
    tolerance_deg: float = 0.01
    place: float = 0.0
    target: float = 0.0
    arrival_s: float = 0.0
    stops: int = 0
    obeys: bool = True
    turned_by_hand: list = field(default_factory=list)
    unplugged_until_s: float = 0.0
    is_linked: bool = True
    unlinked: type = NotConnectedError
    connects: int = 0
    sent: list = field(default_factory=list)
    come_back_as: BaseException | None = None
    knows_home: bool = True

    def is_homed(self):
        return self.knows_home

    def start_homing(self):
        self.knows_home = True
        self.start_move(0.0)

    def unplug(self, for_s):
        self.unplugged_until_s, self.is_linked = self.clock.now() + for_s, False

    def connect(self):
        self._require_link()
        self.connects += 1
        if self.come_back_as is not None:
            raise self.come_back_as
        return ()

    def reconnect(self):
        self.is_linked = self.clock.now() >= self.unplugged_until_s
        self._require_link()

    def start_move(self, target):
        self._require_link()
        self.sent.append(target)
        self.target, self.arrival_s = target + self.miss, self.clock.now() + 1.0

    start_select = start_move

    def is_moving(self):
        self._require_link()
        if self.clock.now() < self.arrival_s:
            return True
        self.place = self.target
        return False

    def position_deg(self):
        self._require_link()
        return self.place

    def slot(self):
        self._require_link()
        return self.turned_by_hand.pop(0) if self.turned_by_hand else self.place

    def stop(self):
        self.is_linked |= self.clock.now() >= self.unplugged_until_s  # as an axis does, over a fresh connection
        self._require_link()
        self.stops += 1
        if self.stop_error is not None:
            raise self.stop_error
        if self.obeys:
            self.arrival_s, self.target = self.clock.now(), self.place

    def _require_link(self):
        if not self.is_linked:
            raise self.unlinked(self.name, "the cable is out", not_done="nothing", to_do="plug it in")

    def remaining_s(self):
        return self.arrival_s - self.clock.now()

    @property
    def rested_s(self):
        return self.arrival_s

    def start_reading(self, exposure_s):
        self._require_link()
        self.arrival_s = self.clock.now() + exposure_s

    def is_reading(self):
        self._require_link()
        return self.clock.now() < self.arrival_s

    is_exposing = is_reading

    def power_w(self):
        return 1e-9


def step(point=0, exit_deg=5.0, slot=3, readings=2):
    return Step(point, "signal", Target(60.0, exit_deg, 10.0, slot), 45.0, readings, 0.03, 1.0)


@pytest.fixture(autouse=True)
def no_real_grace(monkeypatch):
    monkeypatch.setattr("drivers.clock.Deadline._REAL_GRACE_S", 0.0)


@pytest.fixture
def clock():
    return Clock()


@pytest.fixture
def bench(clock):
    return Bench(*(Device(name, clock) for name in ("source", "detector arm", "azimuth", "wheel", "meter")))


@pytest.fixture
def journal(tmp_path):
    with Journal.create(tmp_path / "journal", {}) as journal:
        yield journal


def moving(bench):
    return [axis.name for axis in (bench.source_arm, bench.detector_arm, bench.sample_azimuth) if axis.is_moving()]


def engine(bench, clock, journal, publish=lambda event: None, check=lambda: None, enough=as_planned):
    return Engine(bench, clock, journal, publish, check, TimeLeft(clock, 60.0), enough=enough)


def test_all_moves_of_a_step_overlap(bench, clock, journal):
    engine(bench, clock, journal).run([step(readings=1)])
    one_move_s, settle_s, exposure_s = 1.0, 0.25, 0.03
    assert clock.now() < one_move_s + settle_s + exposure_s + 0.05
    assert (bench.source_arm.place, bench.detector_arm.place, bench.sample_azimuth.place) == (60.0, 5.0, 10.0)


def test_readings_begin_only_after_the_bench_has_settled(bench, clock, journal):
    engine(bench, clock, journal).run([step(readings=1)])
    (reading,) = journal.readings()
    assert reading.time_s >= 1.0 + 0.25


@pytest.mark.parametrize("role", ["source_arm", "detector_arm", "sample_azimuth"])
def test_an_axis_that_stops_elsewhere_ends_the_scan_before_a_reading(bench, clock, journal, role):
    getattr(bench, role).miss = 0.02
    with pytest.raises(PositionError, match=f"{getattr(bench, role).name}: stands at"):
        engine(bench, clock, journal).run([step()])
    assert journal.readings() == ()


def test_a_wheel_turned_by_hand_between_two_readings_ends_the_scan(bench, clock, journal):
    bench.analyzer.place = 3
    bench.analyzer.turned_by_hand = [3, 3, 3, 4]
    with pytest.raises(PositionError, match="wheel: slot 4 is in the beam instead of slot 3"):
        engine(bench, clock, journal).run([step(readings=3)])
    assert [reading.slot for reading in journal.readings()] == [3]


def test_a_reading_during_which_the_wheel_was_turned_is_not_stored(bench, clock, journal):
    bench.analyzer.place = 3
    bench.analyzer.turned_by_hand = [3, 3, 4]
    with pytest.raises(PositionError, match="wheel: slot 4 is in the beam instead of slot 3"):
        engine(bench, clock, journal).run([step(readings=3)])
    assert journal.readings() == ()


@pytest.fixture
def behind_generator(bench, clock):
    return replace(bench, generator=Device("generator", clock), of_generator=(Device("its rotator", clock),))


def polarized_step(generator, **more):
    return replace(step(**more), target=Target(60.0, 5.0, 10.0, 3, generator=generator), made=GeneratorState(45.0))


def test_the_generator_turns_with_all_else_and_its_state_is_stored(behind_generator, clock, journal):
    engine(behind_generator, clock, journal).run([polarized_step(2, readings=1)])
    assert clock.now() < 1.0 + 0.25 + 0.03 + 0.05
    (reading,) = journal.readings()
    assert (reading.generator_slot, reading.generator) == (2, GeneratorState(45.0))
    assert behind_generator.generator.place == 2


def test_of_two_that_turn_only_what_must_is_sent(behind_generator, clock, journal):
    engine(behind_generator, clock, journal).run([polarized_step(slot) for slot in (2, 2, 4)])
    assert behind_generator.generator.sent == [2, 4]
    assert behind_generator.analyzer.sent == [3]


def test_a_generator_turned_by_hand_between_two_readings_ends_the_scan(behind_generator, clock, journal):
    behind_generator.generator.place = 2
    behind_generator.generator.turned_by_hand = [2, 2, 2, 4]
    with pytest.raises(PositionError, match=r"generator: slot 4 is in the beam instead of slot 2.*holds the generator"):
        engine(behind_generator, clock, journal).run([polarized_step(2, readings=3)])
    assert len(journal.readings()) == 1


def test_a_generator_is_stopped_and_found_again_as_all_else(behind_generator, clock, journal):
    generator = behind_generator.generator

    def unplug(event):
        if isinstance(event, ReadingStored) and generator.connects == 0:
            generator.unplug(for_s=1.0)

    with stopped_afterwards(behind_generator, clock):
        engine(behind_generator, clock, journal, publish=unplug).run([polarized_step(2), polarized_step(4)])
    assert [reading.generator_slot for reading in journal.readings()] == [2, 2, 4, 4]
    assert (generator.connects, generator.stops > 0) == (1, True)


def test_a_generator_that_turns_is_stopped_on_every_way_out(behind_generator, clock, journal):
    with pytest.raises(ScanInterrupted), stopped_afterwards(behind_generator, clock):
        engine(behind_generator, clock, journal, check=stop_when(clock, 0.5)).run([polarized_step(2)])
    assert behind_generator.generator.stops == 1
    assert not behind_generator.generator.is_moving()


def test_a_generator_that_does_not_know_its_home_ends_the_scan(behind_generator, clock, journal):
    behind_generator.of_generator[0].knows_home = False
    with pytest.raises(DeviceFaultError, match="its rotator"):
        engine(behind_generator, clock, journal).home()


@pytest.mark.parametrize("role", ["source_arm", "detector_arm", "sample_azimuth"])
def test_an_axis_that_is_not_where_it_was_left_is_not_moved(bench, clock, journal, role):
    """A controller that was reset says 0: a move from there would lead to twice the angle."""
    axis = getattr(bench, role)
    running = engine(bench, clock, journal)
    running.run([step()])
    left_deg, axis.place = axis.place, 0.0
    clock.sleep(0.2)
    with pytest.raises(PositionError, match=f"{axis.name}: stands at 0 degrees although it was left at {left_deg:g}"):
        running.run([step(point=1, exit_deg=6.0)])
    assert axis.place == 0.0
    assert not moving(bench)
    assert {reading.point for reading in journal.readings()} == {0}


def test_the_last_readings_are_taken_where_the_axes_were_left_too(bench, clock, journal):
    def lose_home(event):
        if isinstance(event, ReadingStored) and event.reading.repeat == 1:
            bench.detector_arm.place = 0.0

    with pytest.raises(PositionError, match="detector arm: stands at 0 degrees although it was left at 5"):
        engine(bench, clock, journal, publish=lose_home).run([step(readings=2)])


def test_a_reading_is_stored_before_it_is_shown(bench, clock, journal):
    stored = []

    def show(event):
        if isinstance(event, ReadingStored):
            stored.append(journal.readings()[-1] == event.reading)

    engine(bench, clock, journal, publish=show).run([step()])
    assert stored == [True, True]


def stop_when(clock, time_s):
    def check():
        if clock.now() >= time_s:
            raise ScanInterrupted("Ctrl-C", 130)

    return check


@pytest.mark.parametrize("time_s", [0.0, 0.1, 0.5, 1.1, 1.3])
def test_an_interruption_at_any_time_leaves_nothing_moving(bench, clock, journal, time_s):
    with pytest.raises(ScanInterrupted), stopped_afterwards(bench, clock):
        engine(bench, clock, journal, check=stop_when(clock, time_s)).run([step()])
    assert moving(bench) == []
    assert all(device.stops == 1 for device in (bench.source_arm, bench.detector_arm, bench.sample_azimuth))


@pytest.mark.parametrize("error", [RuntimeError("bug"), OSError("port"), KeyboardInterrupt(), SystemExit(1)])
def test_a_device_that_cannot_be_stopped_does_not_keep_the_others_moving(bench, clock, journal, error):
    bench.source_arm.stop_error = error
    with pytest.raises(BaseExceptionGroup) as caught, stopped_afterwards(bench, clock):
        engine(bench, clock, journal, check=stop_when(clock, 0.5)).run([step()])
    assert bench.detector_arm.stops == bench.sample_azimuth.stops == bench.analyzer.stops == 1
    assert error in caught.value.exceptions
    assert any(isinstance(failure, ScanInterrupted) for failure in caught.value.exceptions)


def test_an_axis_that_does_not_obey_its_stop_is_named(bench, clock):
    bench.detector_arm.obeys, bench.detector_arm.arrival_s = False, 1e9
    with pytest.raises(BaseExceptionGroup) as caught, stopped_afterwards(bench, clock):
        pass
    (failure,) = caught.value.exceptions
    assert isinstance(failure, DeviceFaultError)
    assert "still moves 10 s" in str(failure)
    assert "cut its power now" in str(failure)


def test_an_axis_whose_cable_is_plugged_in_again_is_stopped(bench, clock):
    bench.detector_arm.arrival_s = 1e9
    bench.detector_arm.unplug(for_s=0.5)
    with stopped_afterwards(bench, clock):
        pass
    assert bench.detector_arm.stops == 1
    assert not bench.detector_arm.is_moving()


def test_an_analyzer_that_turns_is_seen_to_rest_too(bench):
    bench.analyzer.obeys, bench.analyzer.arrival_s = False, 1.0
    with stopped_afterwards(bench, bench.analyzer.clock):
        pass
    assert bench.analyzer.clock.now() >= 1.0


@pytest.mark.parametrize(("drift_deg", "still_moves"), [(0.0, False), (1.0, True)])
def test_an_axis_that_answers_with_an_alarm_alone_is_seen_to_by_where_it_stands(bench, clock, drift_deg, still_moves):
    alarm = DeviceFaultError("detector arm", "it has an alarm", not_done="the move", to_do="reset it")

    class Alarmed(Device):
        def is_moving(self):
            raise alarm

        def position_deg(self):
            self.place += drift_deg
            return self.place

    bench = replace(bench, detector_arm=Alarmed("detector arm", clock))
    failures = bench.stop(clock)
    assert [("still moves 10 s" in str(failure)) for failure in failures] == [True] * still_moves


def test_an_axis_that_cannot_be_asked_may_still_be_moving_and_the_error_says_so(bench, clock):
    bench.detector_arm.unplug(for_s=1e9)
    with pytest.raises(BaseExceptionGroup) as caught, stopped_afterwards(bench, clock):
        pass
    (failure,) = caught.value.exceptions
    assert isinstance(failure, DeviceFaultError)
    assert "detector arm: it was told to stop" in str(failure)
    assert "the cable is out" in str(failure)
    assert "may still be moving" in str(failure)


def test_an_error_of_a_subscriber_stops_the_bench(bench, clock, journal):
    def fail(event):
        raise DeviceFaultError("x", "y", not_done="z", to_do="w")

    with pytest.raises(DeviceFaultError), stopped_afterwards(bench, clock):
        engine(bench, clock, journal, publish=fail).run([step()])
    assert bench.source_arm.stops == 1


STEPS = [step(readings=2), step(point=1, exit_deg=6.0, slot=4, readings=2), step(point=2, exit_deg=7.0, slot=3)]
ROLES = ("source_arm", "detector_arm", "sample_azimuth", "analyzer", "detector")


def rows(journal):
    """All of the readings but their times."""
    return [replace(reading, time_s=0.0) for reading in journal.readings()]


def unplug_at(clock, device, times_s, for_s):
    """Pull a device's cable at each of these times."""
    left_s = sorted(times_s)

    def check():
        if left_s and clock.now() >= left_s[0]:
            del left_s[0]
            device.unplug(for_s)

    return check


@pytest.fixture
def whole(tmp_path):
    """The rows of a scan in which nothing happens, and how long it takes."""
    clock = Clock()
    bench = Bench(*(Device(name, clock) for name in ("source", "detector arm", "azimuth", "wheel", "meter")))
    with Journal.create(tmp_path / "whole", {}) as journal:
        engine(bench, clock, journal).run(STEPS)
        return rows(journal), clock.now()


@pytest.mark.parametrize("role", ROLES)
@pytest.mark.parametrize(
    ("for_s", "error"), [(0.0, NotConnectedError), (2.3, NotConnectedError), (2.3, ReplyTimeoutError)]
)
def test_wherever_a_link_is_lost_the_readings_are_those_of_a_scan_in_which_nothing_happens(
    tmp_path, whole, role, for_s, error
):
    expected, duration_s = whole
    restored = 0
    for number in range(20):
        clock = Clock()
        bench = Bench(*(Device(name, clock) for name in ("source", "detector arm", "azimuth", "wheel", "meter")))
        device, shown, events = getattr(bench, role), [], []
        device.unlinked = error
        check = unplug_at(clock, device, [duration_s * number / 20], for_s)
        with Journal.create(tmp_path / f"{number}", {}) as journal:
            engine(bench, clock, journal, events.append, check).run(STEPS)
            shown = [replace(event.reading, time_s=0.0) for event in events if isinstance(event, ReadingStored)]
            assert rows(journal) == shown == expected
        told = [event for event in events if isinstance(event, LinkRestored)]
        assert all(event.device == device.name for event in told)
        restored += len(told)
    assert restored > 10


@pytest.mark.parametrize("role", ROLES)
def test_a_link_may_be_lost_while_a_scan_is_taken_up(tmp_path, bench, clock, journal, whole, role):
    expected, duration_s = whole
    engine(bench, clock, journal).run(STEPS)
    for number in range(20):
        clock = Clock()
        bench = Bench(*(Device(name, clock) for name in ("source", "detector arm", "azimuth", "wheel", "meter")))
        told, check = [], unplug_at(clock, getattr(bench, role), [duration_s * number / 20], 2.3)
        with Journal.create(tmp_path / f"{number}", {"link lost 1": "before"}) as cut:
            for row in journal.taken()[:-1]:
                cut.append(row.reading)
            earlier = Earlier(cut.taken(), STEPS)
            Engine(bench, clock, cut, told.append, check, TimeLeft(clock, 60.0), earlier=earlier).run(STEPS)
            assert rows(cut) == expected
            lost = sum(isinstance(event, LinkRestored) for event in told)
            assert cut.about()["link lost 1"] == "before"
            assert ("link lost 2" in cut.about()) == (lost > 0)
        assert [event.reading for event in told if isinstance(event, ReadingStored)][:-1] == list(journal.readings())[
            :-1
        ]


def test_a_reading_is_begun_anew_after_a_lost_link_with_the_bench_brought_there_before(bench, clock, journal):
    begun_s, told = [], []
    start_reading = bench.detector.start_reading
    bench.detector.start_reading = lambda exposure_s: (begun_s.append(clock.now()), start_reading(exposure_s))
    check = unplug_at(clock, bench.detector, [1.28], 2.3)
    engine(bench, clock, journal, told.append, check).run([replace(step(readings=1), exposure_s=0.5)])
    (reading,) = journal.readings()
    (event,) = [event for event in told if isinstance(event, LinkRestored)]
    assert len(begun_s) == 2
    assert reading.time_s == begun_s[1] > begun_s[0] + 2.3
    assert "meter: the cable is out at " in str(event)
    assert "back after 3.1 s; all devices are as they were, and what was under way is done again" in str(event)
    assert {getattr(bench, role).connects for role in ROLES} == {1, 2}, "at first, and at last"
    assert journal.about()["link lost 1"] == f"after 0 readings: {event}"


def test_everything_is_stopped_while_a_device_is_away_and_sent_again_afterwards(bench, clock, journal):
    seen = []

    def check():
        if clock.now() >= 0.5 and not seen:
            bench.detector_arm.unplug(for_s=2.0)
            seen.append([])
        elif 0.6 < clock.now() < 1.0:
            seen.append([device.name for device in (bench.source_arm, bench.analyzer) if device.is_moving()])

    engine(bench, clock, journal, check=check).run([step()])
    assert len(seen) > 2
    assert not any(seen)
    assert (bench.source_arm.sent, bench.detector_arm.sent, bench.analyzer.sent) == ([60, 60], [5, 5], [3, 3])


def test_an_analyzer_stopped_on_its_way_is_sent_again_also_where_it_should_be(bench, clock, journal):
    def check():
        if 0.5 <= clock.now() < 0.6 and len(bench.analyzer.sent) == 1:
            bench.analyzer.place = 3
            bench.source_arm.unplug(for_s=0.2)

    engine(bench, clock, journal, check=check).run([step()])
    assert bench.analyzer.sent == [3, 3]


def test_an_axis_stopped_on_its_way_is_sent_again_also_where_it_should_be(bench, clock, journal):
    """It may have come there on its way down, with the play of its gear still in it."""
    bench.detector_arm.place = 5.0 + 2.0

    def check():
        if 0.5 <= clock.now() < 0.6 and len(bench.detector_arm.sent) == 1:
            bench.detector_arm.place = 5.001
            bench.source_arm.unplug(for_s=0.2)

    engine(bench, clock, journal, check=check).run([step()])
    assert bench.detector_arm.sent == [5.0, 5.0]


def test_a_link_that_stays_away_ends_the_scan_after_half_a_minute_with_its_own_error(bench, clock, journal):
    check = unplug_at(clock, bench.detector_arm, [0.5], 1e9)
    with pytest.raises(NotConnectedError, match="detector arm: the cable is out") as caught:
        engine(bench, clock, journal, check=check).run([step()])
    assert caught.value.__notes__ == [
        "It was tried for 30 s to connect again, at last in vain: detector arm: the cable is out. Not done: nothing. "
        "What to do: plug it in."
    ]
    assert 30.0 < clock.now() < 34.0
    assert not bench.source_arm.is_moving()


def test_a_loose_plug_is_put_up_with_three_times_a_step(bench, clock, journal):
    with pytest.raises(NotConnectedError) as caught:
        engine(bench, clock, journal, check=unplug_at(clock, bench.analyzer, [0.5, 2.0, 4.0, 6.0], 0.0)).run(
            [step(readings=500)]
        )
    assert caught.value.__notes__ == ["Links were lost 4 times in this step, and taken up again 3 times."]
    assert len(journal.readings()) > 10


def test_each_step_has_its_three(bench, clock, journal):
    times_s = [0.1, 0.2, 0.3, 6.0, 6.1, 6.2]
    check = unplug_at(clock, bench.analyzer, times_s, 0.0)
    engine(bench, clock, journal, check=check).run([step(readings=100), step(point=1, exit_deg=9.0, readings=100)])
    assert len(journal.readings()) == 200


def test_waiting_for_a_cable_can_be_interrupted(bench, clock, journal):
    pull = unplug_at(clock, bench.detector_arm, [0.5], 1e9)
    interrupt = stop_when(clock, 5.0)
    with pytest.raises(ScanInterrupted):
        engine(bench, clock, journal, check=lambda: (pull(), interrupt())).run([step()])
    assert clock.now() < 5.2


@pytest.mark.parametrize("role", ROLES)
def test_a_device_that_comes_back_another_ends_the_scan_and_is_named(bench, clock, journal, role):
    device = getattr(bench, role)
    device.come_back_as = DeviceFaultError(device.name, "home is lost", not_done="any move", to_do="home it")
    with pytest.raises(DeviceFaultError, match=f"{device.name}: home is lost") as caught:
        engine(bench, clock, journal, check=unplug_at(clock, bench.detector_arm, [0.5], 1.0)).run([step()])
    (note,) = caught.value.__notes__
    assert note.startswith("It came to light when all devices were checked, after this: detector arm: the cable is out")
    assert journal.readings() == ()


def test_an_axis_that_was_moved_while_its_cable_was_out_ends_the_scan(bench, clock, journal):
    def check():
        if len(journal.readings()) == 1 and bench.sample_azimuth.place == 10.0:
            bench.sample_azimuth.place = 12.0
            bench.detector.unplug(for_s=1.0)

    with pytest.raises(PositionError, match="azimuth: stands at 12 degrees although it was left at 10 degrees"):
        engine(bench, clock, journal, check=check).run([step(readings=2)])
    assert len(journal.readings()) == 1


@pytest.mark.parametrize("kind", [ReplyError, PositionError])
def test_what_is_no_lost_link_ends_the_scan_at_once(bench, clock, journal, kind):
    error = kind("azimuth", "no answer", not_done="the move", to_do="look at it")
    bench.sample_azimuth.start_move = lambda target: (_ for _ in ()).throw(error)
    with pytest.raises(kind, match="azimuth: no answer"):
        engine(bench, clock, journal).run([step()])
    assert bench.sample_azimuth.connects == 0


@pytest.mark.parametrize("role", ["source_arm", "detector_arm", "sample_azimuth", "polarizer", "retarder"])
def test_an_axis_without_its_zero_ends_the_scan_though_it_seems_to_stand_where_it_should(bench, clock, journal, role):
    bench = replace(bench, **{role: Device(role, clock, knows_home=False)})
    with pytest.raises(DeviceFaultError, match=f"{role}: the stage does not know .*goniometer home --axis {role}"):
        engine(bench, clock, journal).home()
    engine(replace(bench, to_home=(getattr(bench, role),)), clock, journal).home()


@dataclass
class Doubtful(Device):
    """A detector that reads where the arm stands, nothing while it moves, and takes what it doubts again by itself."""

    arm: Device | None = None
    doubts: int = 0
    seen_deg: float = 0.0

    def start_reading(self, exposure_s):
        super().start_reading(exposure_s)
        self.seen_deg = self.arm.place if self.arm.arrival_s <= self.clock.now() else math.nan

    def is_exposing(self):
        return self.clock.now() < self.arrival_s

    def is_reading(self):
        if self.clock.now() >= self.arrival_s and self.doubts:
            self.doubts -= 1
            self.start_reading(0.03)
        return self.is_exposing()

    def power_w(self):
        return self.seen_deg


TWO = [step(readings=1), step(point=1, exit_deg=6.0, readings=1)]


def test_the_bench_leaves_with_the_last_light_and_the_reading_is_stored_on_the_way(bench, clock, journal):
    sent = []

    def note(event):
        if isinstance(event, ReadingStored):
            sent.append(bench.detector_arm.sent[-1])

    engine(bench, clock, journal, note).run(TWO)
    first, second = journal.readings()
    assert sent[0] == 6.0, "the arm is on its way when the reading is stored"
    assert 1.28 <= second.time_s - first.time_s < 1.31, "exposure, move and settling, and no more"
    assert (first.exit_deg, second.exit_deg) == (5.0, 6.0)


def test_the_bench_leaves_for_what_lies_ahead_of_the_steps(bench, clock, journal):
    engine(bench, clock, journal).run(TWO[:1], ahead=TWO[1].target)
    assert bench.detector_arm.sent == [5.0, 6.0]
    assert len(journal.readings()) == 1


@pytest.mark.parametrize("doubts", range(5))
def test_a_reading_in_doubt_is_taken_anew_where_it_belongs_though_the_bench_had_left(bench, clock, journal, doubts):
    bench = replace(bench, detector=Doubtful("meter", clock, arm=bench.detector_arm, doubts=doubts))
    engine(bench, clock, journal).run([*TWO, step(point=2, exit_deg=7.0, readings=3)])
    assert [one.power_w for one in journal.readings()] == [one.exit_deg for one in journal.readings()]
    assert [(one.point, one.repeat) for one in journal.readings()] == [(0, 0), (1, 0), (2, 0), (2, 1), (2, 2)]
    assert bench.detector.doubts == 0


def test_a_move_that_is_refused_costs_no_reading_that_has_its_light(bench, clock, journal):
    refused = DeviceFaultError("detector arm", "it has an alarm", not_done="the move", to_do="reset it")

    def start_move(target_deg):
        if target_deg == 6.0:
            raise refused
        Device.start_move(bench.detector_arm, target_deg)

    bench.detector_arm.start_move = start_move
    with pytest.raises(DeviceFaultError, match="it has an alarm"):
        engine(bench, clock, journal).run(TWO)
    assert [one.point for one in journal.readings()] == [0]


def test_settling_counts_from_when_a_device_stood_not_from_when_it_was_asked(bench, clock, journal):
    """The arm is slow to answer: what it takes to say that all is well has gone into the settling already."""

    class SlowToSay(Device):
        def is_moving(self):
            is_moving = super().is_moving()
            clock.sleep(0.0 if is_moving else 0.2)
            return is_moving

    bench = replace(bench, detector_arm=SlowToSay("detector arm", clock))
    engine(bench, clock, journal).run(TWO[:1])
    (reading,) = journal.readings()
    assert 1.25 <= reading.time_s < 1.25 + 0.01


def test_positions_are_asked_for_while_light_is_collected(bench, clock, journal):
    asked_s = []

    class Asked(Device):
        def position_deg(self):
            asked_s.append(clock.now())
            return super().position_deg()

    bench = replace(bench, detector_arm=Asked("detector arm", clock))
    engine(bench, clock, journal).run([replace(step(readings=1), exposure_s=1.0)])
    (reading,) = journal.readings()
    assert any(reading.time_s + 0.9 < moment_s < reading.time_s + 1.0 for moment_s in asked_s)


def test_axes_are_asked_once_more_before_they_move_when_the_light_took_long(bench, clock, journal):
    """As with a lock-in, whose filter settles first: what was seen during the exposure is old by then."""

    class Late(Device):
        def is_exposing(self):
            is_exposing = clock.now() < self.arrival_s + 1.0
            if clock.now() > self.arrival_s + 0.5:
                bench.source_arm.place = 0.0
            return is_exposing

        is_reading = is_exposing

    bench = replace(bench, detector=Late("meter", clock))
    with pytest.raises(PositionError, match="source: stands at 0 degrees although it was left at 60 degrees"):
        engine(bench, clock, journal).run(TWO)
    assert bench.detector_arm.sent == [5.0]


# Steps whose number of readings is decided as they are taken


def sum_is_enough(step, powers_w):
    """With 1e-9 W a reading: 4 of them, if the step allows so many."""
    return len(powers_w) >= step.readings or sum(powers_w) > 3.5e-9


OPEN = [step(readings=9), step(point=1, exit_deg=6.0, slot=4, readings=3), step(point=2, exit_deg=7.0, readings=9)]


def test_a_step_ends_with_the_reading_that_is_enough_or_with_the_last_it_may_take(bench, clock, journal):
    sent = []

    def note(event):
        if isinstance(event, ReadingStored):
            sent.append(bench.detector_arm.sent[-1])

    engine(bench, clock, journal, note, enough=sum_is_enough).run(OPEN)
    assert sent[:4] == [5.0, 5.0, 5.0, 6.0], "the arm is on its way when the last is stored"
    assert [(one.point, one.repeat) for one in journal.readings()] == [
        (point, repeat) for point, count in ((0, 4), (1, 3), (2, 4)) for repeat in range(count)
    ]
    between_s = journal.readings()[4].time_s - journal.readings()[3].time_s
    assert 1.28 <= between_s < 1.31, "exposure, move and settling, and no more"


def test_readings_are_numbered_on_from_those_of_an_earlier_round(bench, clock, journal):
    engine(bench, clock, journal).run([replace(step(readings=2), first_repeat=5)])
    assert [one.repeat for one in journal.readings()] == [5, 6]


@pytest.mark.parametrize("role", ROLES)
def test_wherever_a_link_is_lost_no_step_has_more_readings_than_are_enough(tmp_path, role):
    restored = 0
    for number in range(20):
        clock, events = Clock(), []
        bench = Bench(*(Device(name, clock) for name in ("source", "detector arm", "azimuth", "wheel", "meter")))
        check = unplug_at(clock, getattr(bench, role), [4.5 * number / 20], 2.3)
        with Journal.create(tmp_path / f"{number}", {}) as journal:
            engine(bench, clock, journal, events.append, check, sum_is_enough).run(OPEN)
            taken = [(one.point, one.repeat) for one in journal.readings()]
        assert taken == [(point, repeat) for point, count in ((0, 4), (1, 3), (2, 4)) for repeat in range(count)]
        restored += sum(isinstance(event, LinkRestored) for event in events)
    assert restored > 10


def test_a_move_that_is_refused_costs_no_reading_that_was_enough(bench, clock, journal):
    refused = DeviceFaultError("detector arm", "it has an alarm", not_done="the move", to_do="reset it")

    def start_move(target_deg):
        if target_deg == 6.0:
            raise refused
        Device.start_move(bench.detector_arm, target_deg)

    bench.detector_arm.start_move = start_move
    with pytest.raises(DeviceFaultError, match="it has an alarm"):
        engine(bench, clock, journal, enough=sum_is_enough).run(OPEN)
    assert [one.point for one in journal.readings()] == [0] * 4
