from __future__ import annotations

import json
from pathlib import Path

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from goniometer.errors import ConfigurationError
from goniometer.load_files import CalibrationSetup, SceneSetup, Setup, load_file, load_recipe, load_scene
from goniometer.rig_file import Rig
from goniometer.schema import MODELS, schema

ROOT = Path(__file__).parents[2]
ALL_RECIPES = sorted((ROOT / "recipes").glob("*.yaml"))
RECIPES = [path for path in ALL_RECIPES if not path.name.startswith("calibrate_")]
SCENES = sorted((ROOT / "scenes").glob("*.yaml"))
RIGS = sorted((ROOT / "rigs").glob("*.yaml"))


@pytest.fixture
def bench_folder(tmp_path: Path) -> Path:
    for folder in ("recipes", "rigs", "scenes"):
        (tmp_path / folder).mkdir()
        for file in (ROOT / folder).glob("*.yaml"):
            (tmp_path / folder / file.name).write_bytes(file.read_bytes())
    return tmp_path


def change(path: Path, *changes: tuple[str, str]) -> Path:
    text = path.read_text(encoding="utf-8")
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("path", RECIPES, ids=lambda path: path.stem)
def test_the_recipes_that_come_with_the_project_are_accepted(path: Path) -> None:
    setup = load_file(path)
    assert isinstance(setup, Setup)
    assert setup.rig.is_simulated
    assert setup.scene is not None
    text = path.read_text(encoding="utf-8")
    assert (setup.recipe_text == text) == ("\ninclude:" not in text)
    assert len(setup.recipe.directions_deg()) in (12, 13, 31, 41, 61, 78, 80, 121)
    known = setup.recipe.fit.fixed
    truth = setup.scene.truth()
    for name, (low, high) in setup.recipe.fit.free.items():
        assert low < truth[name] < high
    assert {name: truth[name] for name in known} == known


@pytest.mark.parametrize("path", sorted(set(ALL_RECIPES) - set(RECIPES)), ids=lambda path: path.stem)
def test_the_recipes_for_calibrations_that_come_with_the_project_are_accepted(path: Path) -> None:
    setup = load_file(path)
    assert isinstance(setup, CalibrationSetup)
    assert setup.rig.is_simulated
    assert setup.scene is not None


@pytest.mark.parametrize("path", SCENES, ids=lambda path: path.stem)
def test_the_scenes_that_come_with_the_project_are_accepted(path: Path) -> None:
    assert isinstance(load_file(path), SceneSetup)
    assert load_scene(path).rig.is_simulated


@pytest.mark.parametrize("path", RIGS, ids=lambda path: path.stem)
def test_the_rigs_that_come_with_the_project_are_accepted(path: Path) -> None:
    assert isinstance(load_file(path), Rig)


@pytest.mark.parametrize("path", RECIPES + SCENES + RIGS, ids=lambda path: path.stem)
def test_every_file_says_in_its_first_line_what_it_is(path: Path) -> None:
    assert path.read_text(encoding="utf-8").startswith("# ")


def test_another_rig_replaces_that_of_the_recipe(bench_folder: Path) -> None:
    real = bench_folder / "rigs" / "example_hardware.yaml"
    setup = load_recipe(bench_folder / "recipes" / "iron_60deg.yaml", real)
    assert (setup.rig_path, setup.rig.rig) == (real, "example bench")
    assert (setup.scene, setup.scene_text) == (None, "")


def test_faults_of_recipe_rig_and_scene_come_in_one_report_sorted_by_file_and_line(bench_folder: Path) -> None:
    recipe = change(bench_folder / "recipes" / "iron_60deg.yaml", ("readings: 3", "readings: 0"), ("sobol", "on"))
    rig = change(bench_folder / "rigs" / "simulated.yaml", ("slot_s: 0.5", "slot_ms: 500"))
    scene = change(bench_folder / "scenes" / "iron.yaml", ("seed: 1 ", "seed: -1"), ("Fe", "Iron"))
    with pytest.raises(ConfigurationError) as caught:
        load_recipe(recipe)
    places = [fault.split(": ")[0] for fault in caught.value.faults]
    assert places == [f"{recipe}:11", f"{recipe}:17", f"{rig}:22", f"{scene}:4", f"{scene}:5"]
    assert str(caught.value) == "\n".join(caught.value.faults)


def test_what_a_recipe_asks_of_an_analyzer_must_be_in_its_slots(bench_folder: Path) -> None:
    recipe = change(
        bench_folder / "recipes" / "iron_60deg.yaml", ("dark:", "reference: {exit_deg: -45, every_points: 20}\ndark:")
    )
    change(
        bench_folder / "rigs" / "simulated.yaml",
        ("1: open", "1: 22.5"),
        ("6: blocked", "6: 67.5"),
        ("-85, 85", "-5, 40"),
    )
    with pytest.raises(ConfigurationError) as caught:
        load_recipe(recipe)
    faults = "\n".join(caught.value.faults)
    assert len(caught.value.faults) == 4
    assert "key 'reference': needs an open slot" in faults
    assert "key 'dark': needs a blocked slot" in faults
    assert "key 'reference.exit_deg': asks for -45 degrees; allowed: -5 to 40, the limits of detector_arm" in faults
    assert "key 'exit.stop_deg': asks for 60 degrees; allowed: -5 to 40" in faults


def test_angles_are_looked_up_before_the_offset_is_added(bench_folder: Path) -> None:
    change(bench_folder / "rigs" / "simulated.yaml", ("offset_deg: 0", "offset_deg: 90"))
    assert load_recipe(bench_folder / "recipes" / "iron_60deg.yaml").rig.analyzer.offset_deg == 90


def test_a_bench_served_elsewhere_is_checked_against_the_scene(bench_folder: Path) -> None:
    change(
        bench_folder / "rigs" / "example_hardware.yaml",
        ("calibration:", "bench: socket://127.0.0.1:5000\ncalibration:"),
        ("unit: 1", "unit: 2"),
    )
    with pytest.raises(ConfigurationError, match=r"'devices.sample_stage.unit': got 1; allowed: 2"):
        load_recipe(bench_folder / "recipes" / "iron_60deg.yaml", bench_folder / "rigs" / "example_hardware.yaml")


@pytest.mark.parametrize("name", ["none.yaml", ".", '"\\0"', "x" * 5000, '"\\ud800"', "/dev/null"])
def test_a_rig_that_cannot_be_read_is_a_fault_of_the_line_that_names_it(bench_folder: Path, name: str) -> None:
    recipe = change(bench_folder / "recipes" / "iron_60deg.yaml", ("../rigs/simulated.yaml", name))
    with pytest.raises(ConfigurationError) as caught:
        load_recipe(recipe)
    assert [fault.partition(": key 'rig': ")[0] for fault in caught.value.faults] == [f"{recipe}:4"]


def test_files_of_the_current_folder_are_named_from_there(bench_folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(bench_folder)
    change(Path("rigs/simulated.yaml"), ("unit: 1", "unit: 99"))
    with pytest.raises(ConfigurationError, match=r"^rigs/simulated.yaml:14: key 'devices.sample_stage.unit': got 99"):
        load_recipe(Path("recipes/iron_60deg.yaml"))


@pytest.mark.parametrize("kind", ["recipe", "rig", "scene"])
def test_the_schema_describes_every_key_and_is_json(kind: str) -> None:
    printed = json.loads(json.dumps(schema(kind)))
    assert printed["$schema"].startswith("https://json-schema.org/")
    included = {"include"} if kind == "recipe" else set()
    assert set(printed["properties"]) == set(MODELS[kind].model_fields) | included
    assert '"null"' not in json.dumps(printed)
    if kind != "scene":
        assert not list(keys_without_description(printed))


def keys_without_description(node: object):
    if isinstance(node, dict):
        for name, value in node.get("properties", {}).items():
            if "description" not in value:
                yield name
        for value in node.values():
            yield from keys_without_description(value)
    elif isinstance(node, list):
        for value in node:
            yield from keys_without_description(value)


VALUES = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(10**30), 10**30)
    | st.floats()
    | st.text(max_size=8)
    | st.sampled_from(
        ["simulated", "on", "1e-3", "newport_esp301", "sobol", 0, 45, "open", "\x00", "\ud800", "x" * 300]
    ),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5) | st.integers(), inner, max_size=3),
    max_leaves=4,
)


def every_place(data: object, place: tuple = ()):
    yield place
    items = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    for key, value in items:
        yield from every_place(value, (*place, key))


@settings(max_examples=100, deadline=None)
@given(st.data())
def test_no_value_in_any_place_raises_anything_but_configuration_errors(tmp_path_factory, data: st.DataObject) -> None:
    folder, name = data.draw(st.sampled_from([("recipes", "iron_60deg"), ("rigs", "simulated"), ("scenes", "iron")]))
    content = yaml.safe_load((ROOT / folder / f"{name}.yaml").read_text(encoding="utf-8"))
    for _ in range(data.draw(st.integers(1, 3))):
        place = data.draw(st.sampled_from(list(every_place(content))[1:]))
        target = content
        for key in place[:-1]:
            target = target[key]
        if data.draw(st.booleans()):
            target[place[-1]] = data.draw(VALUES)
        else:
            del target[place[-1]]
    check(tmp_path_factory, folder, yaml.safe_dump(content).encode("utf-8", "replace"))


@settings(max_examples=100, deadline=None)
@given(st.data())
def test_no_text_raises_anything_but_configuration_errors(tmp_path_factory, data: st.DataObject) -> None:
    folder, name = data.draw(st.sampled_from([("recipes", "iron_60deg"), ("rigs", "simulated"), ("scenes", "iron")]))
    content = (ROOT / folder / f"{name}.yaml").read_bytes()
    for _ in range(data.draw(st.integers(1, 3))):
        start = data.draw(st.integers(0, len(content)))
        end = min(len(content), start + data.draw(st.integers(0, 20)))
        pieces = [
            b"",
            b":",
            b"- ",
            b"\t",
            b"\n",
            b"&a ",
            b"*a",
            b"!!x ",
            b"{",
            b"]",
            b"'",
            b"\xff",
            b"#",
            b"---\n",
            b"? ",
        ]
        content = content[:start] + data.draw(st.sampled_from(pieces) | st.binary(max_size=4)) + content[end:]
    check(tmp_path_factory, folder, content)


def check(tmp_path_factory, folder: str, content: bytes) -> None:
    base = tmp_path_factory.getbasetemp() / "mutated"
    for other in ("recipes", "rigs", "scenes"):
        (base / other).mkdir(parents=True, exist_ok=True)
    for other in ("rigs", "scenes"):
        for file in (ROOT / other).glob("*.yaml"):
            (base / other / file.name).write_bytes(file.read_bytes())
    path = base / folder / "mutated.yaml"
    path.write_bytes(content)
    report = f"{base}: accepted"
    try:
        load_file(path)
    except ConfigurationError as error:
        report = str(error)
    assert report.startswith(str(base))
    report.encode()


@pytest.mark.parametrize(
    ("load", "name", "message"),
    [
        (load_recipe, "scenes/iron.yaml", "this is a scene, and a recipe is needed here"),
        (load_recipe, "rigs/simulated.yaml", "this is a rig, and a recipe is needed here"),
        (load_scene, "recipes/iron_60deg.yaml", "this is a recipe, and a scene is needed here"),
    ],
)
def test_a_file_of_another_kind_is_named_as_what_it_is(load, name: str, message: str) -> None:
    with pytest.raises(ConfigurationError, match=message) as caught:
        load(ROOT / name)
    assert len(caught.value.faults) == 1
