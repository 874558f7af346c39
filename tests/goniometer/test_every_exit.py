"""Whatever a scan is asked, and whenever: its bench rests, its journal is whole, its exit code as documented."""

import signal
import sys
from contextlib import contextmanager
from pathlib import Path

import pytest
import yaml

import goniometer
from acquisition.control import ABORTED, ScanControl
from acquisition.events import ReadingStored, ScanEnded, Skipped
from acquisition.journal import FILE_NAME, Journal
from goniometer.assembly import connected
from goniometer.bench import BenchAccess, served_ports, simulate
from goniometer.errors import ReductionError, ScanInterrupted
from goniometer.load_files import load_recipe
from goniometer.planning import plan
from goniometer.run_folder import measured
from goniometer.run_results import Written

ROOT = Path(__file__).resolve().parents[2]
RIGS = ("iron_60deg", "iron_lock_in", "iron_retarder", "iron_rotating", "iron_slider", "iron_thorlabs")
CODES = {"abort": ABORTED, "SIGINT": 130, "SIGTERM": 143}
ASKED = ("pause", "skip", *CODES)


class At(ScanControl):
    """Counts the engine's looks, and does something at one of them."""

    def __init__(self, look, act):
        super().__init__()
        self.looks, self._look, self._act = 0, look, act

    def check(self):
        if self.looks == self._look:
            self._act(self)
        self.looks += 1
        super().check()


def act(asked):
    def doing(control):
        if asked == "pause":
            control.pause()
        elif asked == "skip":
            control.skip()
        elif asked == "abort":
            control.abort()
        else:
            signal.raise_signal(getattr(signal, asked))

    return doing


@contextmanager
def outliving(monkeypatch, setup):
    """The bench of a scan that can be asked when the scan has ended."""
    with simulate(setup.scene, "max") as bench:

        @contextmanager
        def access(setup, speed):
            yield BenchAccess(bench.clock, served_ports(setup.rig, bench), setup.scene_text)

        monkeypatch.setattr("goniometer.run_recipe.access", access)
        yield bench


@pytest.fixture
def short(tmp_path):
    def of(name, exit_deg=(0, 6)):
        recipe = yaml.safe_load((ROOT / "recipes" / f"{name}.yaml").read_text())
        recipe.pop("exit", None)
        recipe |= {"exit_deg": list(exit_deg), "readings": 12 if "analyzer_rotation" in recipe else 2}
        for key in ("rig", "scene"):
            recipe[key] = str((ROOT / "recipes" / recipe[key]).resolve())
        (tmp_path / f"{name}.yaml").write_text(yaml.safe_dump(recipe))
        return tmp_path / f"{name}.yaml"

    return of


def scan(monkeypatch, recipe, out, control):
    """Run a scan, and see that its bench rests and its journal holds what was shown; returns events and error."""
    setup, events, ended = load_recipe(recipe), [], None

    def see(event):
        events.append(event)
        if type(event).__name__ == "Paused":
            control.go_on()

    with outliving(monkeypatch, setup) as bench:
        monkeypatch.setattr("goniometer.run_recipe.write_results", lambda result: Written(()))
        try:
            goniometer.run(recipe, out=out, live_fit=False, subscribers=[see], control=control)
        except (ScanInterrupted, ReductionError) as error:
            ended = error
        with connected(setup.rig, served_ports(setup.rig, bench), bench.clock, None) as devices:
            movers = (*devices.axes.values(), devices.analyzer)
            assert not any(mover.is_moving() for mover in movers)
            before = [axis.motor_deg(bench.clock.now()) for axis in bench.world.axes.values()]
            bench.clock.sleep(0.5)
            assert [axis.motor_deg(bench.clock.now()) for axis in bench.world.axes.values()] == before
    return events, ended


def stored(out):
    (folder,) = out.iterdir()
    with Journal.open(folder / FILE_NAME) as journal:
        return folder, journal.readings(), journal.about()


def names(readings):
    return [(reading.point, reading.kind, reading.slot, reading.repeat) for reading in readings]


def ask_at(monkeypatch, recipe, out, asked, look):
    control = At(look, act(asked))
    events, ended = scan(monkeypatch, recipe, out, control)
    if control.looks <= look and not out.exists():
        return
    shown = [event.reading for event in events if isinstance(event, ReadingStored)]
    folder, readings, about = stored(out)
    assert names(readings) == names(shown)
    assert len(set(names(readings))) == len(readings)
    setup = load_recipe(recipe)
    planned = [
        (step.point, step.kind, step.target.slot, repeat)
        for step in plan(setup.recipe, setup.rig)
        for repeat in range(step.readings)
    ]
    if asked in CODES:
        assert isinstance(ended, ScanInterrupted)
        assert ended.exit_code == CODES[asked]
        assert names(readings) == planned[: len(readings)]
        is_over = any(isinstance(event, ScanEnded) and event.as_asked for event in events)
        assert ("ended" in about) == is_over
        assert is_over or str(ended) in about["stopped"]
        return
    assert about["ended"] == "finished"
    skipped = {event.point for event in events if isinstance(event, Skipped)}
    assert set(planned) - set(names(readings)) <= {name for name in planned if name[0] in skipped}
    if asked == "pause":
        assert names(readings) == planned
        assert ended is None
        return
    left = measured(folder)
    assert {point.point for point in left.points} == {name[0] for name in planned} - skipped
    assert [f"The rest of point {point} was skipped" in left.doubts[0] for point in skipped] == [True] * len(skipped)


def all_looks(monkeypatch, recipe, tmp_path):
    control = At(-1, lambda control: None)
    scan(monkeypatch, recipe, tmp_path / "counted", control)
    return control.looks


@pytest.mark.skipif(sys.platform == "win32", reason="signals of this kind exist on POSIX only")
@pytest.mark.parametrize("name", ["iron_60deg", "iron_rotating"])
@pytest.mark.parametrize("asked", ASKED)
def test_at_every_part_of_a_scan(monkeypatch, tmp_path, short, asked, name):
    recipe = short(name)
    looks = all_looks(monkeypatch, recipe, tmp_path)
    assert looks > 100
    offset = ASKED.index(asked)
    for look in range(offset, looks, looks // 12 + 1):
        ask_at(monkeypatch, recipe, tmp_path / f"{asked}{look}", asked, look)


@pytest.mark.skipif(sys.platform == "win32", reason="signals of this kind exist on POSIX only")
@pytest.mark.long
@pytest.mark.parametrize("name", RIGS)
@pytest.mark.parametrize("asked", ASKED)
@pytest.mark.timeout(1800)
def test_at_every_look_on_every_rig(monkeypatch, tmp_path, short, asked, name):
    """Or at a thousand, on rigs whose detector is asked more often than that in a short scan."""
    recipe = short(name)
    looks = all_looks(monkeypatch, recipe, tmp_path)
    for look in range(0, looks, -(-looks // 1000)):
        ask_at(monkeypatch, recipe, tmp_path / f"{asked}{look}", asked, look)
