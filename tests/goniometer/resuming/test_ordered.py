"""A run in which a person asked for something else than the plan, and that was cut short afterwards."""

import json
import sqlite3
from contextlib import closing

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acquisition.control import ScanControl
from acquisition.events import ReadingStored
from acquisition.journal import FILE_NAME, Journal
from acquisition.orders import ORDERED
from goniometer.errors import JournalError
from goniometer.load_files import load_recipe
from goniometer.resume_run import resume
from goniometer.run_folder import measured


def order(folder, **orders):
    with closing(sqlite3.connect(folder / FILE_NAME)) as connection:
        text = json.dumps({"skipped": [], "exposure_s": None} | orders)
        connection.execute("INSERT INTO about VALUES (?, ?)", (ORDERED, text))
        connection.commit()


def test_an_exposure_that_was_changed_holds_for_the_rest(whole, cut, recipe):
    folder = cut(whole, 20)
    exposure_s = 2 * load_recipe(recipe()).recipe.exposure_s
    order(folder, exposure_s=exposure_s)
    run = resume(folder, speed="max", live_fit=False).run
    before, after = run.readings[:20], run.readings[20:]
    assert {reading.exposure_s for reading in before} == {exposure_s / 2}
    assert {reading.exposure_s for reading in after} == {exposure_s}
    assert run.fit is not None


def skip_at(number):
    """A control, and a subscriber that skips what is being measured when so many readings are stored."""
    control, stored = ScanControl(), []

    def listen(event):
        if isinstance(event, ReadingStored):
            stored.append(event)
            if len(stored) in number:
                control.skip()

    return {"control": control, "subscribers": [listen]}


def places(taken):
    """Point, kind, repeat and slot of what the plan has."""
    return [(*row[1:4], row[8]) for row in taken if row[-1]]


SKIPS = {
    "reading by reading": ({"step_deg": 20, "stop_deg": 40}, {15}),
    "the first and the last": ({"step_deg": 20, "stop_deg": 40}, {3, 15}),
    "swept together": ({"step_deg": 1, "stop_deg": 2, "reference": ""}, {5}),
    "in its first round": (
        {"step_deg": 20, "stop_deg": 20, "readings": "{at_least: 2, at_most: 20, dolp_error: 0.006}"},
        {6},
    ),
    "to a ratio": (
        {"step_deg": 20, "stop_deg": 20, "readings": "{at_least: 2, at_most: 40, signal_to_noise: 150}"},
        {8},
    ),
}


@pytest.mark.usefixtures("no_results")
@pytest.mark.parametrize("case", SKIPS)
@pytest.mark.parametrize("every", [9, pytest.param(1, marks=pytest.mark.long)])
def test_what_was_skipped_is_not_missing(case, every, recipe, noted_in, tmp_path, cut, rows):
    changes, skips = SKIPS[case]
    run, noted = noted_in(recipe(**changes), tmp_path / "runs", **skip_at(skips))
    expected, known = rows(run), max(skips) + 1  # the reading at hand is stored before the skip is noted
    for readings in range(known, len(expected) + 1, every):
        folder = cut(run, readings, str(readings), [key for key, after in noted.items() if after > readings])
        resume(folder, speed="max", live_fit=False)
        assert rows(folder)[:readings] == expected[:readings]
        if "readings" not in changes:
            assert places(rows(folder)) == places(expected), f"cut after {readings} readings"
        else:
            assert len(set(places(rows(folder)))) == len(places(rows(folder)))
            assert {row[1] for row in rows(folder)} == {row[1] for row in expected}


def test_the_results_of_a_run_with_a_skip_are_those_of_an_uninterrupted_one(recipe, noted_in, tmp_path, cut):
    run, _ = noted_in(recipe(step_deg=20, stop_deg=40), tmp_path / "runs", **skip_at({15}))
    done, events = cut(run, 18), []
    result = resume(done, speed="max", live_fit=False, subscribers=[events.append]).run
    whole = measured(run)
    assert [point.point for point in result.points] == [point.point for point in whole.points] == [0, 2]
    for point, expected in zip(result.points, whole.points, strict=True):
        assert_allclose(point.stokes, expected.stokes, atol=4 * np.sqrt(expected.covariance[0, 0]))
    missing = sum(row.is_planned for row in Journal.open(run / FILE_NAME).taken()) - 18
    assert f"{missing} are missing" in events[0].notes[0]
    assert result.doubts[0].startswith("The rest of point 1 was skipped")


def test_a_gap_before_a_skip_is_refused(recipe, noted_in, tmp_path, cut, rows):
    run, _ = noted_in(recipe(step_deg=20, stop_deg=40), tmp_path / "runs", **skip_at({15}))
    folder = cut(run, 18)
    with closing(sqlite3.connect(folder / FILE_NAME)) as connection:
        connection.execute("DELETE FROM readings WHERE id = 14")
        connection.commit()
    with pytest.raises(JournalError, match=r"Reading 14 of the plan is missing"):
        resume(folder, speed="max")
    assert len(rows(folder)) == 17
