"""Recipes that include presets and other files, and tables of directions beside them."""

import shutil
from pathlib import Path

import pytest
import yaml
from click.testing import CliRunner
from numpy.testing import assert_array_equal

from acquisition.recipe import Recipe
from goniometer.cli import cli
from goniometer.errors import ConfigurationError
from goniometer.load_files import load_recipe
from goniometer.recipe_includes import PRESETS, preset_names

ROOT = Path(__file__).resolve().parents[2]
REST = {"incidence_deg": 60, "exit_deg": [0, 30], "analyzer_deg": [0, 45, 90], "readings": 2, "exposure_s": 0.03}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    for name in ("rigs", "scenes"):
        shutil.copytree(ROOT / name, tmp_path / name)
    (tmp_path / "recipes" / "lab").mkdir(parents=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def write(path, **keys):
    path = Path(path)
    path.write_text(yaml.safe_dump(keys, sort_keys=False))
    return path


def base(**changes):
    return write(
        "recipes/lab/base.yaml",
        **{"rig": "../../rigs/simulated.yaml", "scene": "../../scenes/iron.yaml", "wavelength_nm": 550, **changes},
    )


def _line(path, text):
    return [line.strip() for line in Path(path).read_text().splitlines()].index(text) + 1


def faults_of(path):
    with pytest.raises(ConfigurationError) as caught:
        load_recipe(Path(path))
    return list(caught.value.faults)


def test_own_keys_win_over_included_ones_and_paths_start_at_the_file_that_names_them(folder):
    base(include="metal", readings=9, exposure_s=0.06)
    mine = {"recipe": "x", "include": ["four_polarizers", "lab/base.yaml"], "exit_deg": [0, 30], "incidence_deg": 60}
    setup = load_recipe(write("recipes/mine.yaml", **mine, exposure_s=0.3))
    assert (setup.recipe.readings, setup.recipe.exposure_s) == (9, 0.3)
    assert setup.recipe.analyzer_deg == (0, 45, 90, 135)
    assert setup.recipe.fit.free["k"] == (0.0, 8.0)
    assert setup.rig_path == Path("rigs/simulated.yaml")


def test_the_text_that_a_run_keeps_is_whole(folder):
    """It reads back to the same recipe where no other file is; comments stay."""
    base(include="dielectric")
    Path("recipes/points.csv").write_text("incidence_deg,exit_deg\n60,10\n# not this one\n30,-20.125\n")
    path = Path("recipes/mine.yaml")
    path.write_text(
        "# of mine\nrecipe: x\ninclude: [standard, four_polarizers, lab/base.yaml]\npoints_file: points.csv\n"
    )
    setup = load_recipe(path)
    assert Recipe.model_validate(yaml.safe_load(setup.recipe_text)) == setup.recipe
    assert_array_equal(setup.recipe.directions_deg(), [(60, 10, 0, 0), (30, -20.125, 0, 0)])
    assert setup.recipe_text.startswith("# of mine\nrecipe: x\n")
    alone = Path("recipes/alone.yaml")
    alone.write_text(setup.recipe_text)
    assert load_recipe(alone).recipe == setup.recipe
    shown = CliRunner().invoke(cli, ["check", "--show", str(path)])
    assert shown.output == setup.recipe_text.rstrip("\n") + "\n"


def test_a_recipe_that_includes_nothing_keeps_its_text_to_the_letter():
    path = ROOT / "recipes" / "iron_60deg.yaml"
    assert load_recipe(path).recipe_text == path.read_text()


def test_a_fault_is_reported_at_its_line_in_the_file_that_holds_it(folder):
    fit = {"lobes": ["specular"], "free": {"sigma": [0.02, 1.0], "n": [1, 6], "k": [0, 8]}, "colour": 1}
    base(readings=0, fit=fit)
    keys = {key: value for key, value in REST.items() if key != "readings"}
    dark, fit_colour, readings = sorted(
        faults_of(write("recipes/mine.yaml", recipe="x", include="lab/base.yaml", dark="on", **keys)),
        key=lambda fault: fault.partition("key ")[2],
    )
    assert dark.startswith("recipes/mine.yaml:3: key 'dark'")
    assert fit_colour.startswith(
        f"recipes/lab/base.yaml:{_line('recipes/lab/base.yaml', 'colour: 1')}: key 'fit.colour'"
    )
    assert readings.startswith("recipes/lab/base.yaml:4: key 'readings'")


def test_two_included_files_that_contradict_each_other_are_refused_with_both_places(folder):
    base()
    path = write("recipes/mine.yaml", recipe="x", include=["fast", "careful", "metal", "lab/base.yaml"], **REST)
    assert load_recipe(path).recipe.readings == 2, "what the recipe says itself is not asked of others"
    without = {key: value for key, value in REST.items() if key != "readings"}
    (fault,) = faults_of(
        write("recipes/mine.yaml", recipe="x", include=["fast", "careful", "metal", "lab/base.yaml"], **without)
    )
    assert fault.startswith("recipes/mine.yaml:4: key 'include[1]': 'readings' is one thing at ")
    assert f"{PRESETS / 'fast.yaml'}:2 and another at {PRESETS / 'careful.yaml'}:2" in fault


def test_what_two_files_say_alike_is_no_contradiction(folder):
    base(readings=1, exposure_s=0.03, fit=yaml.safe_load((PRESETS / "metal.yaml").read_text())["fit"])
    keys = {key: REST[key] for key in ("incidence_deg", "exit_deg", "analyzer_deg")}
    assert load_recipe(write("recipes/mine.yaml", recipe="x", include=["lab/base.yaml", "fast", "metal"], **keys))


def test_a_key_in_another_form_replaces_the_included_one(folder):
    base(include="metal", exit={"start_deg": 0, "stop_deg": 60, "step_deg": 1}, incidence_deg=30, readings=2)
    rest = {"analyzer_deg": [0, 45, 90], "exposure_s": 0.03}
    path = write("recipes/mine.yaml", recipe="x", include="lab/base.yaml", exit_deg=[5, 6], **rest)
    assert load_recipe(path).recipe.exit_angles_deg() == (5, 6)
    path = write(
        "recipes/mine.yaml", recipe="x", include="lab/base.yaml", points=[{"incidence_deg": 1, "exit_deg": 2}], **rest
    )
    assert_array_equal(load_recipe(path).recipe.directions_deg(), [(1, 2, 0, 0)])


def test_files_that_include_each_other_are_refused_where_the_circle_closes(folder):
    base(include="../mine.yaml")
    (fault, *others) = [
        fault
        for fault in faults_of(write("recipes/mine.yaml", recipe="x", include=["lab/base.yaml", "metal"], **REST))
        if "includes itself" in fault
    ]
    assert not others
    assert fault.startswith("recipes/lab/base.yaml:4: key 'include': includes itself: mine.yaml includes base.yaml")


def test_a_file_included_twice_by_two_others_is_no_circle(folder):
    base(include="metal")
    write("recipes/lab/other.yaml", include=["base.yaml", "metal"])
    path = write("recipes/mine.yaml", recipe="x", include=["lab/other.yaml", "lab/base.yaml"], **REST)
    assert load_recipe(path).recipe.fit.free["sigma"] == (0.02, 1.0)


def test_endless_inclusion_ends(folder):
    base()
    for number in range(12):
        write(f"recipes/lab/n{number}.yaml", include=[f"n{number + 1}.yaml"] * 2)
    write("recipes/lab/n12.yaml", readings=1)
    faults = faults_of(
        write("recipes/mine.yaml", recipe="x", include=["lab/n0.yaml", "lab/base.yaml", "metal"], **REST)
    )
    assert any("is included file number 51; allowed: at most 50" in fault for fault in faults)


@pytest.mark.parametrize(
    ("content", "where", "words"),
    [
        (b"incidence_deg,exit_deg\n60,10\n60,x\n", "recipes/points.csv:3", "exit_deg is 'x'"),
        (b"\xff\xfe", "recipes/mine.yaml:4", "is not UTF-8 text"),
        (b"", "recipes/points.csv:1", "holds no table"),
        (b"incidence_deg,exit_deg\n60,80\n60,-85\n60,-84,\n", "recipes/points.csv:4", "3 values for 2 columns"),
    ],
)
def test_a_table_that_cannot_be_used_is_refused_at_its_own_line(folder, content, where, words):
    base(include="metal")
    Path("recipes/points.csv").write_bytes(content)
    keys = {key: REST[key] for key in ("analyzer_deg", "readings", "exposure_s")}
    path = write(
        "recipes/mine.yaml", recipe="x", include="lab/base.yaml", wavelength_nm=550, points_file="points.csv", **keys
    )
    (fault,) = faults_of(path)
    assert fault.startswith(f"{where}: ")
    assert words in fault


def test_a_table_beyond_the_limits_of_an_axis_is_refused_where_it_is_named(folder):
    base(include="metal")
    Path("recipes/points.csv").write_text("incidence_deg,exit_deg,azimuth_deg\n60,10,0\n60,10,350\n")
    keys = {key: REST[key] for key in ("analyzer_deg", "readings", "exposure_s")}
    (fault,) = faults_of(
        write("recipes/mine.yaml", recipe="x", include="lab/base.yaml", points_file="points.csv", **keys)
    )
    assert fault.startswith("recipes/mine.yaml:3: key 'points_file': asks for 350 degrees; allowed: -180 to 180")


def test_a_folder_is_no_table(folder):
    base(include="metal")
    keys = {key: REST[key] for key in ("analyzer_deg", "readings", "exposure_s")}
    (fault,) = faults_of(write("recipes/mine.yaml", recipe="x", include="lab/base.yaml", points_file="lab", **keys))
    assert "recipes/lab is not a file but a folder or a device" in fault


def test_every_preset_is_listed_with_what_it_is_for_and_can_be_used(folder):
    listed = CliRunner().invoke(cli, ["presets"]).output.splitlines()
    assert [line.split()[0] for line in listed] == list(preset_names())
    for name, line in zip(preset_names(), listed, strict=True):
        assert len(line) > 30, "its first line is a comment that says what it is for"
        base(include=[] if name in ("metal", "dielectric") else "metal")
        keys = yaml.safe_load((PRESETS / f"{name}.yaml").read_text())
        rest = {key: value for key, value in REST.items() if key not in keys}
        assert load_recipe(write("recipes/mine.yaml", recipe="x", include=[name, "lab/base.yaml"], **rest))


def test_the_presets_are_among_what_is_installed():
    import tomllib

    packaged = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]["package-data"]
    assert "presets/*.yaml" in packaged["goniometer"]
    assert len(preset_names()) >= 5
