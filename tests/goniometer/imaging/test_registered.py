"""A scan whose pictures are registered, before a sensor whose pixels differ."""

import numpy as np
import pytest
import yaml

from goniometer.run_recipe import run


@pytest.fixture
def maps(camera_recipe, stored, tmp_path):
    """Of a bare plate of a size, registered; at 0° the camera sees 66 mm of its width and 50 mm of its height."""

    def made(size_mm):
        recipe = camera_recipe([0, 60], sensor={"prnu": 0.05}, patches=False, imaging={"registration": "ecc"})
        scene = yaml.safe_load((tmp_path / "scene.yaml").read_text())
        scene["plate"]["size_mm"] = size_mm
        (tmp_path / "scene.yaml").write_text(yaml.safe_dump(scene))
        run(recipe, out=tmp_path / "runs", speed="max", live_fit=False)
        (folder,) = (tmp_path / "runs").iterdir()
        return stored(folder).maps()

    return made


def test_a_direction_whose_structure_lies_along_one_direction_has_no_map_and_says_what_to_do(maps):
    """At 0° the plate's left and right borders go through the picture, at 60° all four are in it."""
    found = maps([56, 80])
    assert np.isnan(found["S0"][0]).all()
    assert "lies along one direction, like a straight border" in found["notes"][0]
    assert np.isfinite(found["S0"][1]).mean() > 0.9
    assert found["notes"][1] == ""


def test_a_direction_in_which_only_the_sensor_has_structure_has_none_either(maps):
    found = maps([100, 300])
    assert "S0" not in found, "no direction has a map"
    for note in found["notes"]:
        assert "shares too little structure" in note
        assert "take registration out of the recipe" in note
