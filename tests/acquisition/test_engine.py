"""What the engine refuses, and that every way out of a scan stops every device."""

from dataclasses import dataclass, field

import pytest

from acquisition.engine import Bench, Engine, stopped_afterwards
from acquisition.events import ReadingStored
from acquisition.expand import Step, Target
from acquisition.journal import Journal
from goniometer.errors import DeviceFaultError, NotConnectedError, PositionError, ScanInterrupted


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

    def start_move(self, target):
        self.target, self.arrival_s = target + self.miss, self.clock.now() + 1.0

    start_select = start_move

    def is_moving(self):
        self._require_link()
        if self.clock.now() < self.arrival_s:
            return True
        self.place = self.target
        return False

    def position_deg(self):
        return self.place

    def slot(self):
        return self.turned_by_hand.pop(0) if self.turned_by_hand else self.place

    def stop(self):
        self._require_link()
        self.stops += 1
        if self.stop_error is not None:
            raise self.stop_error
        if self.obeys:
            self.arrival_s, self.target = self.clock.now(), self.place

    def _require_link(self):
        if self.clock.now() < self.unplugged_until_s:
            raise NotConnectedError(self.name, "the cable is out", not_done="nothing", to_do="plug it in")

    def start_reading(self, exposure_s):
        self.arrival_s = self.clock.now() + exposure_s

    def is_reading(self):
        return self.clock.now() < self.arrival_s

    def power_w(self):
        return 1e-9


def step(point=0, exit_deg=5.0, slot=3, readings=2):
    return Step(point, "signal", Target(60.0, exit_deg, 10.0, slot), 45.0, readings, 0.03, 1.0)


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


def engine(bench, clock, journal, publish=lambda event: None, check=lambda: None):
    return Engine(bench, clock, journal, publish, check, duration_s=60.0)


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


@pytest.mark.parametrize("role", ["source_arm", "detector_arm", "sample_azimuth"])
def test_an_axis_that_is_not_where_it_was_left_is_not_moved(bench, clock, journal, role):
    """A controller that was reset says 0: a move from there would lead to twice the angle."""
    axis = getattr(bench, role)
    running = engine(bench, clock, journal)
    running.run([step()])
    left_deg, axis.place = axis.place, 0.0
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
    with pytest.raises(BaseExceptionGroup) as caught, stopped_afterwards(bench, GenerousClock(clock)):
        pass
    (failure,) = caught.value.exceptions
    assert isinstance(failure, DeviceFaultError)
    assert "still moves 10 s" in str(failure)
    assert "cut its power now" in str(failure)


def test_an_axis_whose_cable_is_plugged_in_again_is_stopped(bench, clock):
    bench.detector_arm.arrival_s, bench.detector_arm.unplugged_until_s = 1e9, 0.5
    with stopped_afterwards(bench, clock):
        pass
    assert bench.detector_arm.stops == 1
    assert not bench.detector_arm.is_moving()


def test_an_axis_that_cannot_be_asked_may_still_be_moving_and_the_error_says_so(bench, clock):
    bench.detector_arm.unplugged_until_s = 1e9
    with pytest.raises(BaseExceptionGroup) as caught, stopped_afterwards(bench, clock):
        pass
    (failure,) = caught.value.exceptions
    assert isinstance(failure, DeviceFaultError)
    assert "detector arm: it was told to stop" in str(failure)
    assert "the cable is out" in str(failure)
    assert "may still be moving" in str(failure)


class GenerousClock:
    """Passes real time's grace, too, so that the test need not wait for it."""

    def __init__(self, clock):
        self._clock = clock

    def now(self):
        return self._clock.now()

    def sleep(self, duration_s):
        self._clock.sleep(duration_s)


def test_an_error_of_a_subscriber_stops_the_bench(bench, clock, journal):
    def fail(event):
        raise DeviceFaultError("x", "y", not_done="z", to_do="w")

    with pytest.raises(DeviceFaultError), stopped_afterwards(bench, clock):
        engine(bench, clock, journal, publish=fail).run([step()])
    assert bench.source_arm.stops == 1
