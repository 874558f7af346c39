"""A camera behind a turning quarter-wave plate, at several incidences: all four Stokes parameters of every pixel."""

from pathlib import Path

import numpy as np
import pytest
import yaml

import goniometer
from model import materials
from model.lobes import Diffuse, Specular
from model.surface import Surface

ROOT = Path(__file__).resolve().parents[3]
LAMP = {"s1": 0.2, "s2": 0.6, "s3": 0.4}
INCIDENCES_DEG, EXITS_DEG = [20, 65], [0, 40]
STOKES = ("s0", "s1", "s2", "s3")


@pytest.fixture(scope="module")
def maps(tmp_path_factory, recipe_in):
    """The demonstration's iron, lit by elliptically polarized light, its analyzer replaced by that of a rig with S3."""
    folder = tmp_path_factory.mktemp("retarder")
    asked = {"incidence_deg": INCIDENCES_DEG, "exit_deg": EXITS_DEG, "dark": False, "exposure_s": 0.1, "readings": 2}
    # the analyzer has no blocked slot, so that dark current would count as light
    recipe = recipe_in(
        folder, **asked, lens=[], sensor={"electrons_per_count": 0.5, "read_counts": 4, "dark_counts": 200}
    )
    for kind, name in (("rig", "rigs/simulated_retarder.yaml"), ("scene", "scenes/iron_retarder.yaml")):
        content, other = (yaml.safe_load(path.read_text()) for path in (folder / f"{kind}.yaml", ROOT / name))
        content["devices"] |= {device: other["devices"][device] for device in ("rotator", "analyzer")}
        if kind == "scene":
            content["plate"]["patches"] = []
            content["effects"] = [{"effect": "polarized_lamp"} | LAMP]
        (folder / f"{kind}.yaml").write_text(yaml.safe_dump(content))
    changed = yaml.safe_load(recipe.read_text())
    changed |= {"analyzer_deg": [0, 0, 0, 0], "retarder_deg": [-51.7, -15.1, 15.1, 51.7]}
    del changed["imaging"]["registration"]
    recipe.write_text(yaml.safe_dump(changed))
    return goniometer.load_maps(goniometer.run(recipe, speed="max", out=folder / "runs", live_fit=False).folder)


def true_stokes(there):
    """S0 to S3 of iron in each pixel's own direction, turned from its own s-direction into that of the maps."""
    index = materials.index("Fe", 550.0)
    surface = Surface([Specular(0.7, 0.25, index), Diffuse(0.1, 0.25)])
    names = ("pixel_exit_deg", "pixel_azimuth_deg", "pixel_s_direction_deg")
    exit_rad, phi_rad, turn_rad = (np.radians(there[name].values.astype(float)) for name in names)
    incidence_rad = np.full(exit_rad.shape, np.radians(float(there.incidence_deg)))
    s0, s1, s2, s3 = np.moveaxis(surface.mueller(incidence_rad, exit_rad, phi_rad) @ [1.0, *LAMP.values()], -1, 0)
    cos2, sin2 = np.cos(2 * turn_rad), np.sin(2 * turn_rad)
    return s0, s1 * cos2 - s2 * sin2, s1 * sin2 + s2 * cos2, s3


def test_every_pixel_has_the_stokes_parameters_of_its_direction_within_their_errors(maps):
    assert sorted({float(angle) for angle in maps.incidence_deg.values.ravel().round(2)}) == INCIDENCES_DEG
    flat = maps.stack(direction=[name for name in maps.s0_per_sr.dims if name not in ("y_mm", "x_mm")])
    seen = 0
    for place in range(flat.sizes["direction"]):
        there = flat.isel(direction=place)
        if not (known := np.isfinite(there.s0_per_sr.values)).any():
            continue
        seen += 1
        truths = true_stokes(there)
        for name, truth in zip(STOKES, truths, strict=True):
            off = (there[f"{name}_per_sr"].values - truth)[known]
            pulls = off / there[f"{name}_stderr_per_sr"].values[known]
            assert 0.85 < np.sqrt((pulls**2).mean()) < 1.15, (name, place)
            assert abs(off.mean()) < 2e-3 * truths[0].mean(), (name, place)
    assert seen == len(INCIDENCES_DEG) * len(EXITS_DEG)
