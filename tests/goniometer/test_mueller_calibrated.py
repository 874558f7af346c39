"""A calibration that was measured without the generator serves a scan of Mueller matrices with it."""

import math
from pathlib import Path

import numpy as np
import pytest
import yaml

from goniometer.calibrating.command import calibrate
from goniometer.errors import ConfigurationError
from goniometer.load_files import load_calibration_recipe
from goniometer.run_folder import measured
from goniometer.run_recipe import run
from model.lobes import Diffuse, Directional, Specular
from model.surface import Surface

ROOT = Path(__file__).resolve().parents[2]
IRON = 2.950 + 2.932j
SURFACE = Surface([Specular(0.7, 0.1764, IRON), Diffuse(0.1, 0.1764), Directional(0.05, 0.1764, IRON)])
TURNS = {"velocity_deg_s": 10, "acceleration_deg_s2": 20, "settle_s": 0.05, "tolerance_deg": 0.01}
ROTATOR = {
    "driver": "thorlabs_apt",
    "port": "simulated",
    "stage": "K10CR1",
    "axes": {"generator_polarizer": {"limits_deg": [-90, 180], "home_at_start": True} | TURNS},
}
SCAN = {
    "rig": "../rigs/with_generator.yaml",
    "scene": "../scenes/with_generator.yaml",
    "exit": {"start_deg": 40, "stop_deg": 60, "step_deg": 5},
    "generator_deg": [0, 45, 90, 135],
    "readings": 2,
    "fit": {"lobes": ["diffuse"], "free": {"sigma": [0.1, 1.0]}},
}


def changed(folder, name, other, change):
    content = yaml.safe_load((ROOT / name).read_text(encoding="utf-8"))
    change(content)
    (folder / other).parent.mkdir(exist_ok=True)
    (folder / other).write_text(yaml.safe_dump(content), encoding="utf-8")
    return folder / other


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    """The bench of imperfect polarizers by itself, to be calibrated, and with a generator."""
    folder = tmp_path_factory.mktemp("bench")
    for name in ("rigs/simulated.yaml", "scenes/calibrate_polarizer.yaml"):
        changed(folder, name, name, lambda content: None)
    changed(
        folder,
        "rigs/simulated.yaml",
        "rigs/with_generator.yaml",
        lambda rig: rig["devices"].update(
            rotator=ROTATOR, generator={"driver": "rotating_generator", "slots": {1: 0, 2: 45, 3: 90, 4: 135}}
        ),
    )

    def with_generator(scene):
        scene["rig"] = "../rigs/with_generator.yaml"
        scene["devices"]["rotator"] = {"type": "thorlabs_apt", "stage": "K10CR1", "axes": {1: "generator_polarizer"}}
        scene["devices"]["generator"] = {"type": "rotating_generator"}

    changed(folder, "scenes/iron_imperfect_polarizers.yaml", "scenes/with_generator.yaml", with_generator)
    name = "recipes/calibrate_polarizer.yaml"
    recipe = changed(folder, name, name, lambda content: None)
    stored = folder / "calibrations" / "bench.yaml"
    calibrate([recipe], out=folder / "scans", speed="max", store=stored, ask=lambda what: None, tell=str)
    return folder


def pulls(bench, name, **more):
    recipe = changed(
        bench,
        "recipes/iron_imperfect_polarizers.yaml",
        f"recipes/{name}.yaml",
        lambda content: content.update(SCAN, **more),
    )
    points = measured(run(recipe, out=bench / name, speed="max", live_fit=False).folder).points
    found = []
    for point in points:
        true = SURFACE.mueller(math.radians(60), math.radians(point.exit_deg), math.pi)[:3, :3]
        found.append(np.linalg.solve(np.linalg.cholesky(point.mueller_covariance), (point.mueller - true).ravel()))
    return np.array(found)


def test_the_calibration_makes_the_elements_right_within_their_errors(bench):
    used = {"calibration": "../calibrations/bench.yaml", "calibration_max_age_days": 1}
    calibrated, taken_as_ideal = pulls(bench, "calibrated", **used), pulls(bench, "ideal")
    assert calibrated.shape == (5, 9)
    assert (calibrated**2).mean() < 2.0
    assert (taken_as_ideal**2).mean() > 20.0


def test_a_calibration_is_not_measured_behind_a_generator(bench):
    name = "recipes/calibrate_polarizer.yaml"
    recipe = changed(bench, name, name, lambda content: content.update(rig="../rigs/with_generator.yaml"))
    with pytest.raises(ConfigurationError, match=r"the light passes the generator of .*Take the generator out of the"):
        load_calibration_recipe(recipe)
