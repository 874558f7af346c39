"""An analyzer that is read while it turns, from the recipe to the results: what it finds, and what it gets over."""

import math
import shutil
import sqlite3
from contextlib import closing
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import yaml
from numpy.testing import assert_allclose

import goniometer
from acquisition.control import ScanControl
from acquisition.engine import LINK_LOST
from acquisition.events import (
    ExposureChanged,
    LinkRestored,
    Paused,
    ReadingStored,
    RequestRefused,
    ScanEnded,
    ScanStarted,
)
from acquisition.journal import FILE_NAME, Journal
from acquisition.measured_nexus import read_measured_nexus
from acquisition.turn_readout import TurnReadout
from goniometer.check import describe_plan
from goniometer.errors import ConfigurationError, PositionError, ScanInterrupted
from goniometer.load_files import load_recipe
from goniometer.planning import plan, reduction
from goniometer.resume_run import resume
from goniometer.run_folder import measured
from model.lobes import Diffuse, Directional, Specular
from model.surface import Surface

ROOT = Path(__file__).resolve().parents[2]
IRON = 2.950 + 2.932j
SHORT = {"exit": {"start_deg": 0.0, "stop_deg": 60.0, "step_deg": 12.0}}
LAMP = {"effect": "polarized_lamp", "s1": 0.3, "s2": 0.6, "s3": 0.5}
SHOT = [{"effect": "shot_noise"}, {"effect": "read_noise", "power_w": 2.0e-11}]
UNPOLARIZED, POLARIZED = [1.0, 0.0, 0.0, 0.0], [1.0, 0.3, 0.6, 0.5]
LONG = {"readings": 12, "exposure_s": 0.15}
"""Exposures in which the analyzer turns by 27 degrees."""


def written_in(folder, recipe=None, scene=None, axis=None, *, retarder=False):
    """The shipped recipe and its files, shortened, with changes; `retarder` has a quarter-wave plate turn instead."""
    contents = {
        name: yaml.safe_load((ROOT / name).read_text())
        for name in ("recipes/iron_rotating.yaml", "rigs/simulated_rotating.yaml", "scenes/iron_rotating.yaml")
    }
    of_recipe, of_rig, of_scene = contents.values()
    of_recipe |= SHORT | (recipe or {})
    of_scene |= scene or {}
    axes = of_rig["devices"]["rotator"]["axes"]
    axes["polarizer"] |= axis or {}
    if retarder:
        axes["retarder"] = axes.pop("polarizer")
        slots = {slot: {"polarizer_deg": 20, "retarder_deg": angle} for slot, angle in enumerate((-52, -15, 15, 52), 1)}
        of_rig["devices"]["analyzer"] |= {"turns": ["retarder"], "retardance_deg": 90, "slots": slots}
        of_scene["devices"]["analyzer"] |= {"polarizer_deg": 20, "retardance_deg": 90}
        of_scene["devices"]["rotator"]["axes"] = {1: "retarder"}
    for name, content in contents.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(yaml.safe_dump(content))
    return folder / "recipes" / "iron_rotating.yaml"


@pytest.fixture
def written(tmp_path):
    return partial(written_in, tmp_path)


@pytest.fixture
def run(written, tmp_path):
    """Runs it with a control; `on` is called with every event and the control. Gives the run and its events."""

    def scan(on=lambda event, control: None, out="runs", suspend_when=None, **changes):
        control, events = ScanControl(), []

        def see(event):
            events.append(event)
            on(event, control)

        options = {"out": tmp_path / out, "speed": "max", "live_fit": False, "subscribers": [see]}
        goniometer.run(written(**changes), control=control, suspend_when=suspend_when, **options)
        (folder,) = (tmp_path / out).iterdir()
        return measured(folder), events

    return scan


def of(kind, events):
    return [event for event in events if isinstance(event, kind)]


def at_reading(number, act):
    """What to do when a number of readings is stored."""
    stored = []

    def on(event, control):
        if isinstance(event, ReadingStored):
            stored.append(event)
            if len(stored) == number:
                act(control)

    return on


def stokes(exit_deg, lamp):
    surface = Surface([Specular(0.7, 0.1764, IRON), Diffuse(0.1, 0.1764), Directional(0.05, 0.1764, IRON)])
    return surface.mueller(math.radians(60.0), math.radians(abs(exit_deg)), math.pi if exit_deg >= 0 else 0.0) @ lamp


def pulls(points, lamp=UNPOLARIZED):
    """Measured less true in units of the predicted scatter: independent and of variance 1 if all is right."""
    return np.array(
        [
            np.linalg.solve(
                np.linalg.cholesky(one.covariance), one.stokes - stokes(one.exit_deg, lamp)[: len(one.stokes)]
            )
            for one in points
        ]
    )


def require_unit_variance(scatter):
    assert abs((scatter**2).sum() - scatter.size) < 4 * math.sqrt(2 * scatter.size)


def test_iron_is_recovered_within_the_stated_errors(run):
    found = [run(out=f"runs{seed}", recipe=LONG, scene={"seed": seed})[0].points for seed in (1, 2, 3)]
    assert {len(point.stokes) for points in found for point in points} == {3}
    require_unit_variance(np.concatenate([pulls(points) for points in found]))


def test_a_retarder_that_turns_tells_s3_too(run):
    scene = {"effects": [*SHOT, LAMP]}
    found = [run(out=f"{n}", recipe=LONG, scene=scene | {"seed": n}, retarder=True)[0].points for n in (1, 2, 3)]
    assert {len(point.stokes) for points in found for point in points} == {4}
    assert abs(found[0][-1].docp) > 0.05, "the case must have circular light to find"
    require_unit_variance(np.concatenate([pulls(points, POLARIZED) for points in found]))


@pytest.mark.parametrize("retarder", [False, True])
def test_who_neglects_that_it_turns_during_the_exposure_is_wrong(run, written, tmp_path, retarder):
    run(recipe=LONG, retarder=retarder, scene={"effects": [*SHOT, LAMP]})
    (folder,) = (tmp_path / "runs").iterdir()
    setup = load_recipe(written(recipe=LONG, retarder=retarder, scene={"effects": [*SHOT, LAMP]}))
    with Journal.open(folder / FILE_NAME) as journal:
        readings = journal.readings()
    reducing = reduction(setup.recipe, setup.rig)
    require_unit_variance(pulls(reducing.scan(readings), POLARIZED))
    as_standing = [replace(one, analyzer_sweep_deg=None, retarder_sweep_deg=None) for one in readings]
    assert np.abs(pulls(reducing.scan(as_standing), POLARIZED)).max() > 5
    as_backwards = [replace(one, analyzer_deg=-one.analyzer_deg) for one in readings]
    assert np.abs(pulls(reducing.scan(as_backwards), POLARIZED)).max() > 5


def test_without_noise_nothing_is_left_but_what_clocks_differ_by(run):
    for retarder in (False, True):
        points = run(recipe=LONG, retarder=retarder, scene={"effects": [LAMP]}, out=f"{retarder}")[0].points
        for point in points:
            truth = stokes(point.exit_deg, POLARIZED)[: len(point.stokes)]
            assert_allclose(point.stokes, truth, atol=1e-4 * truth[0])


def test_readings_say_how_the_analyzer_turned(run, tmp_path):
    result, _ = run(recipe={"repeats": 2})
    (folder,) = (tmp_path / "runs").iterdir()
    forwards = [one for one in result.readings if one.slot == 1]
    assert len(forwards) == len(result.readings) / 2 == 48 * 6 * 2
    assert_allclose([one.analyzer_sweep_deg for one in forwards], 180.0 * 0.036, rtol=1e-3)
    assert_allclose(np.diff([one.analyzer_deg for one in forwards[:48]]), 7.5, atol=0.15)
    backwards = [one for one in result.readings if one.slot == 2][:48]
    assert_allclose([one.analyzer_sweep_deg for one in backwards], -180.0 * 0.036, rtol=1e-3)
    assert abs(np.mean([one.analyzer_deg for one in backwards])) < 1
    assert [one.repeat for one in forwards[:48]] == list(range(48))
    assert read_measured_nexus(folder / "scan.nxs")[0].observable.columns == ("s0", "s1", "s2")
    loaded = goniometer.load(folder)
    assert_allclose(loaded.reading_analyzer_sweep_deg.max(), 180.0 * 0.036, rtol=1e-3)


@pytest.mark.parametrize("recipe", [{}, {"repeats": 2}, LONG, {"analyzer_rotation": {"turns": 4}}])
def test_it_takes_as_long_as_was_planned(run, written, recipe):
    setup = load_recipe(written(recipe=recipe))
    planned_s = sum(step.duration_s for step in plan(setup.recipe, setup.rig))
    (ended,) = of(ScanEnded, run(recipe=recipe)[1])
    assert ended.bench_duration_s == pytest.approx(planned_s, rel=0.05)


def test_check_says_how_it_turns(written):
    text = describe_plan(load_recipe(written()))
    assert "analyzer: polarizer turning at 180°/s, 48 readings a turn, S0 to S2, condition number 1.42" in text
    assert "analyzer 12 turns" in text


def test_a_turn_that_is_paused_is_begun_anew(run):
    """The pause is asked for by the first reading of a turn that is stored, so while the next turn goes on."""
    paused_in = []

    def pause_in_a_turn(control):
        control.pause()

    def on(event, control):
        stop_here(event, control)
        if isinstance(event, Paused):
            paused_in.append(event.readings)
            control.go_on()

    stop_here = at_reading(50, pause_in_a_turn)
    result, events = run(on)
    assert len(of(Paused, events)) == 1
    plain, _ = run(out="plain")
    assert [(one.point, one.slot, one.repeat) for one in result.readings] == [
        (one.point, one.slot, one.repeat) for one in plain.readings
    ]
    require_unit_variance(pulls(result.points))


def test_a_reading_in_doubt_has_its_turn_taken_again(run):
    doubted = []

    def once(reading):
        if not doubted and reading.point == 2 and reading.slot == 2 and reading.repeat == 20:
            doubted.append(reading)
            return "somebody opened the door"
        return None

    result, events = run(suspend_when=once, recipe={"suspend": {"every_s": 3.0}})
    (paused,) = of(Paused, events)
    assert "somebody opened the door" in paused.why
    assert len(result.readings) == 48 * 2 * 6
    turn = [one for one in result.readings if one.point == 2 and one.slot == 2]
    assert min(one.time_s for one in turn) > doubted[0].time_s + 3.0
    require_unit_variance(pulls(result.points))


def test_a_longer_exposure_takes_more_turns_and_one_that_is_too_long_is_refused(run):
    result, events = run(at_reading(48, lambda control: control.set_exposure(0.06)))
    assert len(of(ExposureChanged, events)) == 1
    assert len(result.readings) == 48 * 2 * 6
    assert result.readings[-1].exposure_s == 0.06
    require_unit_variance(pulls(result.points))
    result, events = run(at_reading(48, lambda control: control.set_exposure(0.9)), out="long")
    (refused,) = of(RequestRefused, events)
    assert "is more than a 12th of the 2 s that the analyzer takes for a turn" in refused.why
    assert {one.exposure_s for one in result.readings} == {0.036}


@pytest.mark.parametrize("device", ["rotator", "meter", "arms"])
def test_a_cable_that_is_pulled_in_a_turn_costs_no_reading(run, device):
    faults = [{"fault": "cable_pulled", "device": device, "at_s": 11.3, "for_s": 2.0}]
    result, events = run(scene={"faults": faults})
    assert of(LinkRestored, events)
    assert len(result.readings) == 48 * 2 * 6
    require_unit_variance(pulls(result.points))


@pytest.mark.parametrize("number", [1, 30, 96])
def test_a_scan_that_is_ended_in_a_turn_keeps_whole_turns_and_stops(run, tmp_path, number):
    with pytest.raises(ScanInterrupted):
        run(at_reading(number, lambda control: control.abort("enough")))
    (folder,) = (tmp_path / "runs").iterdir()
    with Journal.open(folder / FILE_NAME) as journal:
        assert number <= len(journal.readings()) <= math.ceil(number / 48) * 48
    require_whole(resume(folder, speed="max").run)


def require_whole(run):
    """Every reading of the plan is there once, and the light is what it is."""
    places = [(one.point, one.slot, one.repeat) for one in run.readings]
    assert sorted(places) == [(point, slot, repeat) for point in range(6) for slot in (1, 2) for repeat in range(48)]
    require_unit_variance(pulls(run.points))


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """The folder of a run that was not interrupted; its recipe stays where it is."""
    recipe = written_in(tmp_path_factory.mktemp("finished"))
    return goniometer.run(recipe, out=recipe.parent / "runs", speed="max", live_fit=False).folder


@pytest.mark.parametrize("readings", [1, 47, 50, 288])
@pytest.mark.parametrize("is_steady", [True, False])
def test_a_scan_that_was_killed_while_a_turn_was_stored_is_resumed(finished, tmp_path, readings, is_steady):
    """The rest of the turn is read in one of its own, at other angles; also where time was lost, as with a link."""
    folder = shutil.copytree(finished, tmp_path / "killed")
    with closing(sqlite3.connect(folder / FILE_NAME)) as connection:
        connection.execute("DELETE FROM readings WHERE id > ?", (readings,))
        connection.execute("DELETE FROM about WHERE key = 'ended'")
        if not is_steady:
            connection.execute("INSERT INTO about VALUES (?, 'for a moment')", (f"{LINK_LOST} 1",))
        connection.commit()
    resumed = resume(folder, speed="max").run
    require_whole(resumed)
    assert resumed.readings[:readings] == measured(finished).readings[:readings]


def test_a_rotator_slower_than_its_rig_file_says_is_noticed(run):
    with pytest.raises(PositionError, match="turned at 180 degrees/s, and velocity_deg_s in the rig file says 230"):
        run(axis={"velocity_deg_s": 230, "limits_deg": [-300, 300]}, recipe={"readings": 24})


def test_a_program_that_comes_too_late_for_every_reading_of_a_turn_says_so(run, monkeypatch):
    monkeypatch.setattr(TurnReadout, "_expose", lambda *_, **__: False)
    with pytest.raises(PositionError, match="its turn was over before a reading of it could be taken"):
        run()


def test_a_speed_that_would_spoil_the_angles_is_refused(written, tmp_path):
    with pytest.raises(
        ConfigurationError, match="at --speed 10 what this computer is late by would put readings at wro"
    ):
        goniometer.run(written(), out=tmp_path / "runs", speed=10)


def test_a_slow_turn_with_few_readings_takes_as_long_as_planned(run):
    slow = {"velocity_deg_s": 10, "acceleration_deg_s2": 100, "limits_deg": [-300, 300]}
    _, events = run(axis=slow, recipe={"readings": 12, "exit": {"start_deg": 0, "stop_deg": 40, "step_deg": 20}})
    (started,), (ended,) = of(ScanStarted, events), of(ScanEnded, events)
    assert abs(ended.bench_duration_s / started.expected_duration_s - 1) < 0.02
