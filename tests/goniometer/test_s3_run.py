"""Circular polarization from the bench to the files: retarders that turn, polarized lamps, and what is refused."""

import math
from pathlib import Path

import numpy as np
import pytest
import yaml
from numpy.testing import assert_allclose

import goniometer
from acquisition.measured_csv import read_measured_csv
from acquisition.measured_nexus import read_measured_nexus
from acquisition.stokes_csv import read_stokes_csv
from goniometer.check import describe_plan
from goniometer.errors import ConfigurationError
from goniometer.load_files import load_recipe
from goniometer.run_folder import measured
from model.lobes import Diffuse, Directional, Specular
from model.surface import Surface

ROOT = Path(__file__).resolve().parents[2]
SHORT = {"exit": {"start_deg": 0.0, "stop_deg": 60.0, "step_deg": 6.0}, "readings": 2}
IRON = 2.950 + 2.932j
LAMP = {"effect": "polarized_lamp", "s1": 0.3, "s2": 0.6, "s3": 0.5}


def k10cr1(role):
    """A rotator that rests within 1e-5 degrees of its target, so that nothing but noise is left: in rig and scene."""
    moves = {"velocity_deg_s": 10, "acceleration_deg_s2": 20, "settle_s": 0.05, "tolerance_deg": 0.01}
    axis = {"limits_deg": [-90, 180], "home_at_start": True} | moves
    in_rig = {"driver": "thorlabs_apt", "port": "simulated", "stage": "K10CR1", "axes": {role: axis}}
    return in_rig, {"type": "thorlabs_apt", "stage": "K10CR1", "axes": {1: role}}


def written(tmp_path, *, recipe=None, scene=None, analyzer=None, simulated=None, polarizer_turns=False):
    """The shipped recipe with S3 and its files, with a better rotator and other changes."""
    contents = {
        name: yaml.safe_load((ROOT / name).read_text())
        for name in ("recipes/iron_retarder.yaml", "rigs/simulated_retarder.yaml", "scenes/iron_retarder.yaml")
    }
    of_recipe, of_rig, of_scene = contents.values()
    of_recipe |= SHORT | (recipe or {})
    of_scene |= scene or {}
    of_rig["devices"]["analyzer"] |= analyzer or {}
    of_scene["devices"]["analyzer"] |= simulated or {}
    of_rig["devices"]["rotator"], of_scene["devices"]["rotator"] = k10cr1("retarder")
    if polarizer_turns:
        of_rig["devices"]["second"], of_scene["devices"]["second"] = k10cr1("polarizer")
        of_scene["devices"]["analyzer"].pop("polarizer_deg")
    for name, content in contents.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(yaml.safe_dump(content))
    return tmp_path / "recipes" / "iron_retarder.yaml"


def run(recipe, out):
    goniometer.run(recipe, out=out, speed="max")
    (folder,) = out.iterdir()
    return folder


def mueller(exit_deg):
    surface = Surface([Specular(0.7, 0.1764, IRON), Diffuse(0.1, 0.1764), Directional(0.05, 0.1764, IRON)])
    return surface.mueller(math.radians(60.0), math.radians(abs(exit_deg)), math.pi if exit_deg >= 0 else 0.0)


def pulls(points, lamp):
    """Measured less true in units of the predicted scatter, (N, 4): independent and of variance 1 if all is right."""
    return np.array(
        [
            np.linalg.solve(np.linalg.cholesky(point.covariance), point.stokes - mueller(point.exit_deg) @ lamp)
            for point in points
        ]
    )


def test_a_lamp_of_any_polarization_is_recovered(tmp_path):
    recipe = written(tmp_path, scene={"effects": [LAMP]})
    points = measured(run(recipe, tmp_path / "runs")).points
    assert all(point.has_s3 for point in points)
    truth = np.array([mueller(point.exit_deg) @ [1.0, 0.3, 0.6, 0.5] for point in points])
    assert_allclose([point.stokes for point in points], truth, atol=1e-5 * truth[:, 0].max())
    assert abs(truth[-1, 3]) > 0.15, "the case must have circular light to find"


def test_the_errors_of_all_four_describe_their_scatter(tmp_path):
    recipe = written(tmp_path, scene={"effects": [LAMP, {"effect": "read_noise", "power_w": 2.0e-9}]})
    rig = tmp_path / "rigs" / "simulated_retarder.yaml"
    rig.write_text(rig.read_text().replace("read_w: 2.0e-11", "read_w: 2.0e-09"))
    points = measured(run(recipe, tmp_path / "runs")).points
    scatter = pulls(points, [1.0, 0.3, 0.6, 0.5])
    assert abs((scatter**2).sum() - scatter.size) < 4 * math.sqrt(2 * scatter.size)


def test_unpolarized_light_from_iron_has_no_s3_and_the_fit_finds_the_scene(tmp_path):
    folder = run(written(tmp_path, recipe={"readings": 3}), tmp_path / "runs")
    points = read_stokes_csv(folder / "stokes.csv")
    s3 = np.array([point.stokes[3] / math.sqrt(point.covariance[3, 3]) for point in points])
    assert np.abs(s3).max() < 5
    data, _ = read_measured_nexus(folder / "scan.nxs")
    assert data.observable.columns == read_measured_csv(folder / "stokes.csv").observable.columns
    assert data.observable.columns == ("s0", "s1", "s2", "s3")
    text = (folder / "fit.json").read_text()
    assert abs(yaml.safe_load(text)["parameters"]["sigma"]["value"] - 0.1764) < 0.002


def test_a_true_retardance_other_than_the_stated_one_shrinks_s3_by_its_cosine(tmp_path):
    """The plate of the bench is 6 degrees off, and the lamp circular; as test_reduce derives it."""
    lamp = {"effect": "polarized_lamp", "s3": 1.0}
    recipe = written(tmp_path, scene={"effects": [lamp]}, simulated={"retardance_deg": 96.0})
    for point in measured(run(recipe, tmp_path / "runs")).points[5:]:
        s0, s1, _, s3 = mueller(point.exit_deg) @ [1.0, 0.0, 0.0, 1.0]
        e = math.radians(6.0)
        assert_allclose(point.stokes[[0, 3]], [s0 - s1 * math.sin(e), s3 * math.cos(e)], rtol=1e-4)


def test_both_elements_may_turn(tmp_path):
    pairs = {1: (0, 0), 2: (45, 45), 3: (90, 90), 4: (135, 135), 5: (45, 0), 6: (135, 0)}
    slots = {slot: {"polarizer_deg": one, "retarder_deg": other} for slot, (one, other) in pairs.items()}
    angles = {"analyzer_deg": [one for one, _ in pairs.values()], "retarder_deg": [one for _, one in pairs.values()]}
    recipe = written(
        tmp_path,
        recipe=angles,
        scene={"effects": [LAMP]},
        analyzer={"turns": ["polarizer", "retarder"], "slots": slots},
        polarizer_turns=True,
    )
    points = measured(run(recipe, tmp_path / "runs")).points
    truth = np.array([mueller(point.exit_deg) @ [1.0, 0.3, 0.6, 0.5] for point in points])
    assert_allclose([point.stokes for point in points], truth, atol=1e-5 * truth[:, 0].max())


def test_check_says_what_the_settings_tell(tmp_path):
    assert "analyzer: S0 to S3, condition number 3.4" in describe_plan(load_recipe(written(tmp_path)))
    linear = load_recipe(ROOT / "recipes" / "iron_60deg.yaml")
    assert "analyzer: S0 to S2, condition number 1.41" in describe_plan(linear)


def slots_of(*pairs):
    return {slot: {"polarizer_deg": one, "retarder_deg": other} for slot, (one, other) in enumerate(pairs, 1)}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"recipe": {"analyzer_deg": [0, 45, 90, 135], "retarder_deg": None}},
            "key 'retarder_deg': is missing: light always passes the retarder of .*Add one angle for each",
        ),
        (
            {"recipe": {"retarder_deg": [-51.7, -15.1, 15.1, 50.0]}},
            r"'retarder_deg.3.': got 50/0; allowed: the pairs of retarder and polarizer angle of .* -51.7/0, -15.1/0",
        ),
        (
            {
                "recipe": {"analyzer_deg": [0, 0, 0, 0], "retarder_deg": [-45, 0, 45, 90]},
                "analyzer": {"slots": slots_of((0, -45), (0, 0), (0, 45), (0, 90))},
            },
            "amount to 3 different ones; S0, S1, S2 and S3 need at least 4",
        ),
        (
            {"analyzer": {"retardance_deg": None}},
            "'devices.analyzer.retardance_deg': is missing, but the retarder turns",
        ),
        (
            {"analyzer": {"slots": slots_of((0, 0), (45, 15), (0, 30), (0, 45))}},
            "slots.2..polarizer_deg': got 45; allowed: 0, as in slot 1, because turns does not name the polarizer",
        ),
        ({"analyzer": {"slots": slots_of((0, 0), (0, 15), (0, 0))}}, "slots.3.': holds the angles of slot 1"),
        (
            {"analyzer": {"slots": {1: 0, 2: 45, 3: 90}}},
            r"slots.2.': got 45; allowed: both angles, .polarizer_deg: 45, retarder_deg: 0. for example",
        ),
        ({"analyzer": {"turns": ["retarder", "retarder"]}}, "names the retarder twice"),
        ({"analyzer": {"turns": ["lamp"]}}, "turns"),
        ({"simulated": {"retardance_deg": None}}, "retardance_deg': is missing; allowed: a retarder, as in"),
        ({"simulated": {"polarizer_deg": None}}, "turns polarizer and retarder; allowed: retarder, as in"),
        (
            {"scene": {"effects": [{"effect": "polarized_lamp", "s1": 0.9, "s3": 0.9}]}},
            "degree of polarization of 1.27",
        ),
    ],
)
def test_what_cannot_be_is_refused_with_its_place(tmp_path, changes, message):
    recipe = written(tmp_path, **changes)
    for name in ("recipes/iron_retarder.yaml", "rigs/simulated_retarder.yaml", "scenes/iron_retarder.yaml"):
        path = tmp_path / name
        content = yaml.safe_load(path.read_text())
        for section in (content, content.get("devices", {}).get("analyzer", {})):
            for key in [key for key, value in section.items() if value is None]:
                del section[key]
        path.write_text(yaml.safe_dump(content))
    with pytest.raises(ConfigurationError, match=message):
        load_recipe(recipe)


def test_a_retarder_that_the_rig_does_not_have_is_refused(tmp_path):
    content = yaml.safe_load((ROOT / "recipes" / "iron_60deg.yaml").read_text())
    content |= {"retarder_deg": [0, 0, 0, 0], "rig": str(ROOT / "rigs" / "simulated.yaml")}
    content["scene"] = str(ROOT / "scenes" / "iron.yaml")
    (tmp_path / "recipe.yaml").write_text(yaml.safe_dump(content))
    with pytest.raises(
        ConfigurationError, match=r"'retarder_deg': is given, but there is no retarder of .*Leave it out"
    ):
        load_recipe(tmp_path / "recipe.yaml")
