"""A run is only resumed on the bench, with the recipe and the sample that it was begun with."""

import sqlite3
from contextlib import closing

import pytest
from click.testing import CliRunner

import goniometer
from acquisition.expand import HOME, Target
from acquisition.journal import FILE_NAME
from drivers.clock import WallClock
from goniometer.assembly import connected
from goniometer.bench import simulate
from goniometer.cli import cli
from goniometer.errors import ConfigurationError, DeviceFaultError, JournalError
from goniometer.load_files import load_rig, load_scene
from goniometer.resume_checks import refuse_other_bench
from goniometer.resume_run import resume
from goniometer.standing import come_to_rest, out_of_place


def change(folder, key, change_text):
    """Change a text that the journal remembers."""
    with closing(sqlite3.connect(folder / FILE_NAME)) as connection:
        (text,) = connection.execute("SELECT value FROM about WHERE key = ?", (key,)).fetchone()
        connection.execute("UPDATE about SET value = ? WHERE key = ?", (change_text(text), key))
        connection.commit()


def test_a_finished_run_says_so_and_moves_nothing(whole, rows):
    before = rows(whole)
    done = CliRunner().invoke(cli, ["resume", str(whole)])
    assert done.exit_code == 0
    assert f"was finished already: {len(before)} readings. Nothing was moved." in done.stderr
    assert rows(whole) == before


def test_results_that_a_kill_has_left_out_are_made(whole, cut):
    folder = cut(whole, 1000)
    with closing(sqlite3.connect(folder / FILE_NAME)) as connection:
        connection.execute("INSERT INTO about VALUES ('ended', 'finished')")
        connection.commit()
    assert resume(folder).was_finished
    assert (folder / "fit.json").read_bytes() == (whole / "fit.json").read_bytes()


def test_what_is_no_run(tmp_path):
    with pytest.raises(JournalError, match=r"does not exist\. Name a run's folder"):
        resume(tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_a_journal_of_an_earlier_version(whole, cut):
    folder = cut(whole, 20)
    change(folder, "format", lambda text: "2")
    with pytest.raises(JournalError, match=r"begun by an earlier version of goniometer \(journal format 2\)"):
        resume(folder)


def test_another_rig_file(whole, cut, rows, tmp_path, root):
    folder, rig = cut(whole, 20), tmp_path / "rig.yaml"
    rig.write_text(
        (root / "rigs" / "simulated.yaml").read_text().replace("velocity_deg_s: 20", "velocity_deg_s: 10", 1)
    )
    with pytest.raises(ConfigurationError, match=r"velocity_deg_s is 10\.0, and was 20\.0 when the run was begun"):
        resume(folder, rig_path=rig, speed="max")
    assert len(rows(folder)) == 20


def test_another_device(whole, cut, rows):
    folder = cut(whole, 20)
    change(folder, "devices", lambda text: text.replace("meter: '", "meter: '1").replace("meter: T", "meter: 1T"))
    with pytest.raises(DeviceFaultError, match=r"meter: another device answers than when the run was begun"):
        resume(folder, speed="max")
    assert len(rows(folder)) == 20


@pytest.mark.parametrize("change", ["UPDATE readings SET point = 77 WHERE id = 3", "DELETE FROM readings WHERE id = 3"])
def test_readings_that_the_plan_does_not_begin_with(change, whole, cut, rows):
    folder = cut(whole, 20)
    with closing(sqlite3.connect(folder / FILE_NAME)) as connection:
        connection.execute(change)
        connection.commit()
    before = rows(folder)
    with pytest.raises(JournalError, match=r"Reading 3 of the plan is missing .* or this version .*Nothing was moved"):
        resume(folder, speed="max")
    assert rows(folder) == before


def test_a_scan_whose_decisions_nobody_noted(whole, cut, rows):
    """As in a journal of an earlier version."""
    folder = cut(whole, 20)
    change(folder, "recipe", lambda text: text + "until: {sigma: 0.01}\ntime_limit_s: 60\n")
    with pytest.raises(JournalError, match=r"does not say how the scan had decided to go on.*Nothing was moved"):
        resume(folder, speed="max")
    assert len(rows(folder)) == 20


def test_a_recipe_that_was_changed_since_is_told(recipe, tmp_path, cut, rows):
    path, events = recipe(step_deg=30), []
    run = goniometer.run(path, speed="max", out=tmp_path / "runs", live_fit=False).folder
    path.write_text(path.read_text().replace("step_deg: 30", "step_deg: 20"))
    folder = cut(run, 20)
    resume(folder, speed="max", live_fit=False, subscribers=[events.append])
    assert f"{path} was changed since; the run goes on with the recipe that its journal holds" in events[0].notes
    assert rows(folder) == rows(run)


class TestRealBench:
    """One that outlives the process: served here over sockets, and named by its ports alone."""

    @pytest.fixture
    def served(self, root, tmp_path):
        """The bench, and a rig file with its ports, as of real devices."""
        scene = load_scene(root / "scenes" / "iron.yaml")
        with simulate(scene.scene, 200.0) as bench:
            text = (root / "rigs" / "simulated.yaml").read_text()
            for name in ("arms", "sample_stage", "analyzer", "meter"):
                text = text.replace("port: simulated", f"port: {bench.addresses[name].tcp}", 1)
            (tmp_path / "rig.yaml").write_text(text)
            yield bench, tmp_path / "rig.yaml"

    @pytest.fixture
    def run(self, whole, cut, served):
        """A run on it that was cut."""
        folder = cut(whole, 20)
        change(folder, "rig", lambda text: served[1].read_text())
        change(folder, "scene", lambda text: "")
        return folder

    def test_the_sample_is_asked_about(self, run, rows):
        with pytest.raises(ConfigurationError, match=r"nothing was moved: Nobody but you can see .*--sample-untouched"):
            resume(run)
        done = CliRunner().invoke(cli, ["resume", str(run)])
        assert isinstance(done.exception, ConfigurationError)
        assert len(rows(run)) == 20

    @pytest.mark.timeout(60)
    def test_it_goes_on_after_what_was_lost(self, run, served, rows, whole):
        """The devices' clock is 200 times as fast as the program's, so waits are short for them."""
        done = resume(run, is_same_sample=lambda: True, live_fit=False).run
        planned = [(*row[1:4], row[8]) for row in rows(run) if row[-1]]
        assert planned == [(*row[1:4], row[8]) for row in rows(whole)]
        assert [row[2] for row in rows(run) if not row[-1]] == ["reference"] * 2
        times_s = [reading.time_s for reading in done.readings]
        assert times_s == sorted(times_s)

    def test_axes_that_are_out_of_place_are_homed(self, served, root):
        _, path = served
        rig = load_rig(path)
        places = [Target(10.0, 0.0, 0.0, 1), Target(10.0, 20.0, 0.0, 1)]
        with connected(rig, {name: device.port for name, device in rig.devices.items()}, WallClock(), None) as devices:
            assert out_of_place(devices, rig, places) == (devices.source_arm,)
            devices.source_arm.start_move(10.0)
            devices.detector_arm.start_move(12.0)
            come_to_rest(devices, WallClock(), lambda: None)
            assert out_of_place(devices, rig, places) == ()
            assert out_of_place(devices, rig, [HOME, HOME]) == (devices.source_arm, devices.detector_arm)
            zones = [{"source_arm": [50, 60], "detector_arm": [-60, -50]}]
            blocked = rig.model_validate({**rig.model_dump(), "collision_zones": zones})
            with pytest.raises(
                DeviceFaultError, match=r"says that it stands at 10 degrees.*goniometer home --axis source"
            ):
                out_of_place(devices, blocked, [HOME, HOME])


@pytest.mark.parametrize(
    ("before", "now", "message"),
    [
        ("scene: iron", "scene: glass", "held 'iron' when the run was begun, and the one that answers holds 'glass'"),
        ("scene: iron\nseed: 1", "scene: iron\nseed: 2", "the one that answers holds it with other content"),
        ("scene: iron", "", "held 'iron' when the run was begun, and the one that answers is real"),
    ],
)
def test_another_scene_is_another_sample(before, now, message):
    refuse_other_bench(before, before)
    with pytest.raises(ConfigurationError, match=message):
        refuse_other_bench(before, now)
