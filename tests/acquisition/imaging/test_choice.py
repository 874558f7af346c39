"""What a recipe may ask of maps, and what it is told when it cannot have them."""

import pytest
import yaml
from pydantic import ValidationError

from acquisition.imaging.choice import Imaging, SampleArea
from acquisition.recipe import Recipe

BASE = """
recipe: maps
rig: rig.yaml
wavelength_nm: 550
incidence_deg: 60
exit: {start_deg: 0, stop_deg: 60, step_deg: 30}
analyzer_deg: [0, 45, 90, 135]
readings: 1
exposure_s: 0.1
fit: {lobes: [specular], free: {sigma: [0.1, 0.5], n: [1, 6]}, fixed: {k: 3}, search: sobol}
"""
AREA = {"x_mm": [-20, 20], "y_mm": [-11, 11], "pixel_mm": 0.2}


def recipe(**changes):
    return Recipe.model_validate({**yaml.safe_load(BASE), **changes})


def test_a_recipe_without_imaging_makes_no_maps_and_with_an_empty_one_those_in_the_cameras_pixels():
    assert recipe().imaging is None
    imaging = recipe(imaging={}).imaging
    assert (imaging.exposures, imaging.registration, imaging.area, imaging.material) == ((1.0,), None, None, None)


def test_the_pixels_of_an_area_cover_it_exactly():
    grid = SampleArea.model_validate({"x_mm": [-4, 8], "y_mm": [1, 3], "pixel_mm": 0.5}).grid
    assert (grid.width, grid.height) == (24, 4)
    assert (grid.x_mm()[0], grid.x_mm()[-1]) == (-3.75, 7.75)
    assert (grid.y_mm()[0], grid.y_mm()[-1]) == (2.75, 1.25)


@pytest.mark.parametrize(
    ("area", "what"),
    [
        ({"x_mm": [5, 5]}, r"x_mm: got \[5, 5\]; allowed: the lower end, then the higher one"),
        ({"y_mm": [3, -3]}, r"y_mm: got \[3, -3\]"),
        ({"pixel_mm": 0.3}, r"x_mm: is 40 mm long, 133\.333 pixels of pixel_mm; allowed: a whole number"),
        ({"x_mm": [-1000, 1000], "y_mm": [-1000, 1000], "pixel_mm": 0.1}, "400000000 pixels; allowed: at most"),
        ({"pixel_mm": 0}, "greater than 0"),
    ],
)
def test_an_area_that_cannot_be_cut_into_pixels_is_refused(area, what):
    with pytest.raises(ValidationError, match=what):
        SampleArea.model_validate({**AREA, **area})


@pytest.mark.parametrize(
    ("imaging", "what"),
    [
        ({"exposures": [0.5, 0.1]}, r"exposures: got \[0\.5, 0\.1\]; allowed: 1 first"),
        ({"exposures": [1, 0.1, 0.1]}, "each further one shorter"),
        ({"exposures": []}, "at least 1 item"),
        ({"exposures": [1, -0.1]}, "greater than 0"),
        ({"material": {"bin_px": 4}}, "material: needs area"),
        ({"registration": "sift"}, "phase"),
        ({"areas": AREA}, "Extra inputs"),
    ],
)
def test_what_cannot_be_had_is_refused(imaging, what):
    with pytest.raises(ValidationError, match=what):
        Imaging.model_validate(imaging)


@pytest.mark.parametrize(
    ("changes", "what"),
    [
        ({"generator_deg": [0, 45, 90, 135]}, "imaging: makes no maps behind a generator before the sample"),
        ({"wavelength_nm": [450, 550]}, "imaging: makes maps at one wavelength"),
        (
            {"fit": {"lobes": ["specular"], "free": {}, "fixed": {"sigma": 0.2, "n": 2, "k": 3, "rho_s": 1}}},
            "maps what fit leaves free, and nothing is free in it",
        ),
    ],
)
def test_what_maps_do_not_go_with_is_refused(changes, what):
    with pytest.raises(ValidationError, match=what):
        recipe(imaging={"area": AREA, "material": {}}, **changes)


def test_an_analyzer_that_turns_makes_no_maps():
    turning = {"analyzer_rotation": {"turns": 2}, "readings": 48, "dark": False}
    plain = {key: value for key, value in yaml.safe_load(BASE).items() if key != "analyzer_deg"}
    assert Recipe.model_validate({**plain, **turning}).analyzer_rotation is not None
    with pytest.raises(ValidationError, match="no maps behind an analyzer that turns while it is read"):
        Recipe.model_validate({**plain, **turning, "imaging": {}})
