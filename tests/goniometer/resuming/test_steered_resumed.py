"""A scan that decides by its fit where to measure and when to end, cut anywhere: it goes on with the fit of all."""

import sqlite3
from contextlib import closing

import pytest

from acquisition.control import ScanControl
from acquisition.decisions import Decisions
from acquisition.events import DirectionChosen, ReadingStored, ScanEnded, ScanStarted
from acquisition.journal import FILE_NAME, Journal
from acquisition.steering import spent_s
from goniometer.resume_run import resume

ADAPTIVE = "adaptive: true\nuntil: {sigma: 0.00001}\ntime_limit_s: 30\n"
PASSES = "until: {sigma: 0.00028}\ntime_limit_s: 80\n"
CALM = """
  - {effect: lamp_drift, relative_per_hour: 0.05}
  - {effect: encoder_noise, axis: detector_arm, stddev_deg: 0.0005}
"""


def steered(recipe, steering):
    """A recipe that fits what the scene holds, whose light may change a little less than in the others here."""
    path = recipe(step_deg=10, effects=CALM)
    path.write_text(path.read_text().replace("[specular, diffuse]", "[specular, diffuse, directional]") + steering)
    return path


@pytest.fixture(scope="module")
def adaptive(recipe, noted_in, tmp_path_factory):
    return noted_in(steered(recipe, ADAPTIVE), tmp_path_factory.mktemp("adaptive"))


@pytest.fixture(scope="module")
def in_passes(recipe, noted_in, tmp_path_factory):
    return noted_in(steered(recipe, PASSES), tmp_path_factory.mktemp("passes"))


@pytest.fixture
def cut_after(cut):
    """A copy after so many readings; what was decided behind the last of them may be noted already, or not."""

    def copy(whole, readings, *, is_noted):
        run, noted = whole
        unknown = [key for key, after in noted.items() if after > readings or (after == readings and not is_noted)]
        return cut(run, readings, f"{readings} {is_noted}", unknown)

    return copy


@pytest.mark.usefixtures("no_results")
@pytest.mark.parametrize("cuts", [2, pytest.param(1000, marks=pytest.mark.long)])
@pytest.mark.parametrize("mode", ["adaptive", "in_passes"])
def test_in_virtual_time_it_is_the_scan_that_was_not_cut(mode, cuts, request, cut_after, rows):
    """Every decision falls at the same time, by the same readings."""
    whole = request.getfixturevalue(mode)
    expected, noted = rows(whole[0]), set(whole[1].values())
    places = [(readings, True) for readings in range(len(expected), 0, -max(len(expected) // cuts, 1))]
    places += [(readings, False) for readings in sorted(noted - {0})[-1 if cuts == 2 else 0 :]]
    with Journal.open(whole[0] / FILE_NAME) as journal:
        ended = journal.about()["ended"]
    for readings, is_noted in places:
        folder = cut_after(whole, readings, is_noted=is_noted)
        resume(folder, speed="max", live_fit=False)
        assert rows(folder) == expected, f"cut after {readings} readings"
        with Journal.open(folder / FILE_NAME) as journal:
            assert journal.about()["ended"].split(":")[0] == ended.split(":")[0]


def test_the_scans_are_worth_cutting(adaptive, in_passes, rows):
    """One ends by its time limit and has chosen by its fit; one has passed its exit angles more than once."""
    with Journal.open(adaptive[0] / FILE_NAME) as journal:
        whys = [text for key, text in journal.about().items() if key.startswith("decision ")]
        assert journal.about()["ended"].startswith("time limit of 30 s")
    assert any("per second" in why for why in whys)
    with Journal.open(in_passes[0] / FILE_NAME) as journal:
        assert journal.about()["ended"].startswith("wanted standard errors reached")
    assert max(row[1] for row in rows(in_passes[0])) > 6


def test_a_time_limit_counts_the_time_of_the_bench_and_not_what_was_lost(adaptive, cut_after, rows):
    whole = rows(adaptive[0])
    half = len(whole) // 2
    folder, events = cut_after(adaptive, half, is_noted=True), []
    with closing(sqlite3.connect(folder / FILE_NAME)) as connection:  # a minute, before, between two other directions
        late = "UPDATE readings SET time_s = time_s + 60 WHERE id > 12"
        connection.execute(late)
        connection.execute("INSERT INTO about VALUES ('time lost after 12 readings', '60.0')")
        connection.commit()
    result = resume(folder, speed=30, live_fit=False, subscribers=[events.append]).run
    started, ended = (next(one for one in events if isinstance(one, kind)) for kind in (ScanStarted, ScanEnded))
    with Journal.open(folder / FILE_NAME) as journal:
        decisions = Decisions(journal.about)
        assert 0 < float(journal.about()[f"time lost after {half} readings"]) < 20, "to come back, and to compare"
        rest_s = 30 - (journal.taken()[half - 1].reading.time_s - 60 - decisions.of("0")["begun_s"])
        assert 22 < spent_s(decisions, result.readings[-1].time_s) < 60, "it is quick: a fit takes seconds of the bench"
    assert started.expected_duration_s == pytest.approx(rest_s, abs=0.1)
    assert ended.reason.startswith("time limit of 30 s")
    assert rows(folder)[12:half] == [(*row[:4], row[4] + 60, *row[5:]) for row in whole[12:half]]
    places = [row[1:4] + row[8:9] for row in rows(folder) if row[2] != "reference"]
    assert len(set(places)) == len(places)
    sigma = result.fit.parameters["sigma"]
    assert abs(sigma.value - result.truth["sigma"]) < 5 * sigma.stderr


def test_whoever_subscribes_is_told_each_choice_once(adaptive, cut_after, rows):
    events = []
    folder = cut_after(adaptive, len(rows(adaptive[0])) // 2, is_noted=True)
    resume(folder, speed="max", live_fit=False, subscribers=[events.append])
    chosen = [event for event in events if isinstance(event, DirectionChosen)]
    assert [event.point for event in chosen] == list(range(len(chosen)))
    assert all(event.why for event in chosen)


@pytest.mark.usefixtures("no_results")
def test_directions_that_were_skipped_keep_their_numbers(recipe, noted_in, tmp_path, cut_after, rows):
    control, stored = ScanControl(), []

    def listen(event):
        if isinstance(event, ReadingStored):
            stored.append(event)
        if isinstance(event, DirectionChosen) and event.point == 2:
            control.skip()  # what is at hand then is the direction before
        if len(stored) == 30:
            control.skip()

    path = steered(recipe, "until: {sigma: 0.00001}\ntime_limit_s: 20\n")
    whole = noted_in(path, tmp_path / "runs", control=control, subscribers=[listen])
    expected = rows(whole[0])
    for readings in (33, len(expected)):
        folder = cut_after(whole, readings, is_noted=True)
        resume(folder, speed="max", live_fit=False)
        assert rows(folder)[:readings] == expected[:readings]
        assert {row[1] for row in expected} <= {row[1] for row in rows(folder)}
        places = [row[1:4] + row[8:9] for row in rows(folder) if row[2] != "reference"]
        assert len(set(places)) == len(places)
