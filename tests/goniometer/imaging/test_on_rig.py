"""What a rig must have for a recipe's maps, said before anything moves."""

from pathlib import Path

import pytest
import yaml

from goniometer.errors import ConfigurationError
from goniometer.load_files import load_recipe

ROOT = Path(__file__).resolve().parents[3]


def without_dark(folder, **sensor):
    """The recipe of two materials without dark pictures, on a rig whose sensor is described so."""
    rig = yaml.safe_load((ROOT / "rigs" / "simulated_camera.yaml").read_text())
    rig["devices"]["camera"]["sensor"] = {"read_counts": 4, "electrons_per_count": 0.5} | sensor
    (folder / "rig.yaml").write_text(yaml.safe_dump(rig))
    recipe = yaml.safe_load((ROOT / "recipes" / "two_materials.yaml").read_text())
    recipe |= {"rig": "rig.yaml", "scene": str(ROOT / "scenes" / "two_materials.yaml"), "dark": False}
    recipe["imaging"]["exposures"] = [1]
    (folder / "recipe.yaml").write_text(yaml.safe_dump(recipe))
    return folder / "recipe.yaml"


def test_without_dark_pictures_the_black_level_must_be_stated(tmp_path):
    with pytest.raises(
        ConfigurationError, match=r"key 'dark': is false, and .* does not state the sensor's black_counts"
    ):
        load_recipe(without_dark(tmp_path))
    assert not load_recipe(without_dark(tmp_path, black_counts=200)).recipe.dark
