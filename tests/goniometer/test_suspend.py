"""A scan that waits by itself: for the lamp, for a dazzled detector, for whatever a function of the user sees."""

from pathlib import Path

import pytest
import yaml
from numpy.testing import assert_allclose

import goniometer
from acquisition.events import Paused, PointReduced, ReadingStored, ScanDoubted, ScanEnded, WentOn
from acquisition.recipe import Recipe
from acquisition.suspend import SuspendedTooLongError, suspensions
from goniometer.errors import SaturatedError
from goniometer.run_folder import measured

ROOT = Path(__file__).resolve().parents[2]
SHORT = {"exit": {"start_deg": 0.0, "stop_deg": 54.0, "step_deg": 6.0}, "readings": 2}
WATCHED = SHORT | {"reference": {"exit_deg": 45.0, "every_points": 2}}
TEN = set(range(10))


@pytest.fixture
def run(tmp_path):
    def scan(recipe_changes, faults=(), out="runs", **more):
        for folder in ("recipes", "rigs", "scenes"):
            (tmp_path / folder).mkdir(exist_ok=True)
        (tmp_path / "rigs" / "simulated.yaml").write_text((ROOT / "rigs" / "simulated.yaml").read_text())
        for name, changes in (("recipes/iron_60deg.yaml", recipe_changes), ("scenes/iron.yaml", {"faults": [*faults]})):
            (tmp_path / name).write_text(yaml.safe_dump(yaml.safe_load((ROOT / name).read_text()) | changes))
        events, error = [], None
        options = {"out": tmp_path / out, "speed": "max", "live_fit": False, "subscribers": [events.append]}
        try:
            goniometer.run(tmp_path / "recipes" / "iron_60deg.yaml", **options, **more)
        except (SuspendedTooLongError, SaturatedError) as ended:
            error = ended
        (folder,) = (tmp_path / out).iterdir()
        return measured(folder), events, error

    return scan


def of(kind, events):
    return [event for event in events if isinstance(event, kind)]


def names(readings):
    return [(reading.point, reading.kind, reading.slot, reading.repeat) for reading in readings]


def test_a_dazzled_detector_is_waited_for_and_the_reading_taken_again(run):
    plain, _, _ = run(SHORT, out="plain")
    result, events, error = run(
        SHORT | {"suspend": {"saturated": True, "every_s": 2.0}},
        [{"fault": "detector_saturated", "at_s": 8.0, "for_s": 9.0}],
    )
    assert error is None
    (paused,), (went_on,) = of(Paused, events), of(WentOn, events)
    assert "the detector was saturated" in paused.why
    assert "will be taken again" in paused.why
    assert 8.0 < went_on.held_s < 14.0
    assert names(result.readings) == names(plain.readings)
    (interval,) = suspensions(result.about)
    assert interval == went_on.suspended
    assert interval.begin_s < 8.1
    assert interval.end_s > 17.0
    assert not any(interval.holds(reading.time_s) for reading in result.readings)
    assert {point.point for point in result.points} == TEN
    assert not of(ScanDoubted, events)


def test_without_the_section_a_dazzled_detector_ends_the_scan(run):
    _, events, error = run(SHORT, [{"fault": "detector_saturated", "at_s": 12.0, "for_s": 9.0}])
    assert isinstance(error, SaturatedError)
    assert not of(Paused, events)


def test_what_does_not_pass_ends_the_scan_after_its_time(run):
    result, events, error = run(
        SHORT | {"suspend": {"saturated": True, "every_s": 3.0, "for_at_most_s": 20.0}},
        [{"fault": "detector_saturated", "at_s": 12.0, "for_s": 1000.0}],
    )
    assert isinstance(error, SuspendedTooLongError)
    assert "the scan was suspended for" in str(error).lower()
    assert "the detector was saturated" in str(error)
    (ended,) = of(ScanEnded, events)
    assert 12.0 + 20.0 < ended.bench_duration_s < 12.0 + 20.0 + 2 * 3.0
    assert len(result.readings) == len(of(ReadingStored, events))
    assert suspensions(result.about)[0].end_s == float("inf")
    assert "suspended" in result.about["stopped"]


def test_a_lamp_that_fails_for_a_while_spoils_the_directions_before_its_reference_and_no_others(run):
    """Off between the references before the third and the fifth direction, or within: nobody knows since when."""
    plain, undisturbed, _ = run(WATCHED, out="plain")
    off = {"fault": "lamp_off", "at_s": 0.5 * undisturbed[-2].bench_duration_s, "for_s": 30.0}
    result, events, error = run(WATCHED | {"suspend": {"lamp_below": 0.8}}, [off])
    assert error is None
    (paused,) = of(Paused, events)
    assert "less than 0.8 (lamp_below)" in paused.why
    assert names(result.readings) == names(plain.readings)
    (interval,) = suspensions(result.about)
    spoilt = {one.point for one in result.readings if one.kind == "signal" and interval.holds(one.time_s)}
    assert len(spoilt) == 2
    assert {point.point for point in result.points} == TEN - spoilt
    (doubted,) = of(ScanDoubted, events)
    assert "(lamp_below)" in doubted.doubts[0]
    assert doubted.doubts[0] in result.doubts
    in_scan = {event.stokes_point.point: event.stokes_point for event in of(PointReduced, events)}
    for point in result.points:
        steady = plain.points[point.point]
        assert_allclose(point.stokes, steady.stokes, atol=8 * steady.covariance[0, 0] ** 0.5)
        assert_allclose(in_scan[point.point].stokes, steady.stokes, atol=8 * steady.covariance[0, 0] ** 0.5)


def test_a_function_of_the_user_decides_and_its_text_is_told(run):
    asked = []

    def shutter(reading):
        asked.append(reading)
        return "the shutter is shut" if 20 <= len(asked) < 23 else ""

    plain, _, _ = run(SHORT, out="plain")
    result, events, error = run(SHORT, suspend_when=shutter)
    assert error is None
    assert of(Paused, events)[0].why.startswith("the shutter is shut; ")
    assert len(of(Paused, events)) == len(of(WentOn, events)) == 1
    assert names(result.readings) == names(plain.readings)
    doubtful_s = {reading.time_s for reading in asked[19:22]}
    assert len(doubtful_s) == 3
    assert not doubtful_s & {reading.time_s for reading in result.readings}
    assert (asked[22].time_s - asked[19].time_s) > 3 * 5.0
    attributes = goniometer.load(result.folder).attrs
    assert "the shutter is shut" in attributes["suspended 1"]


def test_a_scan_of_a_recipe_without_a_reference_cannot_compare_the_lamp():
    text = yaml.safe_load((ROOT / "recipes" / "iron_60deg.yaml").read_text())
    with pytest.raises(ValueError, match="lamp_below: compares reference readings"):
        Recipe.model_validate(text | {"suspend": {"lamp_below": 0.8}})
