"""A scan that was cut anywhere and resumed is the scan that was not cut, bit for bit."""

import shutil

import h5py
import pytest

import goniometer
from acquisition.events import StepStarted
from acquisition.journal import FILE_NAME, Journal
from acquisition.readings import Reading
from goniometer.errors import DeviceFaultError, ScanInterrupted
from goniometer.fitting.command import fit_one
from goniometer.load_files import load_recipe
from goniometer.planning import plan
from goniometer.resume_run import resume

READINGS = 5 * 5 * 2 + 3 * 2 + 2
"""Of five directions in five slots, three references, and the one that closes the scan."""


@pytest.mark.usefixtures("no_results")
@pytest.mark.parametrize("part", range(4))
def test_after_any_reading(part, whole, cut, rows):
    expected = rows(whole)
    assert len(expected) == READINGS
    for readings in range(part, READINGS, 4):
        folder = cut(whole, readings, str(readings))
        assert not resume(folder, speed="max", live_fit=False).was_finished
        assert rows(folder) == expected, f"cut after {readings} readings"
        shutil.rmtree(folder)


@pytest.mark.usefixtures("no_results")
@pytest.mark.parametrize("every", [3, pytest.param(1, marks=pytest.mark.long)])
def test_after_any_reading_of_directions_that_are_swept_together(every, recipe, tmp_path, cut, rows):
    """Three and the ten readings of a slot's sweep have no divisor in common: every place in a sweep is hit."""
    path = recipe(step_deg=1, stop_deg=4, reference="")
    setup = load_recipe(path)
    steps = plan(setup.recipe, setup.rig)
    assert [step.point for step in steps[:10]] == [0, 1, 2, 3, 4, 4, 3, 2, 1, 0]
    run = goniometer.run(path, speed="max", out=tmp_path / "runs", live_fit=False).folder
    for readings in range(0, 50, every):
        folder = cut(run, readings, str(readings))
        resume(folder, speed="max", live_fit=False)
        assert rows(folder) == rows(run), f"cut after {readings} readings"


@pytest.mark.parametrize("readings", [1, 17, 30, READINGS - 1, READINGS])
def test_every_result_is_the_same(readings, whole, cut, assert_same_results):
    folder = cut(whole, readings)
    assert not resume(folder, speed="max").was_finished
    assert_same_results(folder, whole)


@pytest.mark.usefixtures("no_results")
def test_cut_again_and_again(whole, cut, rows, interrupted_at):
    folder, times = cut(whole, 3), 0
    while True:
        interrupted_at(200 + 25 * times)  # a little farther each time, so that it ends
        before = len(rows(folder))
        try:
            resume(folder, speed="max", live_fit=False)
        except ScanInterrupted:
            times += 1
            assert len(rows(folder)) >= before
        else:
            break
    assert times > 5
    assert rows(folder) == rows(whole)
    with Journal.open(folder / FILE_NAME) as journal:
        assert len(journal.interruptions()) == times + 1


@pytest.mark.usefixtures("no_results")
@pytest.mark.parametrize("name", ["iron_60deg", "iron_slider", "iron_thorlabs"])
def test_other_devices(name, tmp_path, cut, rows, root):
    """Sliders, rotators that miss their targets a little, stages that are homed before every scan."""
    text = (root / "recipes" / f"{name}.yaml").read_text().replace("../", f"{root.as_posix()}/")
    path = tmp_path / "short.yaml"
    path.write_text(text.replace("stop_deg: 60, step_deg: 1", "stop_deg: 40, step_deg: 20"))
    run = goniometer.run(path, speed="max", out=tmp_path / "runs", live_fit=False).folder
    count = len(rows(run))
    for readings in range(1, count, 5):
        folder = cut(run, readings, str(readings))
        resume(folder, speed="max", live_fit=False)
        assert [row[:4] + row[5:11] for row in rows(folder)] == [row[:4] + row[5:11] for row in rows(run)]
        assert [row[11] for row in rows(folder)] == [row[11] for row in rows(run)]


def test_the_time_left_is_that_of_what_is_missing(whole, recipe, cut):
    setup, events = load_recipe(recipe()), []
    steps = plan(setup.recipe, setup.rig)
    resume(cut(whole, 31), speed="max", live_fit=False, subscribers=[events.append])
    begun = [event for event in events if isinstance(event, StepStarted)]
    assert begun[0].elapsed_s == 0.0
    assert begun[0].time_left_s == pytest.approx(sum(step.duration_s for step in steps[15:]))
    assert events[0].expected_duration_s == begun[0].time_left_s
    assert begun[-1].time_left_s == pytest.approx(steps[-1].duration_s, rel=0.1)


def test_whoever_subscribes_is_told_the_whole_scan(whole, cut):
    events = []
    resume(cut(whole, 20), speed="max", live_fit=False, subscribers=[events.append])
    names = [type(event).__name__ for event in events]
    assert names.count("ReadingStored") == READINGS
    assert names.count("PointReduced") == 5
    assert events[0].notes[0].startswith(f"resumed: 20 readings are there, {READINGS - 20} are missing")


def test_the_journal_tells_when_and_why(whole, cut, interrupted_at):
    folder = cut(whole, 20)
    interrupted_at(800)
    with pytest.raises(ScanInterrupted):
        resume(folder, speed="max", live_fit=False)
    interrupted_at(0)
    resume(folder, speed="max", live_fit=False)
    with Journal.open(folder / FILE_NAME) as journal:
        first, second = journal.interruptions()
        assert "stopped" not in journal.about()
    assert (first.readings, first.why) == (20, None)
    assert "the program was killed, or the power failed" in str(first)
    assert second.readings > 20
    assert second.why == "Ctrl-C"
    with h5py.File(folder / "scan.nxs") as file:
        text = file["entry/provenance/interruptions/data"][()].decode()
    assert text == f"{first}\n{second}"
    assert {str(first), str(second)} <= set(fit_one(folder).notes)


class TestTimeThatIsLost:
    """On a bench whose clock went on, as every real one."""

    def test_the_lamp_is_read_anew_before_anything_else(self, whole, cut, rows):
        folder = cut(whole, 30)
        done = resume(folder, speed=400, live_fit=False).run
        taken = rows(folder)
        assert taken[:30] == rows(whole)[:30]
        besides = [row for row in taken if not row[-1]]
        assert [row[2] for row in besides] == ["reference"] * 2
        assert taken[30:32] == besides
        planned = [(*row[:4], row[8]) for row in taken if row[-1]]
        assert planned == [(*row[:4], row[8]) for row in rows(whole)][:30] + [
            (row[0] + 2, *row[1:4], row[8]) for row in rows(whole)[30:]
        ]
        assert all(
            before.time_s < after.time_s for before, after in zip(done.readings, done.readings[1:], strict=False)
        )
        assert len(done.points) == 5

    @pytest.mark.usefixtures("no_results")
    def test_readings_besides_the_plan_stand_for_none_of_it(self, whole, cut, rows):
        """Cut once more, right behind the reference that closes the scan would otherwise be taken for it."""
        folder = cut(whole, READINGS - 3)
        resume(folder, speed=400, live_fit=False)
        again = cut(folder, READINGS - 1, "again")
        resume(again, speed=400, live_fit=False)
        planned = [(*row[1:4], row[8]) for row in rows(again) if row[-1]]
        assert planned == [(*row[1:4], row[8]) for row in rows(whole)]

    def test_other_light_is_refused(self, whole, cut, rows, monkeypatch):
        folder = cut(whole, 30)
        before = rows(folder)
        darker = Reading.__init__

        def init(self, *arguments, **values):
            if "power_w" in values:
                values["power_w"] *= 0.5
            darker(self, *arguments, **values)

        monkeypatch.setattr(Reading, "__init__", init)
        with pytest.raises(DeviceFaultError, match=r"detector: it reads .* W are stored from before the scan"):
            resume(folder, speed="max", live_fit=False)
        assert rows(folder) == before
