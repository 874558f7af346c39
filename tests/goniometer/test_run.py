"""Whole scans on the simulated bench: every byte over a socket, every reading through the journal."""

import json
from pathlib import Path

import pytest
import yaml
from numpy.testing import assert_allclose

import goniometer
from acquisition.events import FitUpdated, PointReduced, ReadingStored, ScanEnded, ScanStarted
from acquisition.journal import FILE_NAME, Journal
from goniometer.run_folder import stored_run

ROOT = Path(__file__).resolve().parents[2]
SAMPLES = ("iron", "alumina", "glass", "pvc")


def write_variant(tmp_path, recipe="iron_60deg", scene="iron", *, recipe_changes=None, scene_changes=None):
    """A copy of a shipped recipe and scene with changes, beside a copy of the shipped rig."""
    for folder in ("recipes", "rigs", "scenes"):
        (tmp_path / folder).mkdir(exist_ok=True)
    (tmp_path / "rigs" / "simulated.yaml").write_text((ROOT / "rigs" / "simulated.yaml").read_text())
    for folder, name, changes in (("recipes", recipe, recipe_changes), ("scenes", scene, scene_changes)):
        content = yaml.safe_load((ROOT / folder / f"{name}.yaml").read_text()) | (changes or {})
        (tmp_path / folder / f"{name}.yaml").write_text(yaml.safe_dump(content))
    return tmp_path / "recipes" / f"{recipe}.yaml"


SHORT = {"exit": {"start_deg": 0.0, "stop_deg": 60.0, "step_deg": 6.0}, "readings": 2}


@pytest.mark.parametrize("sample", SAMPLES)
def test_without_noise_the_fit_returns_the_scene(tmp_path, sample):
    recipe = write_variant(tmp_path, f"{sample}_60deg", sample, scene_changes={"effects": []})
    stored = goniometer.run(recipe, out=tmp_path / "runs", speed="max")
    assert stored.fit is not None
    assert len(stored.fit.parameters) == (6 if sample == "iron" else 5)
    for name, estimate in stored.fit.parameters.items():
        assert_allclose(estimate.value, stored.truth[name], rtol=1e-6, err_msg=name)


@pytest.mark.parametrize("sample", SAMPLES)
def test_with_noise_index_and_roughness_lie_within_three_standard_errors(tmp_path, sample):
    stored = goniometer.run(ROOT / "recipes" / f"{sample}_60deg.yaml", out=tmp_path, speed="max")
    assert stored.fit is not None
    for name in ("sigma", "n", "k") if sample == "iron" else ("sigma", "n"):
        estimate = stored.fit.parameters[name]
        assert abs(estimate.value - stored.truth[name]) < 3 * estimate.stderr, name
    assert 0.5 < stored.fit.chi_square / stored.fit.degrees_of_freedom < 1.5


def test_events_tell_the_whole_scan_in_order(tmp_path):
    events = []
    stored = goniometer.run(
        write_variant(tmp_path, recipe_changes=SHORT), out=tmp_path / "runs", speed="max", subscribers=[events.append]
    )
    assert isinstance(events[0], ScanStarted)
    *_, ended, last_fit = events
    assert isinstance(ended, ScanEnded)
    assert ended.reason == "finished"
    readings = [event.reading for event in events if isinstance(event, ReadingStored)]
    assert len(readings) == events[0].readings == ended.readings == 11 * 5 * 2
    assert tuple(readings) == stored.readings
    assert [event.stokes_point.point for event in events if isinstance(event, PointReduced)] == list(range(11))
    assert sum(isinstance(event, FitUpdated) for event in events) > 1
    assert last_fit == FitUpdated(11, stored.fit)


def test_a_scan_lasts_as_long_as_was_planned(tmp_path):
    events = []
    recipe = write_variant(tmp_path, recipe_changes=SHORT)
    goniometer.run(recipe, out=tmp_path / "runs", speed="max", subscribers=[events.append])
    assert_allclose(events[-2].bench_duration_s, events[0].expected_duration_s, rtol=0.05)


def test_same_seed_same_readings_and_time_stamps(tmp_path):
    recipe = write_variant(tmp_path, recipe_changes=SHORT)
    first, second = (goniometer.run(recipe, out=tmp_path / "runs", speed="max") for _ in range(2))
    assert first.readings == second.readings
    assert first.folder != second.folder
    other_seed = write_variant(tmp_path, recipe_changes=SHORT, scene_changes={"seed": 99})
    assert goniometer.run(other_seed, out=tmp_path / "runs", speed="max").readings != first.readings


def test_a_shown_reading_is_on_disk(tmp_path):
    def look(event):
        if isinstance(event, ReadingStored):
            (folder,) = (tmp_path / "runs").iterdir()
            with Journal.open(folder / FILE_NAME) as journal:
                assert journal.readings()[-1] == event.reading

    goniometer.run(
        write_variant(tmp_path, recipe_changes={**SHORT, "readings": 1}),
        out=tmp_path / "runs",
        speed="max",
        subscribers=[look],
    )


def test_the_files_of_a_run_are_there_and_say_the_same(tmp_path, drawing):
    with drawing():
        stored = goniometer.run(write_variant(tmp_path, recipe_changes=SHORT), out=tmp_path / "runs", speed="max")
    written = json.loads((stored.folder / "fit.json").read_text())
    for name, estimate in stored.fit.parameters.items():
        assert written["parameters"][name]["value"] == estimate.value
        assert written["parameters"][name]["truth"] == stored.truth[name]
    assert written["degrees_of_freedom"] == 11 * 3 - 6
    assert {path.name for path in stored.folder.iterdir()} == {
        ".lock",
        "journal.sqlite",
        "stokes.csv",
        "scan.nxs",
        "fit.json",
        "report.png",
    }
    again = stored_run(stored.folder)
    assert again.fit.to_dict() == stored.fit.to_dict()
    assert yaml.safe_load(again.about["scene"])["sample"]["material"] == "Fe"


def test_a_reference_is_read_and_does_not_disturb(tmp_path):
    recipe = write_variant(
        tmp_path,
        recipe_changes={**SHORT, "reference": {"exit_deg": 45.0, "every_points": 4}},
        scene_changes={"effects": []},
    )
    stored = goniometer.run(recipe, out=tmp_path / "runs", speed="max")
    references = [reading for reading in stored.readings if reading.kind == "reference"]
    assert [reading.point for reading in references] == [0, 0, 4, 4, 8, 8, 10, 10]
    assert references[-1] == stored.readings[-1], "the last one closes the scan"
    for name, true_value in stored.truth.items():
        assert_allclose(stored.fit.parameters[name].value, true_value, rtol=1e-5)


def test_multiple_scattering_in_asymmetric_grooves_is_recovered_through_the_mirror_direction(tmp_path):
    sample = {
        "material": "Fe",
        "sigma": 0.4,
        "asymmetry": 0.3,
        "bounces": 3,
        "rho_s": 0.7,
        "rho_d": 0.1,
        "rho_dd": 0.05,
    }
    fit = {
        "lobes": ["specular", "diffuse", "directional"],
        "free": {"sigma": [0.1, 1.0], "n": [1.0, 6.0], "k": [0.5, 8.0]},
        "fixed": {"asymmetry": 0.3},
        "bounces": 3,
    }
    recipe = write_variant(
        tmp_path,
        recipe_changes={"exit": {"start_deg": -20.0, "stop_deg": 80.0, "step_deg": 5.0}, "fit": fit},
        scene_changes={"sample": sample, "effects": [{"effect": "acceptance_cone"}]},
    )
    stored = goniometer.run(recipe, out=tmp_path / "runs", speed="max", live_fit=False)
    for name, true_value in stored.truth.items():
        if name != "asymmetry":
            assert_allclose(stored.fit.parameters[name].value, true_value, rtol=1e-4)
    assert "3 reflections" in stored.fit.surface.describe()
