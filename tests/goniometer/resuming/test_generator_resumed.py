"""A scan behind a generator that was cut anywhere goes on with every pair of settings once, in its order."""

import sqlite3
from contextlib import closing

import pytest
import yaml

import goniometer
from acquisition.journal import FILE_NAME
from goniometer.errors import JournalError
from goniometer.resume_run import resume

ROTATORS = {"generator_rotator": "generator_retarder", "analyzer_rotator": "retarder"}
AXIS = {"velocity_deg_s": 50, "acceleration_deg_s2": 1000, "settle_s": 0.05, "tolerance_deg": 0.01}
PAIRS = "point, kind, repeat, slot, generator_slot, generator_deg, generator_retarder_deg, generator_retardance_deg"


@pytest.fixture(scope="module")
def mueller(tmp_path_factory, root):
    """A run of two directions with play and a drifting lamp, on rotators that do or do not miss a little."""

    def run(*, exact):
        folder = tmp_path_factory.mktemp("mueller")
        parts = {
            kind: yaml.safe_load((root / name).read_text(encoding="utf-8"))
            for kind, name in (
                ("recipe", "recipes/iron_mueller.yaml"),
                ("rig", "rigs/simulated_mueller.yaml"),
                ("scene", "scenes/iron_mueller.yaml"),
            )
        }
        parts["scene"]["effects"] += [
            {"effect": "lamp_drift", "relative_per_hour": 0.5},
            {"effect": "encoder_noise", "axis": "detector_arm", "stddev_deg": 0.0005},
            {"effect": "backlash", "axis": "detector_arm", "play_deg": 0.1},
        ]
        for name, role in ROTATORS.items() if exact else ():
            axis = {role: {"limits_deg": [-90, 180], "home_at_start": True, "bay": 1, **AXIS}}
            device = {"driver": "thorlabs_apt", "port": "simulated", "stage": "HDR50", "axes": axis}
            parts["rig"]["devices"][name] = device
            parts["scene"]["devices"][name] = {"type": "thorlabs_apt", "stage": "HDR50", "axes": {1: role}}
        del parts["recipe"]["exit"]
        parts["recipe"] |= {"rig": "rig.yaml", "scene": "scene.yaml", "exit_deg": [0, 40], "readings": 2}
        for kind, content in parts.items():
            (folder / f"{kind}.yaml").write_text(yaml.safe_dump(content), encoding="utf-8")
        path = folder / "recipe.yaml"
        return goniometer.run(path, speed="max", out=folder / "runs", live_fit=False).folder

    return run


def pairs(run, also=""):
    """What was read in which settings, in the order of the readings that the plan has."""
    with closing(sqlite3.connect(run / FILE_NAME)) as connection:
        return connection.execute(f"SELECT {PAIRS}{also} FROM readings WHERE is_planned ORDER BY id").fetchall()


@pytest.mark.usefixtures("no_results")
def test_after_many_readings(mueller, cut, rows):
    run = mueller(exact=True)
    expected = rows(run)
    assert len(expected) == 2 * 16 * 2
    for readings in range(0, len(expected), 5):
        folder = cut(run, readings, str(readings))
        resume(folder, speed="max", live_fit=False)
        assert rows(folder) == expected, f"cut after {readings} readings"


@pytest.mark.usefixtures("no_results")
@pytest.mark.parametrize("speed", ["max", 400])
def test_rotators_that_miss_a_little_and_time_that_is_lost_change_no_setting(speed, mueller, cut):
    run = mueller(exact=False)
    for readings in (1, 8, 21, 40, 63):
        folder = cut(run, readings, str(readings))
        resume(folder, speed=speed, live_fit=False)
        assert pairs(folder) == pairs(run), f"cut after {readings} readings"
        times_s = [row[-1] for row in pairs(folder, ", time_s")]
        assert times_s == sorted(set(times_s))
        powers_w = [row[-1] for row in pairs(folder, ", power_w")]
        assert powers_w == pytest.approx([row[-1] for row in pairs(run, ", power_w")], rel=0.02, abs=2e-9)


def test_a_reading_behind_another_state_of_the_generator_is_none_of_the_plan(mueller, cut):
    folder = cut(mueller(exact=False), 20)
    with closing(sqlite3.connect(folder / FILE_NAME)) as connection:
        connection.execute("UPDATE readings SET generator_slot = 5 - generator_slot WHERE id = 7")
        connection.commit()
    with pytest.raises(JournalError, match="Reading 7 of the plan is missing"):
        resume(folder, speed="max", live_fit=False)
