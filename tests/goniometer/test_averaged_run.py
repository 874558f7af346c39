"""Scans that average until something is reached, on the simulated bench: every byte over a socket."""

import io
import itertools
from pathlib import Path

import numpy as np
import pytest
import yaml
from click.testing import CliRunner
from numpy.testing import assert_allclose

import goniometer
from acquisition.events import NotReached, PointReduced, ScanDoubted, ScanEnded, ScanStarted, StepStarted
from acquisition.signal_to_noise import ratio
from goniometer.bluesky.export import run_documents
from goniometer.check import describe_plan
from goniometer.cli import cli
from goniometer.console import PlainConsole
from goniometer.lasting_stream import LastingStream
from goniometer.load_files import load_recipe
from goniometer.planning import detection, span_s
from goniometer.run_folder import measured

ROOT = Path(__file__).resolve().parents[2]
TO_RATIO = {"at_least": 2, "at_most": 60, "signal_to_noise": 200}
TO_ERROR = {"at_least": 2, "at_most": 60, "dolp_error": 0.005}
EVERY_6 = {"exit": {"start_deg": 0.0, "stop_deg": 60.0, "step_deg": 6.0}}


def write(folder, readings, noise=None, **changes):
    """The iron recipe with these readings, on a rig whose file states another noise."""
    recipe = yaml.safe_load((ROOT / "recipes" / "iron_60deg.yaml").read_text()) | EVERY_6 | changes
    rig = yaml.safe_load((ROOT / "rigs" / "simulated.yaml").read_text())
    if noise is not None:
        rig["devices"]["meter"]["noise"] = noise
    (folder / "rig.yaml").write_text(yaml.safe_dump(rig))
    recipe |= {"rig": "rig.yaml", "scene": str(ROOT / "scenes" / "iron.yaml"), "readings": readings}
    path = folder / "recipe.yaml"
    path.write_text(yaml.safe_dump({key: value for key, value in recipe.items() if value is not None}))
    return path


def run(folder, readings, **changes):
    events = []
    path = write(folder, readings, **changes)
    return goniometer.run(path, out=folder / "runs", speed="max", subscribers=[events.append]), events


def of_kind(events, kind):
    return [event for event in events if isinstance(event, kind)]


def stays(readings):
    """The readings taken one after the other at one place, with the place."""
    for place, group in itertools.groupby(readings, key=lambda one: (one.point, one.kind, one.slot)):
        yield place, list(group)


@pytest.fixture(scope="module")
def to_ratio(tmp_path_factory):
    return run(tmp_path_factory.mktemp("ratio"), TO_RATIO)


@pytest.fixture(scope="module")
def to_error(tmp_path_factory):
    return run(tmp_path_factory.mktemp("error"), TO_ERROR)


def test_every_slot_has_the_readings_that_its_ratio_takes_and_not_one_more(to_ratio):
    stored, events = to_ratio
    noise = detection(stored.recipe, stored.rig).noise
    counts = {}
    for (point, kind, _), group in stays(stored.readings):
        powers_w = [one.power_w for one in group]
        if kind == "signal":
            found = [ratio(powers_w[:count], 0.03, noise) for count in range(2, len(group) + 1)]
            assert found[-1] >= 200
            assert max(found[:-1], default=0.0) < 200
            counts.setdefault(point, []).append(len(group))
        else:
            assert len(group) == max(counts[point]), "dark, behind the others"
    assert {len(of_point) for of_point in counts.values()} == {4}
    assert min(itertools.chain(*counts.values())) == 2
    assert max(itertools.chain(*counts.values())) > 5
    assert of_kind(events, ScanEnded)[0].reason == "finished"
    assert not of_kind(events, NotReached)
    assert not of_kind(events, ScanDoubted)


def test_every_direction_is_read_in_rounds_until_its_dolp_is_known(to_error):
    stored, events = to_error
    assert [event.stokes_point.point for event in of_kind(events, PointReduced)] == list(range(11))
    counts = set()
    for point in stored.points:
        assert point.dolp_stderr <= 0.005
        of_point = [one for one in stored.readings if one.point == point.point]
        repeats = {slot: [one.repeat for one in of_point if one.slot == slot] for slot in (2, 3, 4, 5, 6)}
        assert len({len(numbers) for numbers in repeats.values()}) == 1
        assert all(numbers == list(range(len(numbers))) for numbers in repeats.values())
        counts.add(len(repeats[2]))
    assert min(counts) == 2
    assert max(counts) > 2
    assert not of_kind(events, NotReached)


@pytest.mark.parametrize("mode", ["to_ratio", "to_error"])
def test_the_time_lies_within_what_was_said(mode, request):
    stored, events = request.getfixturevalue(mode)
    (started,), (ended,) = of_kind(events, ScanStarted), of_kind(events, ScanEnded)
    least_s, longest_s = span_s(stored.recipe, stored.rig)
    assert (started.points, started.readings, started.expected_duration_s) == (11, None, longest_s)
    assert least_s * 0.98 < ended.bench_duration_s < longest_s


@pytest.mark.parametrize("readings", [TO_RATIO, TO_ERROR])
def test_the_time_left_learns_how_little_directions_need(tmp_path, readings):
    """Directions that are all alike, so that those behind tell what lies ahead."""
    _, events = run(tmp_path, readings, exit={"start_deg": 4.0, "stop_deg": 6.0, "step_deg": 0.1})
    (started,), (ended,) = of_kind(events, ScanStarted), of_kind(events, ScanEnded)
    assert started.expected_duration_s > 2 * ended.bench_duration_s, "else there is nothing to learn"
    for event in of_kind(events, StepStarted):
        if event.elapsed_s > 0.5 * ended.bench_duration_s:
            truly_left_s = ended.bench_duration_s - event.elapsed_s
            assert abs(event.time_left_s - truly_left_s) < 0.1 * ended.bench_duration_s


@pytest.mark.parametrize("mode", ["to_ratio", "to_error"])
def test_the_fit_finds_the_sample(mode, request):
    stored, _ = request.getfixturevalue(mode)
    for name in ("sigma", "n", "k"):
        found = stored.fit.parameters[name]
        assert abs(found.value - stored.truth[name]) < 3 * found.stderr


@pytest.mark.parametrize("readings", [TO_RATIO, TO_ERROR])
def test_same_seed_same_readings(tmp_path, readings, request):
    for name in ("one", "other"):
        (tmp_path / name).mkdir()
    one, other = (
        run(tmp_path / name, readings, exit={"start_deg": 0, "stop_deg": 10, "step_deg": 5})[0]
        for name in ("one", "other")
    )
    assert one.readings == other.readings


@pytest.mark.parametrize(
    ("readings", "what"),
    [
        (TO_RATIO | {"at_most": 3}, "slot 2 signal-to-noise "),
        (TO_ERROR | {"at_most": 3}, "after 3 readings in every slot, ± 0.005 wanted"),
    ],
)
def test_what_was_not_reached_is_told_while_it_runs_at_its_end_and_ever_after(tmp_path, readings, what):
    stored, events = run(tmp_path, readings, exit=None, exit_deg=[0.0, 4.0, 40.0, 60.0])
    told = of_kind(events, NotReached)
    assert [event.point for event in told] == [0, 1]
    assert what in told[0].what
    (doubted,) = of_kind(events, ScanDoubted)
    assert "was not reached at points 0 to 1 (2 of 4)" in doubted.doubts[0]
    assert measured(stored.folder).doubts == doubted.doubts
    stream = io.StringIO()
    with PlainConsole(LastingStream(stream)) as console:
        for event in events:
            console(event)
    assert f"note: not reached: {told[0].what}" in stream.getvalue()
    assert "warning: What was wanted" in stream.getvalue()
    said = CliRunner().invoke(cli, ["fit", str(stored.folder)])
    assert "was not reached at points 0 to 1" in said.output


def test_readings_that_scatter_by_more_than_the_rig_file_says_are_told(tmp_path):
    noise = {"read_w": 1.0e-11, "shot": True}
    _, events = run(tmp_path, TO_ERROR, noise=noise, exit={"start_deg": 0, "stop_deg": 10, "step_deg": 5})
    (doubted,) = of_kind(events, ScanDoubted)
    assert "times as much as the noise in the rig file says" in doubted.doubts[0]


@pytest.mark.parametrize(
    ("readings", "said"), [(TO_RATIO, "signal-to-noise 200"), (TO_ERROR, "the DoLP is known to ± 0.005")]
)
def test_check_tells_the_least_and_the_longest_time(tmp_path, readings, said):
    first, second, *_ = describe_plan(load_recipe(write(tmp_path, readings))).splitlines()
    assert f": 11 directions, 2 to 60 readings in every slot until {said}, " in first
    assert second.startswith("with the most readings: 11 directions, 55 steps, 3300 readings, ")


@pytest.mark.parametrize("mode", ["to_ratio", "to_error"])
def test_its_documents_end_with_success_and_those_of_a_part_do_not(mode, request):
    stored, _ = request.getfixturevalue(mode)
    *_, (name, stop) = run_documents(stored.folder)
    assert (name, stop["exit_status"]) == ("stop", "success")


def test_a_reference_is_read_until_the_ratio_too_and_closes_a_scan_in_rounds(tmp_path):
    reference = {"exit_deg": 50.0, "every_points": 2}
    stored, _ = run(tmp_path, TO_ERROR, reference=reference, exit={"start_deg": 0, "stop_deg": 20, "step_deg": 10})
    places = [place[:2] for place, _ in stays(stored.readings)]
    assert places[0] == (0, "reference")
    assert places[-1] == (2, "reference")
    assert sum(kind == "reference" for _, kind in places) == 3
    assert_allclose([point.dolp_stderr <= 0.005 for point in stored.points], np.ones(3))
