"""From a recipe for a calibration to a file that other recipes use, and what is refused on the way."""

import json
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
import yaml
from click.testing import CliRunner
from numpy.testing import assert_allclose

from acquisition.calibration_recipe import calibration_steps
from goniometer.calibrating import measure as measure_module
from goniometer.calibrating.command import calibrate
from goniometer.calibrating.stored_scan import stored_scan
from goniometer.cli import cli
from goniometer.errors import ConfigurationError, JournalError, ReductionError
from goniometer.load_files import load_calibration, load_calibration_recipe, load_file, load_recipe, load_rig
from goniometer.planning import slots, timing
from goniometer.run_folder import measured
from goniometer.run_recipe import run

ROOT = Path(__file__).resolve().parents[2]
TRUE = {2: (0.8, 0.005, 0.9), 3: (44.0, 0.005, 0.98), 4: (90.5, 0.005, 0.93), 5: (135.9, 0.005, 1.0)}


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    """The shipped files with few readings, and one calibration made with them."""
    folder = tmp_path_factory.mktemp("bench")
    for name in ("recipes", "rigs", "scenes"):
        (folder / name).mkdir()
        for file in (ROOT / name).glob("*.yaml"):
            (folder / name / file.name).write_text(file.read_text())
    edit(folder / "recipes" / "calibrate_polarizer.yaml", readings=4)
    edit(folder / "recipes" / "calibrate_plate.yaml", readings=2)
    exits = {"start_deg": 0.0, "stop_deg": 60.0, "step_deg": 20.0}
    edit(folder / "recipes" / "iron_imperfect_polarizers.yaml", exit=exits, readings=2)
    solve(folder, "calibrate_polarizer", store=folder / "calibrations" / "bench.yaml")
    return folder


def scans(bench):
    """The folders of the calibration's scans, in the order in which they were made."""
    return sorted((bench / "scans").iterdir(), key=lambda folder: stored_scan(folder).scan.setting_deg)


def edit(path, **changes):
    content = yaml.safe_load(path.read_text()) | changes
    path.write_text(yaml.safe_dump({key: value for key, value in content.items() if value is not None}))
    return path


def solve(folder, *recipes, store=None, out="scans"):
    paths = [folder / "recipes" / f"{recipe}.yaml" for recipe in recipes]
    return calibrate(paths, out=folder / out, speed="max", store=store, ask=unasked, tell=str)


def unasked(what):
    raise AssertionError(f"a simulated polarizer is turned by the program: {what}")


def using(bench, tmp_path, recipe_changes=None, rig_changes=None, **calibration_changes):
    """A recipe that uses the calibration, in a folder of its own, with changes."""
    for name in ("recipes", "rigs", "scenes", "calibrations"):
        (tmp_path / name).mkdir(exist_ok=True)
        for file in (bench / name).glob("*.yaml"):
            (tmp_path / name / file.name).write_text(file.read_text())
    edit(tmp_path / "calibrations" / "bench.yaml", **calibration_changes)
    edit(tmp_path / "rigs" / "simulated.yaml", **(rig_changes or {}))
    keys = {"calibration": "../calibrations/bench.yaml", "calibration_max_age_days": 30}
    return edit(tmp_path / "recipes" / "iron_imperfect_polarizers.yaml", **(keys | (recipe_changes or {})))


def test_the_file_holds_what_was_found_and_where_it_comes_from(bench):
    found = load_calibration(bench / "calibrations" / "bench.yaml")
    for slot, values in TRUE.items():
        errors = found.slots[slot].stderrs
        for value, true, stderr in zip(found.slots[slot].values, values, errors, strict=True):
            assert abs(value - true) < 4.5 * stderr
    assert (found.rig, found.analyzer, found.wavelength_nm) == ("simulated bench", "analyzer", 550.0)
    assert found.devices["analyzer"] == "thorlabs_fw102c"
    assert found.layout == {1: "open", 2: 0.0, 3: 45.0, 4: 90.0, 5: 135.0, 6: "blocked"}
    assert found.relative_to_slot == 1
    assert abs(found.dark.power_w - 2e-10) < 4.5 * found.dark.stderr_w
    assert abs(datetime.now(UTC) - found.measured_at) < timedelta(minutes=10)
    assert len(found.scans) == 6
    for name in found.scans:
        assert (bench / "scans" / name.partition(",")[0] / "journal.sqlite").exists()


def test_stored_scans_are_solved_again_to_the_same(bench):
    folders = scans(bench)
    again = calibrate(folders, out=bench, ask=unasked, tell=str)
    stored = load_calibration(bench / "calibrations" / "bench.yaml")
    assert again == stored
    assert [stored_scan(folder).scan.setting_deg for folder in folders] == [0.0, 30.0, 60.0, 90.0, 120.0, 150.0]


def test_a_plate_beside_the_polarizer_makes_the_angles_better(bench):
    folders = scans(bench)
    plate = bench / "recipes" / "calibrate_plate.yaml"
    both = calibrate([*folders, plate], out=bench / "plate", speed="max", ask=unasked, tell=str)
    alone = load_calibration(bench / "calibrations" / "bench.yaml")
    for slot, (angle_deg, _, _) in TRUE.items():
        assert both.slots[slot].angle_stderr_deg < 0.6 * alone.slots[slot].angle_stderr_deg
        assert abs(both.slots[slot].angle_deg - angle_deg) < 4.5 * both.slots[slot].angle_stderr_deg
    (folder,) = (bench / "plate").iterdir()
    with pytest.raises(ReductionError, match="cannot determine the angle of slot 2"):
        calibrate([folder], out=bench, ask=unasked, tell=str)


def test_a_run_remembers_its_calibration_and_is_reduced_alike_when_the_file_is_gone(bench, tmp_path):
    recipe = using(bench, tmp_path)
    stored = run(recipe, out=tmp_path / "runs", speed="max", live_fit=False)
    text = (tmp_path / "calibrations" / "bench.yaml").read_text()
    assert stored.about["calibration"] == text
    assert len(stored.about["calibration_sha256"]) == 64
    (tmp_path / "calibrations" / "bench.yaml").unlink()
    again = measured(stored.folder)
    for one, other in zip(stored.points, again.points, strict=True):
        assert_allclose(one.stokes, other.stokes, rtol=0)
    edit(recipe, calibration=None, calibration_max_age_days=None)
    plain = run(recipe, out=tmp_path / "plain", speed="max", live_fit=False)
    assert "calibration" not in plain.about
    assert abs(plain.points[-1].dolp - stored.points[-1].dolp) > 5 * stored.points[-1].dolp_stderr


def days_ago(days):
    return (datetime.now(UTC) - timedelta(days=days)).isoformat(timespec="seconds")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"measured": days_ago(31)},
            r"was measured 31.0 days ago, on .*; allowed: at most 30 .calibration_max_age_days",
        ),
        ({"measured": days_ago(-2)}, "which is still to come"),
        ({"wavelength_nm": 633.0}, "holds at 633 nm; this recipe measures at 550 nm"),
        ({"rig": "another bench"}, "is of the bench 'another bench'; this recipe's is 'simulated bench'"),
        ({"devices": {"analyzer": "thorlabs_elliptec"}}, "was measured with other devices"),
        ({"offset_deg": 90.0}, r"\(offset_deg 90\); those of the rig file hold"),
        ({"slots": None}, "slots"),
        ({"recipe_changes": {"calibration_max_age_days": None}}, "needs calibration_max_age_days beside it"),
        ({"recipe_changes": {"calibration": None}}, "has nothing to be about"),
        ({"recipe_changes": {"calibration": "../calibrations/none.yaml"}}, "does not exist"),
    ],
)
def test_a_calibration_that_is_not_for_this_scan_is_refused(bench, tmp_path, changes, message):
    recipe = using(bench, tmp_path, **changes)
    with pytest.raises(ConfigurationError, match=message):
        load_recipe(recipe)


def test_another_slot_layout_is_refused(bench, tmp_path):
    recipe = using(bench, tmp_path)
    for file, devices in (("rigs/simulated.yaml", "devices"), ("scenes/iron_imperfect_polarizers.yaml", "devices")):
        content = yaml.safe_load((tmp_path / file).read_text())
        content[devices]["analyzer"]["slots"] |= {3: 135, 5: 45}
        (tmp_path / file).write_text(yaml.safe_dump(content))
    with pytest.raises(
        ConfigurationError, match=r"is of slots with 1: open, 2: 0, 3: 45, .*hold 1: open, 2: 0, 3: 135"
    ):
        load_recipe(recipe)


def test_an_old_run_is_still_reduced_with_its_own_calibration(bench, tmp_path, monkeypatch):
    """Age counts when a scan begins, not when it is looked at."""
    recipe = using(bench, tmp_path, measured=days_ago(29.9))
    stored = run(recipe, out=tmp_path / "runs", speed="max", live_fit=False)
    monkeypatch.setattr("goniometer.load_files.datetime", Later)
    with pytest.raises(ConfigurationError, match="days ago"):
        load_recipe(recipe)
    assert len(measured(stored.folder).points) == 4


class Later(datetime):
    @classmethod
    def now(cls, tz=None):
        return datetime.now(tz) + timedelta(days=300)


@pytest.mark.parametrize(
    ("recipe", "changes", "message"),
    [
        ("calibrate_polarizer", {"scene": "../scenes/iron.yaml"}, "does not hold a reference_polarizer"),
        (
            "calibrate_plate",
            {"scene": "../scenes/calibrate_polarizer.yaml"},
            "holds a reference_polarizer. Take it out",
        ),
        ("calibrate_polarizer", {"scene": None}, "scene.*is missing"),
        ("calibrate_polarizer", {"exposure_s": 0.031}, "a whole number of the detector's samples"),
        ("calibrate_polarizer", {"wavelength_nm": 600}, "allowed: 550"),
        (
            "calibrate_polarizer",
            {"rig": "../rigs/simulated_retarder.yaml", "scene": "../scenes/iron_retarder.yaml"},
            "has a retarder, and only polarizers can be calibrated",
        ),
        ("calibrate_polarizer", {"calibrate": {"reference": "mirror"}}, "polarizer"),
    ],
)
def test_a_recipe_for_a_calibration_that_cannot_be_is_refused(bench, tmp_path, recipe, changes, message):
    using(bench, tmp_path)
    path = edit(tmp_path / "recipes" / f"{recipe}.yaml", **changes)
    with pytest.raises(ConfigurationError, match=message):
        load_file(path)


def test_runs_and_scans_for_calibrations_are_not_taken_for_each_other(bench, tmp_path):
    scan = scans(bench)[0]
    with pytest.raises(ReductionError, match=r"is a scan for a calibration.*goniometer calibrate"):
        measured(scan)
    recipe = using(bench, tmp_path)
    stored = run(recipe, out=tmp_path / "runs", speed="max", live_fit=False)
    with pytest.raises(ReductionError, match="without a section calibrate"):
        calibrate([stored.folder], out=tmp_path, ask=unasked, tell=str)
    with pytest.raises(ConfigurationError, match="this is a calibration-recipe, and a recipe is needed here"):
        load_recipe(bench / "recipes" / "calibrate_polarizer.yaml")
    with pytest.raises(JournalError, match="does not exist"):
        calibrate([tmp_path], out=tmp_path, ask=unasked, tell=str)


def test_scans_of_two_benches_are_not_solved_together(bench, tmp_path):
    using(bench, tmp_path, rig_changes={"rig": "another bench"})
    edit(tmp_path / "recipes" / "calibrate_plate.yaml", readings=1)
    with pytest.raises(ReductionError, match="are of different benches"):
        calibrate(
            [*scans(bench), tmp_path / "recipes" / "calibrate_plate.yaml"],
            out=tmp_path / "scans",
            speed="max",
            ask=unasked,
            tell=str,
        )


def test_the_command_prints_and_refuses_to_write_over_a_recipe(bench):
    folders = [str(folder) for folder in scans(bench)]
    done = CliRunner().invoke(cli, ["calibrate", *folders])
    assert done.exit_code == 0, done.output
    assert "slot   rig file" in done.stdout
    assert "Nothing was stored" in done.stderr
    as_json = json.loads(CliRunner().invoke(cli, ["calibrate", *folders, "--json"]).stdout)
    assert set(as_json["slots"]) == {"2", "3", "4", "5"}
    recipe = bench / "recipes" / "calibrate_polarizer.yaml"
    refused = CliRunner().invoke(cli, ["calibrate", str(recipe), "--store", str(recipe)])
    assert isinstance(refused.exception, ConfigurationError)
    assert "would be lost" in str(refused.exception)


def test_check_takes_both_kinds_of_files(bench):
    for file in ("recipes/calibrate_polarizer.yaml", "recipes/calibrate_plate.yaml", "calibrations/bench.yaml"):
        done = CliRunner().invoke(cli, ["check", str(bench / file)])
        assert done.exit_code == 0, done.output
        assert "valid" in done.output


def test_a_person_is_asked_to_turn_the_reference_before_each_scan_of_a_real_bench(bench, tmp_path, monkeypatch):
    setup = load_calibration_recipe(bench / "recipes" / "calibrate_polarizer.yaml")
    real = replace(setup, rig=load_rig(ROOT / "rigs" / "example_hardware.yaml"), scene=None)
    happened = []
    monkeypatch.setattr(measure_module, "_scan", lambda _, setting_deg, *__: happened.append(setting_deg) or tmp_path)
    list(measure_module.measure(real, tmp_path, None, happened.append, str))
    assert happened[1::2] == [0.0, 30.0, 60.0, 90.0, 120.0, 150.0]
    for asked, setting_deg in zip(happened[0::2], happened[1::2], strict=True):
        assert asked.startswith(f"Turn the reference polarizer to {setting_deg:g} degrees")


def test_a_scan_goes_through_all_slots_and_back_so_that_an_even_drift_averages_out(bench):
    setup = load_calibration_recipe(bench / "recipes" / "calibrate_plate.yaml")
    steps = calibration_steps(setup.recipe, slots(setup.rig), timing(setup.rig))
    for point in range(5):
        of_point = [step for step in steps if step.point == point]
        assert [step.target.slot for step in of_point] == [1, 2, 3, 4, 5, 6, 6, 5, 4, 3, 2, 1]
        assert {step.kind for step in of_point if step.target.slot == 6} == {"dark"}
        assert {(step.target.incidence_deg, step.target.exit_deg) for step in of_point} == {
            (setup.recipe.calibrate.incidence_deg[point],) * 2
        }
