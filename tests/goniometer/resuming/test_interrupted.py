"""Ctrl-C at every look of a scan: the bench is at rest, the journal whole, and the scan goes on where it was."""

import pytest

import goniometer
import goniometer.bench
from acquisition.journal import FILE_NAME, Journal
from goniometer.errors import ScanInterrupted
from goniometer.resume_run import resume


@pytest.fixture
def bench_at_its_end(monkeypatch):
    """Which axes still moved when the last scan let go of the bench; its wheel has no command to stop."""
    found = {}
    stop = goniometer.bench.SimulatedBench.stop

    def looked_at(self):
        now_s = self.clock.now()
        found["moving"] = [role for role, axis in self.world.axes.items() if axis.is_moving(now_s)]
        stop(self)

    monkeypatch.setattr(goniometer.bench.SimulatedBench, "stop", looked_at)
    return found


@pytest.fixture(scope="module")
def tiny(recipe):
    return recipe(step_deg=60, readings=1)


@pytest.fixture(scope="module")
def expected(tiny, tmp_path_factory):
    return goniometer.run(tiny, speed="max", out=tmp_path_factory.mktemp("expected"), live_fit=False).folder


def interrupted(number, tiny, tmp_path, interrupted_at, bench_at_its_end, rows, expected):
    """End a scan at its `number`-th look, see to what is left, and resume it; false when it ends before that look."""
    out, events = tmp_path / str(number), []
    interrupted_at(number)
    ended = None
    try:
        goniometer.run(tiny, speed="max", out=out, live_fit=False, subscribers=[events.append])
    except ScanInterrupted as error:
        ended = error.reason, error.exit_code
    interrupted_at(0)
    if ended is None:
        return False
    assert ended == ("Ctrl-C", 130)
    assert bench_at_its_end["moving"] == []
    runs = list(out.iterdir())
    if not (runs and (runs[0] / FILE_NAME).exists()):
        return True  # before there was a journal: nothing to resume
    run = runs[0]
    stored = rows(run)
    assert len(stored) == sum(type(event).__name__ == "ReadingStored" for event in events)
    assert stored == rows(expected)[: len(stored)]
    with Journal.open(run / FILE_NAME) as journal:
        assert not journal.damage
        assert journal.about().get("stopped", "Ctrl-C") == "Ctrl-C"
    resume(run, speed="max", live_fit=False)
    assert rows(run) == rows(expected)
    return True


@pytest.fixture
def at_look(tiny, tmp_path, interrupted_at, bench_at_its_end, rows, expected):
    def at(number):
        return interrupted(number, tiny, tmp_path, interrupted_at, bench_at_its_end, rows, expected)

    return at


@pytest.mark.usefixtures("no_results")
@pytest.mark.parametrize("part", range(3))
def test_at_many_looks(part, at_look):
    """Every 61st, from different beginnings; a move, a reading, an exchange are all hit many times."""
    looks = 20 * part + 1
    while at_look(looks):
        looks += 61
    assert looks > 400


@pytest.mark.long
@pytest.mark.timeout(900)
@pytest.mark.usefixtures("no_results")
def test_at_every_look(at_look):
    looks = 1
    while at_look(looks):
        looks += 1
    assert looks > 400
