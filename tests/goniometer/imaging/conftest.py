"""A small bench with a camera, two materials and four markers, and its runs and maps; and one without markers."""

from __future__ import annotations

import dataclasses
from contextlib import contextmanager
from pathlib import Path

import h5py
import pytest
import yaml

from acquisition.journal import Journal
from goniometer.imaging import map_results
from goniometer.run_recipe import run

ROOT = Path(__file__).resolve().parents[3]
WIDTH, HEIGHT, FOCAL_PX = 200, 150, 2150
MARKERS_MM = {0: [-17, 11.5], 1: [17, 11.5], 2: [17, -11.5], 3: [-17, -11.5]}
PATCHES = [
    {"rectangle_mm": [2, -6.1, 21, 6.1], "material": "BK7", "sigma": 0.3, "rho_s": 1, "rho_d": 0.05, "rho_dd": 0},
    {"disk_mm": [9, 0, 3], "material": "Fe", "sigma": 0.25, "rho_s": 0.7, "rho_d": 0.1, "rho_dd": 0},
]
AREA = {"x_mm": [-14, 20], "y_mm": [-6, 6], "pixel_mm": 0.25}
SMALL = {"width_px": 96, "height_px": 72}


@dataclasses.dataclass(frozen=True)
class Stored:
    """What a run left in its folder, read with nothing but the journal and h5py."""

    folder: Path
    readings: tuple
    frames: tuple
    about: dict

    @classmethod
    def of(cls, folder):
        with Journal.open(folder / "journal.sqlite") as journal:
            return cls(folder, journal.readings(), journal.frames(), journal.about())

    def maps(self, group="maps"):
        """All that an NXdata holds, by name; texts as str. Nothing where there is none."""
        with h5py.File(self.folder / "scan.nxs") as file:
            items = file[f"entry/{group}"].items() if group in file["entry"] else ()
            found = {name: item[()] for name, item in items if isinstance(item, h5py.Dataset)}
        if "notes" in found:
            found["notes"] = [note.decode() for note in found["notes"]]
        return found


@pytest.fixture(scope="session")
def stored():
    return Stored.of


@pytest.fixture(scope="session")
def recipe_in():
    """Writes recipe, rig and scene of the demonstration for a smaller camera, with changes, into a folder."""

    def written(folder, *, imaging=None, sensor=None, lens=None, camera=None, scene=None, rig=None, **recipe_changes):
        folder.mkdir(parents=True, exist_ok=True)
        rigs, scenes, recipes = (
            yaml.safe_load((ROOT / name).read_text())
            for name in ("rigs/simulated_camera.yaml", "scenes/two_materials.yaml", "recipes/two_materials.yaml")
        )
        driven, simulated = rigs["devices"]["camera"], scenes["devices"]["camera"]
        for one in (driven, simulated):
            one |= {"width_px": WIDTH, "height_px": HEIGHT}
        for one in (driven["optics"], simulated):
            one |= {"focal_px": FOCAL_PX, "centre_px": [(WIDTH - 1) / 2, (HEIGHT - 1) / 2]}
        driven["region"] = {"left": 95, "top": 70, "width": 10, "height": 10}
        rigs["holder"] |= {"marker_mm": 8, "markers": MARKERS_MM}
        scenes["plate"] |= {"size_mm": [46, 34], "patches": PATCHES}
        scenes["plate"]["markers"] |= {"size_mm": 8, "at_mm": MARKERS_MM}
        simulated["sensor"] = simulated["sensor"] if sensor is None else sensor
        simulated["lens"] = simulated["lens"] if lens is None else lens
        driven |= camera or {}
        del recipes["exit"], recipes["imaging"]["material"]
        asked = recipes["imaging"] | {"area": AREA, "exposures": [1]} | (imaging or {})
        recipes["imaging"] = {key: value for key, value in asked.items() if value is not None}
        recipes |= {"exit_deg": [0, 30, 60], "rig": "rig.yaml", "scene": "scene.yaml"} | recipe_changes
        scenes |= {"rig": "rig.yaml"} | (scene or {})
        for name, content in (("rig", rigs | (rig or {})), ("scene", scenes), ("recipe", recipes)):
            (folder / f"{name}.yaml").write_text(yaml.safe_dump(content))
        return folder / "recipe.yaml"

    return written


@pytest.fixture(scope="session")
def run_in(recipe_in):
    """Runs such a recipe in virtual time without fits while it scans."""

    def done(folder, **changes):
        run(recipe_in(folder, **changes), out=folder / "runs", speed="max", live_fit=False)
        (made,) = (folder / "runs").iterdir()
        return Stored.of(made)

    return done


@pytest.fixture(scope="session")
def map_drawing():
    """With this, maps are drawn as they are by default."""
    drawn = {name: getattr(map_results, name) for name in ("draw_maps", "draw_overview", "draw_parameters")}

    @contextmanager
    def drawing():
        with pytest.MonkeyPatch.context() as patch:
            for name, draw in drawn.items():
                patch.setattr(map_results, name, draw)
            yield

    return drawing


@pytest.fixture(scope="module", autouse=True)
def no_map_pictures(map_drawing):
    """Leaves out the pictures of maps, which take longer than the maps, unless `map_drawing`."""
    with pytest.MonkeyPatch.context() as patch:
        for name in ("draw_maps", "draw_overview", "draw_parameters"):
            patch.setattr(map_results, name, lambda *args, **options: None)
        yield


@pytest.fixture
def camera_recipe(tmp_path):
    """Writes a recipe with its rig and scene; `sensor` and `lens` are simulated, `camera` joins the rig's entry."""

    def written(exit_deg=(0, 30, 60), sensor=None, lens=(), camera=None, patches=True, **changes):
        rig = yaml.safe_load((ROOT / "rigs" / "simulated_camera.yaml").read_text())
        scene = yaml.safe_load((ROOT / "scenes" / "two_materials.yaml").read_text())
        recipe = yaml.safe_load((ROOT / "recipes" / "two_materials.yaml").read_text())
        del rig["holder"], scene["plate"]["markers"]
        if not patches:
            scene["plate"] = {"size_mm": [100, 80]}
        held = rig["devices"]["camera"]
        held |= SMALL | {"region": {"left": 40, "top": 30, "width": 16, "height": 12}} | (camera or {})
        held["optics"] |= {"focal_px": 720, "centre_px": [47.5, 35.5]}
        simulated = scene["devices"]["camera"]
        simulated["lens"] = list(lens)
        simulated |= SMALL | {"focal_px": 720, "centre_px": [47.5, 35.5]}
        simulated["sensor"] |= sensor or {}
        recipe |= {"rig": "rig.yaml", "exit_deg": list(exit_deg), "imaging": {"exposures": [1, 0.1]}, **changes}
        recipe |= {"scene": "scene.yaml"}
        recipe["fit"] |= {"free": {"sigma": [0.05, 0.6]}, "fixed": {"n": 2.95, "k": 2.93}}
        del recipe["exit"]
        scene["rig"] = "rig.yaml"
        for name, document in (("rig", rig), ("scene", scene), ("recipe", recipe)):
            (tmp_path / f"{name}.yaml").write_text(yaml.safe_dump(document, sort_keys=False))
        return tmp_path / "recipe.yaml"

    return written
