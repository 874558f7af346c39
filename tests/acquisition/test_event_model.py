"""A run as documents of the event model: valid, complete, the same each time, and true to what was measured."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from datetime import datetime
from pathlib import Path

import event_model
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import goniometer
from acquisition.event_model import RunEnd, documents, write_documents
from acquisition.journal import FILE_NAME, STOPPED, Journal
from acquisition.orders import ORDERED
from goniometer.bluesky.export import export_event_model, run_documents
from goniometer.errors import JournalError

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A short scan of iron."""
    recipe = (ROOT / "recipes" / "iron_60deg.yaml").read_text(encoding="utf-8")
    recipe = recipe.replace("../", f"{ROOT.as_posix()}/").replace(
        "stop_deg: 60, step_deg: 1", "stop_deg: 60, step_deg: 20"
    )
    path = tmp_path_factory.mktemp("recipe") / "iron.yaml"
    path.write_text(recipe, encoding="utf-8")
    return goniometer.run(path, out=path.parent, speed="max", live_fit=False)


def cut_short(run, folder, readings):
    """The journal of a run that was killed after so many readings."""
    folder.mkdir()
    about = {key: text for key, text in run.about.items() if key not in ("format", "ended")}
    with Journal.create(folder / FILE_NAME, about | {"a/b.c": "no such key is allowed"}) as stored:
        for reading in run.readings[:readings]:
            stored.append(reading)
    return folder


def of(kind, heard):
    return [document for other, document in heard if other == kind]


def validated(of_run):
    """Documents that a consumer of Bluesky's accepts one by one, in their order."""
    heard = list(of_run)
    router = event_model.RunRouter([lambda kind, document: ([], [])])
    for kind, document in heard:
        event_model.schema_validators[event_model.DocumentNames[kind]].validate(document)
        router(kind, document)
    return heard


def test_the_documents_are_valid_and_belong_together(run):
    heard = validated(run_documents(run.folder))
    start, stop = heard[0][1], heard[-1][1]
    assert stop["run_start"] == start["uid"]
    assert stop["num_events"] == {"primary": len(run.readings), "stokes": len(run.points)}
    assert stop["exit_status"] == "success"
    assert len({document["uid"] for _, document in heard}) == len(heard)
    for descriptor in of("descriptor", heard):
        assert descriptor["run_start"] == start["uid"]
        events = [event for event in of("event", heard) if event["descriptor"] == descriptor["uid"]]
        assert [event["seq_num"] for event in events] == list(range(1, len(events) + 1))
        assert all(list(event["data"]) == list(descriptor["data_keys"]) for event in events)
    assert list(run_documents(run.folder / FILE_NAME)) == heard


def test_the_start_says_what_was_measured_when_and_from_what(run):
    start = next(run_documents(run.folder))[1]
    assert start["sample"] == {"name": "iron at 60 degrees"}
    assert start["recipe"]["incidence_deg"] == 60
    assert start["provenance"]["rig"] == run.about["rig"]
    begun = datetime.strptime(run.folder.name[:19], "%Y-%m-%dT%H-%M-%S").timestamp()
    assert start["time"] == begun


def test_the_events_hold_every_reading_and_every_point(run):
    heard = validated(run_documents(run.folder))
    primary, stokes = of("descriptor", heard)
    assert [primary["name"], stokes["name"]] == ["primary", "stokes"]
    readings = [event for event in of("event", heard) if event["descriptor"] == primary["uid"]]
    for reading, event in zip(run.readings, readings, strict=True):
        data = event["data"]
        assert (data["power_w"], data["exit_deg"], data["slot"]) == (reading.power_w, reading.exit_deg, reading.slot)
        assert (data["kind"], data["analyzer_deg"]) == (reading.kind, reading.analyzer_deg)
        assert_allclose(event["time"] - heard[0][1]["time"], reading.time_s, atol=1e-6)
    points = [event for event in of("event", heard) if event["descriptor"] == stokes["uid"]]
    for point, event in zip(run.points, points, strict=True):
        assert_array_equal(event["data"]["stokes"], point.stokes)
        assert_array_equal(event["data"]["covariance"], point.covariance)
        assert event["data"]["dolp"] == point.dolp
    keys = primary["data_keys"]
    assert [keys[name]["dtype"] for name in ("power_w", "slot", "kind", "analyzer_deg")] == [
        "number",
        "integer",
        "string",
        "number",
    ]
    assert [keys[name].get("units") for name in ("power_w", "exit_deg", "exposure_s", "slot")] == [
        "W",
        "deg",
        "s",
        None,
    ]
    assert stokes["data_keys"]["covariance"]["shape"] == [3, 3]
    assert stokes["data_keys"]["covariance"]["units"] == "1/sr^2"


@pytest.mark.parametrize(("readings", "points"), [(0, 0), (7, 0), (15, 1), (59, 4)])
def test_a_run_that_was_cut_short_says_so(run, tmp_path, readings, points):
    heard = validated(run_documents(cut_short(run, tmp_path / "2026-01-31T12-00-00-iron", readings)))
    stop = heard[-1][1]
    assert stop["exit_status"] == "abort"
    assert stop["reason"] == "the program was killed, or the power failed"
    assert stop["num_events"] == {
        stream: count for stream, count in (("primary", readings), ("stokes", points)) if count
    }
    assert heard[0][1]["provenance"]["a_b_c"] == "no such key is allowed"
    assert stop["time"] >= heard[0][1]["time"] == datetime(2026, 1, 31, 12).timestamp()


def test_why_a_run_ended_and_what_was_skipped_is_in_its_documents(run, tmp_path):
    stopped = cut_short(run, tmp_path / "2026-01-31T12-00-00-iron", 30)
    with Journal.go_on(stopped / FILE_NAME) as stored:
        stored.remember(STOPPED, "the lid was open")
    assert of("stop", run_documents(stopped))[0]["reason"] == "the lid was open"
    assert of("stop", run_documents(run.folder))[0]["exit_status"] == "success"
    skipped = cut_short(run, tmp_path / "2026-01-31T12-00-00-iron-2", 60)
    with Journal.go_on(skipped / FILE_NAME) as stored:
        stored.remember(ORDERED, json.dumps({"skipped": [1]}))
    left = [event["data"]["point"] for event in of("event", run_documents(skipped)) if "dolp" in event["data"]]
    assert left == [0, 2, 3]


def test_two_runs_of_one_recipe_are_two(run, tmp_path):
    first, second = (cut_short(run, tmp_path / f"2026-01-31T12-00-00-iron{suffix}", 3) for suffix in ("", "-2"))
    uids = [{document["uid"] for _, document in run_documents(folder)} for folder in (first, second)]
    assert not uids[0] & uids[1]


def test_a_folder_that_was_renamed_is_refused(run, tmp_path):
    with pytest.raises(JournalError, match=r"does not say when its run began.*Give the folder its name back"):
        run_documents(cut_short(run, tmp_path / "iron", 3))


def test_the_file_is_lines_of_strict_json(run, tmp_path, capsys):
    def refuse(constant):
        raise AssertionError(f"{constant} is no JSON")

    export_event_model(run.folder, tmp_path / "run.jsonl")
    text = (tmp_path / "run.jsonl").read_text(encoding="utf-8")
    lines = [json.loads(line, parse_constant=refuse) for line in text.splitlines()]
    assert [tuple(line) for line in lines] == [tuple(document) for document in run_documents(run.folder)]
    export_event_model(run.folder, None)
    assert capsys.readouterr().out == text


def test_what_is_not_a_number_is_null(run):
    points = [replace(run.points[0], dolp=math.nan), run.points[1]]
    provenance = {"recipe": "iron"}
    of_run = documents(
        name="run",
        begun_unix_s=0.0,
        recipe=run.recipe,
        readings=run.readings,
        points=points,
        end=RunEnd("fail", "the lamp broke"),
        provenance=provenance,
    )
    heard = validated(of_run)
    assert [event["data"]["dolp"] for event in of("event", heard)[-2:]] == [None, run.points[1].dolp]
    assert (heard[-1][1]["exit_status"], heard[-1][1]["reason"]) == ("fail", "the lamp broke")


def test_a_file_that_cannot_be_written_whole_is_not_written(run, tmp_path):
    with pytest.raises(JournalError, match="cannot be written"):
        export_event_model(run.folder, tmp_path / "nowhere" / "run.jsonl")
    with pytest.raises(ValueError, match="not JSON compliant"):
        write_documents(tmp_path / "run.jsonl", [("event", {"dolp": math.nan})])
    assert not list(tmp_path.iterdir())
