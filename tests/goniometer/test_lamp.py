"""A lamp that goes off during a scan: what a person is told, and what is left of the scan."""

from pathlib import Path

import pytest
import yaml
from numpy.testing import assert_allclose

import goniometer
from acquisition.events import ScanDoubted, ScanEnded
from goniometer.errors import ReductionError
from goniometer.run_folder import measured

ROOT = Path(__file__).resolve().parents[2]
SHORT = {"exit": {"start_deg": 0.0, "stop_deg": 60.0, "step_deg": 6.0}, "readings": 2}
WATCHED = SHORT | {"reference": {"exit_deg": 45.0, "every_points": 4}}


def run(tmp_path, recipe_changes, faults):
    """A short scan of iron through faults: its folder, its events, and how it ended."""
    events, error = [], None
    for folder in ("recipes", "rigs", "scenes"):
        (tmp_path / folder).mkdir(parents=True)
    (tmp_path / "rigs" / "simulated.yaml").write_text((ROOT / "rigs" / "simulated.yaml").read_text())
    for name, changes in (("recipes/iron_60deg.yaml", recipe_changes), ("scenes/iron.yaml", {"faults": faults})):
        (tmp_path / name).write_text(yaml.safe_dump(yaml.safe_load((ROOT / name).read_text()) | changes))
    try:
        goniometer.run(
            tmp_path / "recipes" / "iron_60deg.yaml", out=tmp_path / "runs", speed="max", subscribers=[events.append]
        )
    except ReductionError as ended:
        error = ended
    (folder,) = (tmp_path / "runs").iterdir()
    return folder, events, error


def test_a_lamp_that_goes_off_ends_the_scan_and_leaves_what_was_measured_before(tmp_path):
    """Off in the middle: the references before the fifth and the ninth direction enclose the moment."""
    whole, undisturbed, _ = run(tmp_path / "steady", WATCHED, [])
    middle_s = undisturbed[-2].bench_duration_s / 2
    folder, events, error = run(tmp_path, WATCHED, [{"fault": "lamp_off", "at_s": middle_s}])
    assert error is not None
    (ended,) = [event for event in events if isinstance(event, ScanEnded)]
    assert not ended.as_asked
    assert ended.reason == str(error)
    assert "readings) the lamp level cannot be followed" in ended.reason
    assert "the lamp may have been off" in ended.reason
    left = measured(folder)
    assert [point.point for point in left.points] == [0, 1, 2, 3]
    for point, steady in zip(left.points, measured(whole).points, strict=False):
        assert_allclose(point.stokes, steady.stokes, atol=8 * steady.covariance[0, 0] ** 0.5)


def test_a_lamp_that_goes_off_behind_the_last_reference_but_one_is_seen_by_the_one_that_closes_the_scan(tmp_path):
    _, events, _ = run(tmp_path / "steady", WATCHED, [])
    (ended,) = [event for event in events if isinstance(event, ScanEnded)]
    assert ended.reason == "finished"
    off = {"fault": "lamp_off", "at_s": ended.bench_duration_s - 6.0}
    folder, _, error = run(tmp_path, WATCHED, [off])
    with pytest.raises(ReductionError, match="At points 8 to 10 "):
        raise error
    assert [point.point for point in measured(folder).points] == list(range(8))


def test_without_references_a_scan_in_the_dark_ends_with_a_warning(tmp_path):
    _, events, error = run(tmp_path, SHORT, [{"fault": "lamp_off", "at_s": 0.0}])
    assert error is None
    (doubted,) = [event for event in events if isinstance(event, ScanDoubted)]
    assert doubted.doubts[0].startswith("No light was seen")


def test_a_scan_in_a_steady_lamp_is_not_doubted(tmp_path):
    _, events, error = run(tmp_path, SHORT, [])
    assert error is None
    assert not [event for event in events if isinstance(event, ScanDoubted)]
