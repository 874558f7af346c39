"""A scan whose pictures are registered, before a sensor whose pixels differ."""

import numpy as np

from goniometer.run_recipe import run


def test_a_direction_in_which_only_the_sensor_has_structure_has_no_map_and_says_what_to_do(
    camera_recipe, stored, tmp_path
):
    """At 0° the plate fills the picture; at 60° its borders are in it."""
    recipe = camera_recipe([0, 60], sensor={"prnu": 0.05}, patches=False, imaging={"registration": "ecc"})
    run(recipe, out=tmp_path / "runs", speed="max", live_fit=False)
    (made,) = (tmp_path / "runs").iterdir()
    maps = stored(made).maps()
    assert np.isnan(maps["S0"][0]).all()
    assert "shares too little structure" in maps["notes"][0]
    assert "take registration out of the recipe" in maps["notes"][0]
    assert np.isfinite(maps["S0"][1]).mean() > 0.9
    assert maps["notes"][1] == ""
