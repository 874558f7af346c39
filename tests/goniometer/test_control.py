"""Pause, skip and exposure from Python; what the scan tells of it, and makes of the readings."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
import yaml
from numpy.testing import assert_allclose

import goniometer
from acquisition.control import ScanControl
from acquisition.engine import Engine
from acquisition.events import (
    AxisSentAgain,
    ExposureChanged,
    Paused,
    PointReduced,
    ReadingStored,
    RequestRefused,
    ScanEnded,
    Skipped,
    StepStarted,
    WentOn,
)
from acquisition.expand import Step, Target
from acquisition.journal import FILE_NAME, Journal
from acquisition.time_left import TimeLeft
from goniometer.errors import LimitError, PositionError
from goniometer.run_folder import measured

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def run(tmp_path):
    """Runs a short scan of iron with a control; `on` is called with every event and the control."""

    def scan(on=lambda event, control: None, out="runs", **changes):
        recipe = yaml.safe_load((ROOT / "recipes" / "iron_60deg.yaml").read_text())
        recipe |= {"exit": {"start_deg": 0.0, "stop_deg": 36.0, "step_deg": 6.0}} | changes
        for key in ("rig", "scene"):
            recipe[key] = str((ROOT / "recipes" / recipe[key]).resolve())
        (tmp_path / "recipe.yaml").write_text(yaml.safe_dump(recipe))
        control, events = ScanControl(), []

        def see(event):
            events.append(event)
            on(event, control)

        result = goniometer.run(
            tmp_path / "recipe.yaml",
            out=tmp_path / out,
            speed="max",
            live_fit=False,
            subscribers=[see],
            control=control,
        )
        return result, events

    return scan


def of(kind, events):
    return [event for event in events if isinstance(event, kind)]


def at_reading(number, act):
    """What to do when a number of readings is stored."""
    stored = []

    def on(event, control):
        if isinstance(event, ReadingStored):
            stored.append(event)
            if len(stored) == number:
                act(control)

    return on


def test_a_pause_stores_the_reading_at_hand_and_holds_until_it_is_ended(run):
    held = []

    def on(event, control):
        pause(event, control)
        if isinstance(event, Paused):
            held.append((event.readings, control.is_paused))
            control.go_on()

    pause = at_reading(20, lambda control: control.pause())
    result, events = run(on)
    (paused,), (went_on,) = of(Paused, events), of(WentOn, events)
    between = events[events.index(paused) + 1 : events.index(went_on)]
    assert between == []
    assert held == [(paused.readings, True)]
    assert 20 <= paused.readings <= 21
    assert len(result.readings) == 7 * 5 * 3
    assert "paused" in result.about["control 1"]
    assert result.doubts == ()


def test_a_pause_changes_no_reading_in_virtual_time(run):
    def on(event, control):
        pause(event, control)
        if isinstance(event, Paused):
            control.go_on()

    pause = at_reading(20, lambda control: control.pause())
    paused, _ = run(on, out="paused")
    plain, _ = run(out="plain")
    assert [reading.slot for reading in paused.readings] == [reading.slot for reading in plain.readings]
    for one, other in zip(paused.points, plain.points, strict=True):
        assert_allclose(one.stokes, other.stokes, atol=6 * other.covariance[0, 0] ** 0.5)


def test_a_skipped_direction_is_left_out_and_named(run):
    chosen = []

    def on(event, control):
        if isinstance(event, ReadingStored) and event.reading.point == 3 and not chosen:
            chosen.append(event)
            control.skip()

    result, events = run(on)
    (skipped,) = of(Skipped, events)
    assert skipped.point == 3
    assert [point.point for point in result.points] == [0, 1, 2, 4, 5, 6]
    assert sorted(event.stokes_point.point for event in of(PointReduced, events)) == [0, 1, 2, 4, 5, 6]
    assert len([reading for reading in result.readings if reading.point == 3]) in (1, 2)
    assert result.doubts[0].startswith("The rest of point 3 was skipped, so it is unfinished")
    assert any(text.endswith("the rest of it is left out") for text in result.about.values())


def test_with_references_a_skipped_direction_is_read_in_the_dark_still(run):
    """The dark power belongs to the reference that was read there: without it nobody could follow the lamp."""

    def on(event, control):
        if isinstance(event, StepStarted) and event.point in (0, 6) and not of(Skipped, seen):
            control.skip()
        seen.append(event)

    seen = []
    result, _ = run(on, reference={"exit_deg": 45.0, "every_points": 3})
    assert [point.point for point in result.points] == [1, 2, 3, 4, 5, 6]
    assert {reading.kind for reading in result.readings if reading.point == 0} >= {"reference", "dark"}
    assert not any("No reference" in doubt for doubt in result.doubts)


def test_a_direction_that_is_finished_cannot_be_skipped(run):
    def on(event, control):
        if isinstance(event, PointReduced) and event.stokes_point.point in (0, 6) and not asked:
            asked.append(event)
            control.skip()

    asked = []
    result, events = run(on)
    (refused,) = of(RequestRefused, events)
    assert "nothing was left of point" in refused.why
    assert len(result.points) == 7


def test_a_skipped_direction_in_a_scan_that_decides_as_it_goes_keeps_its_number_to_itself(run):
    def on(event, control):
        if isinstance(event, ReadingStored) and event.reading.point == 2 and not of(Skipped, seen):
            control.skip()
        seen.append(event)

    seen = []
    result, _ = run(on, until={"sigma": 1e-9}, time_limit_s=40.0)
    numbers = {reading.point for reading in result.readings}
    assert numbers == set(range(max(numbers) + 1))
    assert 2 not in {point.point for point in result.points}
    assert {point.point for point in result.points} >= {0, 1, 3}
    for number in numbers:
        assert len({round(reading.exit_deg) for reading in result.readings if reading.point == number}) == 1


def test_a_longer_exposure_holds_for_the_rest_and_makes_points_more_certain(run):
    result, events = run(at_reading(30, lambda control: control.set_exposure(0.3)), direction_within_s=0)
    (changed,) = of(ExposureChanged, events)
    exposures_s = [reading.exposure_s for reading in result.readings]
    assert 30 <= changed.readings <= 31
    assert exposures_s == [0.03] * changed.readings + [pytest.approx(0.3)] * (len(exposures_s) - changed.readings)
    plain, _ = run(out="plain", direction_within_s=0)
    for point, short in zip(result.points, plain.points, strict=True):
        if point.point >= 3:
            assert_allclose(short.covariance[0, 0] / point.covariance[0, 0], 10.0, rtol=0.3)
        assert_allclose(point.stokes, short.stokes, atol=6 * short.covariance[0, 0] ** 0.5)


def test_the_time_left_follows_the_exposure(run):
    _, events = run(at_reading(30, lambda control: control.set_exposure(0.6)), direction_within_s=0)
    (ended,) = of(ScanEnded, events)
    late = [step for step in of(StepStarted, events) if step.readings_done >= 33]
    for step in late:
        assert_allclose(step.elapsed_s + step.time_left_s, ended.bench_duration_s, rtol=0.01)


def test_what_the_detector_cannot_have_is_refused_at_once_and_the_scan_goes_on(run):
    refusals = []

    def ask(control):
        for exposure_s in (1e3, 0.0, float("nan")):
            with pytest.raises(LimitError, match=r"meter: an exposure of .* is not between 0 and 9 s"):
                control.set_exposure(exposure_s)
            refusals.append(exposure_s)

    result, events = run(at_reading(30, ask))
    assert len(refusals) == 3
    assert not of(ExposureChanged, events)
    assert {reading.exposure_s for reading in result.readings} == {0.03}


def test_a_refusal_of_the_driver_itself_is_told_and_the_scan_goes_on_with_the_exposure_before(run, monkeypatch):
    monkeypatch.setattr("goniometer.scanning.nearest_exposure", lambda rig, exposure_s: exposure_s)
    result, events = run(at_reading(30, lambda control: control.set_exposure(100.0)))
    (refused,) = of(RequestRefused, events)
    assert "an exposure of 100 s is not between" in refused.why
    assert {reading.exposure_s for reading in result.readings} == {0.03}
    assert len(result.points) == 7


def test_an_exposure_becomes_a_whole_number_of_samples(run):
    given = []
    run(at_reading(10, lambda control: given.append(control.set_exposure(0.0461))))
    assert_allclose(given, 0.045)


STEPS = [
    Step(0, "signal", Target(10.0, 5.0, 0.0, 3), 45.0, 2, 0.03, 1.0),
    Step(1, "signal", Target(10.0, 8.0, 0.0, 3), 45.0, 2, 0.03, 1.0),
]


class Arm:
    """The detector arm, which stands `miss_deg` beside its target while it was sent no more than `misses` times."""

    def __init__(self, axis, monkeypatch, misses, miss_deg):
        self.sent, self.by_hand_deg = [], 0.0
        start_move, position_deg = axis.start_move, axis.position_deg

        def send(target_deg):
            self.sent.append(target_deg)
            start_move(target_deg)

        def stands():
            return position_deg() + self.by_hand_deg + (miss_deg if 0 < len(self.sent) <= misses else 0.0)

        monkeypatch.setattr(axis, "start_move", send)
        monkeypatch.setattr(axis, "position_deg", stands)


@pytest.fixture
def on_bench(open_room, tmp_path, monkeypatch):
    def taking(misses=0, miss_deg=0.1, retries=2, on=lambda event, arm: None, control=None):
        room = open_room({}, {})
        arm = Arm(room.devices.detector_arm, monkeypatch, misses, miss_deg)
        bench = replace(room.devices, position_retries={"detector_arm": retries})
        events, error = [], None

        def see(event):
            events.append(event)
            on(event, arm)

        with Journal.create(tmp_path / FILE_NAME, {}) as journal:
            left = TimeLeft(room.clock, 10.0)
            try:
                Engine(bench, room.clock, journal, see, lambda: None, left, control=control).run(STEPS)
            except PositionError as ended:
                error = ended
            return arm, events, error, journal.readings(), journal.about()

    return taking


def test_an_axis_that_misses_by_little_is_sent_again_and_read_where_it_came_to_stand(on_bench):
    arm, events, error, readings, about = on_bench(misses=2)
    assert error is None
    assert arm.sent == [5.0, 5.0, 5.0, 8.0]
    assert [(event.time, event.of) for event in of(AxisSentAgain, events)] == [(1, 2), (2, 2)]
    assert_allclose([reading.exit_deg for reading in readings], [5.0, 5.0, 8.0, 8.0], atol=0.06)
    assert "is sent again (2 of 2)" in about["control 2"]


@pytest.mark.parametrize(("misses", "retries", "sent"), [(3, 2, 3), (1, 0, 1)])
def test_after_so_many_times_the_scan_ends_and_nothing_is_recorded_as_commanded(on_bench, misses, retries, sent):
    arm, _, error, readings, _ = on_bench(misses=misses, retries=retries)
    assert "stands at 5.1 degrees after a move to 5 degrees" in str(error)
    assert len(arm.sent) == sent
    assert readings == ()


def test_an_axis_that_misses_by_much_is_not_sent_again(on_bench):
    arm, _, error, readings, _ = on_bench(misses=1, miss_deg=0.7)
    assert "stands at 5.7 degrees after a move" in str(error)
    assert (arm.sent, readings) == ([5.0], ())


def test_an_axis_that_a_hand_moves_before_it_is_sent_again_is_not_sent(on_bench):
    def push(event, arm):
        if isinstance(event, AxisSentAgain):
            arm.by_hand_deg = 3.0

    arm, _, error, readings, _ = on_bench(misses=1, on=push)
    assert "although it was left at 5.1 degrees" in str(error)
    assert (arm.sent, readings) == ([5.0], ())


def test_an_axis_that_a_hand_moves_in_a_pause_is_not_sent_even_if_it_is_by_little(on_bench):
    control = ScanControl()
    control.pause()

    def push(event, arm):
        if isinstance(event, Paused):
            arm.by_hand_deg = 0.1
            control.go_on()

    arm, _, error, readings, _ = on_bench(on=push, control=control)
    assert "although it was left at 5 degrees" in str(error)
    assert (arm.sent, readings) == ([5.0], ())


def test_a_pause_asked_for_during_the_last_reading_of_a_step_keeps_the_bench_there(on_bench):
    control, sent_at = ScanControl(), []

    def on(event, arm):
        if isinstance(event, ReadingStored) and (event.reading.point, event.reading.repeat) == (0, 0):
            control.pause()  # the second and last one is being taken
        elif isinstance(event, Paused):
            sent_at.append((event.readings, list(arm.sent)))
            control.go_on()

    _, _, error, readings, _ = on_bench(on=on, control=control)
    assert error is None
    assert sent_at == [(2, [5.0])]
    assert len(readings) == 4


def test_a_skip_in_a_pause_is_told_at_once_and_moves_nothing_before_the_pause_ends(on_bench):
    control = ScanControl()
    control.pause()
    sent_at = {}

    def on(event, arm):
        sent_at[type(event)] = list(arm.sent)
        if isinstance(event, Paused):
            control.skip()
        elif isinstance(event, Skipped):
            control.go_on()

    _, events, _, readings, about = on_bench(on=on, control=control)
    assert sent_at[Skipped] == sent_at[WentOn] == [5.0]
    assert [type(event) for event in events if type(event) in (Paused, Skipped, WentOn)] == [Paused, Skipped, WentOn]
    assert {reading.point for reading in readings} == {1}
    assert json.loads(about["orders"]) == {"skipped": [0], "exposure_s": None}


def test_a_skipped_run_read_back_alone_names_it_too(run):
    def on(event, control):
        if isinstance(event, StepStarted) and event.point == 4:
            control.skip()

    result, _ = run(on)
    assert "point 4 was skipped" in measured(result.folder).doubts[0]
