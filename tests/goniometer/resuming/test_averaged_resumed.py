"""A scan that averages until something is reached, cut anywhere: what it has reached is not measured again."""

import sqlite3
from contextlib import closing

import pytest

from acquisition.journal import FILE_NAME
from goniometer.errors import JournalError
from goniometer.resume_run import resume

TO_RATIO = "{at_least: 2, at_most: 40, signal_to_noise: 150}"
TO_ERROR = "{at_least: 2, at_most: 20, dolp_error: 0.006}"


EVERY = pytest.mark.parametrize("every", [6, pytest.param(1, marks=pytest.mark.long)])
"""Cut after every so many readings; stays have two, and some three."""


@pytest.fixture(scope="module")
def to_ratio(recipe, noted_in, tmp_path_factory):
    return noted_in(recipe(step_deg=20, stop_deg=20, readings=TO_RATIO), tmp_path_factory.mktemp("ratio"))


@pytest.fixture(scope="module")
def to_error(recipe, noted_in, tmp_path_factory):
    return noted_in(recipe(step_deg=20, stop_deg=20, readings=TO_ERROR), tmp_path_factory.mktemp("error"))


@pytest.fixture
def cut_after(cut):
    """A copy after so many readings; what was decided behind the last of them may be noted already, or not."""

    def copy(whole, readings, *, is_noted):
        run, noted = whole
        unknown = [key for key, after in noted.items() if after > readings or (after == readings and not is_noted)]
        return cut(run, readings, f"{readings} {is_noted}", unknown)

    return copy


@EVERY
@pytest.mark.usefixtures("no_results")
def test_to_a_ratio_after_any_reading(every, to_ratio, cut_after, rows):
    expected = rows(to_ratio[0])
    assert {row[3] for row in expected} == {0, 1, 2}, "stays of different lengths"
    for readings in range(every // 2 + 1, len(expected) + 1, every):
        folder = cut_after(to_ratio, readings, is_noted=True)
        resume(folder, speed="max", live_fit=False)
        assert rows(folder) == expected, f"cut after {readings} readings"


@EVERY
@pytest.mark.usefixtures("no_results")
def test_in_rounds_after_any_reading(every, to_error, cut_after, rows):
    expected, noted = rows(to_error[0]), set(to_error[1].values())
    assert len(noted) == 3, "a direction has a second round"
    cuts = [(readings, True) for readings in range(every // 2 + 1, len(expected) + 1, every)] + [
        (readings, False) for readings in noted
    ]
    for readings, is_noted in cuts:
        folder = cut_after(to_error, readings, is_noted=is_noted)
        resume(folder, speed="max", live_fit=False)
        assert rows(folder) == expected, f"cut after {readings} readings"


@pytest.mark.parametrize(("mode", "readings"), [("to_ratio", 12), ("to_error", 15)])
def test_every_result_is_the_same(mode, readings, request, cut_after, assert_same_results):
    whole = request.getfixturevalue(mode)
    folder, events = cut_after(whole, readings, is_noted=True), []
    assert not resume(folder, speed="max", subscribers=[events.append]).was_finished
    assert events[0].notes[0].startswith(f"resumed: {readings} readings are there; interrupted")
    assert_same_results(folder, whole[0])


@pytest.mark.parametrize("mode", ["to_ratio", "to_error"])
def test_where_time_is_lost_no_reading_is_lost_or_taken_twice(mode, request, cut_after, rows):
    """The noise is another one then, and so are the numbers of readings behind the cut."""
    whole = request.getfixturevalue(mode)
    folder = cut_after(whole, 15, is_noted=True)
    result = resume(folder, speed=400, live_fit=False).run
    again = rows(folder)
    assert again[:15] == rows(whole[0])[:15]
    assert [row[2] for row in again if not row[-1]] == ["reference", "reference"]
    assert len({row[1:4] + row[8:9] for row in again if row[-1]}) == sum(row[-1] for row in again)
    assert len(result.points) == 2
    once_more = cut_after((folder, {}), len(again) - 4, is_noted=True)
    resume(once_more, speed=400, live_fit=False)
    assert rows(once_more)[: len(again) - 4] == again[:-4]


@pytest.mark.usefixtures("no_results")
def test_nothing_is_moved_when_nothing_is_missing(to_error, cut_after, rows):
    folder, events = cut_after(to_error, 1000, is_noted=True), []
    resume(folder, speed="max", subscribers=[events.append])
    assert not [event for event in events if type(event).__name__ == "ScanStarted"]
    assert rows(folder) == rows(to_error[0])


def test_rounds_that_nobody_noted_are_refused(to_error, cut_after, rows):
    """As in a journal of an earlier version."""
    folder = cut_after((to_error[0], dict.fromkeys(to_error[1], 1000)), 20, is_noted=False)
    before = rows(folder)
    with pytest.raises(JournalError, match=r"does not say how the scan had decided to go on.*Nothing was moved"):
        resume(folder, speed="max")
    assert rows(folder) == before


def test_a_stay_that_ended_too_soon_is_a_gap(to_ratio, cut_after):
    folder = cut_after(to_ratio, 20, is_noted=True)
    with closing(sqlite3.connect(folder / FILE_NAME)) as connection:
        connection.execute("DELETE FROM readings WHERE id = 4")
        connection.commit()
    with pytest.raises(JournalError, match=r"Reading 4 of the plan is missing"):
        resume(folder, speed="max")
