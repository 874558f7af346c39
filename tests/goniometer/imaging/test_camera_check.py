"""What is said of a camera's recipe before it is run, and what is refused."""

from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml

from acquisition.imaging.light.flat import Flat
from goniometer.check import describe_plan
from goniometer.errors import ConfigurationError
from goniometer.load_files import load_recipe

ROOT = Path(__file__).resolve().parents[3]
FILES = {"recipe": "recipes/two_materials.yaml", "rig": "rigs/simulated_camera.yaml"}
FILES["scene"] = "scenes/two_materials.yaml"


@pytest.fixture
def load(tmp_path):
    """The demo with changes: a function that is given recipe, rig and scene, and alters them in place."""

    def loaded(change=lambda recipe, rig, scene: None):
        content = {name: yaml.safe_load((ROOT / path).read_text()) for name, path in FILES.items()}
        content["recipe"] |= {"rig": "rig.yaml", "scene": "scene.yaml"}
        content["scene"]["rig"] = "rig.yaml"
        change(**content)
        for name, document in content.items():
            (tmp_path / f"{name}.yaml").write_text(yaml.safe_dump(document, sort_keys=False))
        return load_recipe(tmp_path / "recipe.yaml")

    return loaded


def test_the_plan_tells_how_many_pictures_of_which_exposures_and_how_large(load):
    told = describe_plan(load())
    # 65 readings of 2 pictures, 2 bytes a pixel; 200 x 110 pixels of 0.2 mm, 16 planes of float32
    assert "each reading is 2 pictures of 0.2 s and 0.02 s; 130 of 480 x 360 pixels, at most 44.9 MB" in told
    assert "maps: 13 directions of 200 x 110 pixels, at most 18.3 MB" in told


def test_maps_in_the_cameras_pixels_and_no_maps(load):
    def in_camera(recipe, rig, scene):
        recipe["imaging"] = {}

    def none(recipe, rig, scene):
        del recipe["imaging"]

    assert "maps: 13 directions of 480 x 360 pixels, at most 117 MB" in describe_plan(load(in_camera))
    told = describe_plan(load(none))
    assert "each reading is a picture of 0.2 s; 65 of 480 x 360 pixels" in told
    assert "maps:" not in told


def _named_flat(recipe, rig, scene):
    rig["devices"]["camera"]["flat"] = "flat.tiff"


def _no_holder(recipe, rig, scene):
    del rig["holder"]


def _no_optics(recipe, rig, scene):
    del rig["devices"]["camera"]["optics"]


def _no_black(recipe, rig, scene):
    del rig["devices"]["camera"]["sensor"]["black_counts"]


def _smaller(recipe, rig, scene):
    scene["devices"]["camera"]["height_px"] = 300


def _shallow(recipe, rig, scene):
    scene["devices"]["camera"]["bits"] = [8, 12]


def _other_lens(recipe, rig, scene):
    scene["devices"]["camera"]["focal_px"] = 3000


def _off_centre(recipe, rig, scene):
    scene["devices"]["camera"]["centre_px"] = [239.5, 209.5]


def _no_markers(recipe, rig, scene):
    del scene["plate"]["markers"]


def _other_set(recipe, rig, scene):
    scene["plate"]["markers"]["dictionary"] = "5x5_50"


def _other_size(recipe, rig, scene):
    scene["plate"]["markers"]["size_mm"] = 5


def _other_place(recipe, rig, scene):
    scene["plate"]["markers"]["at_mm"][2] = [26, 5]


def _other_number(recipe, rig, scene):
    markers = scene["plate"]["markers"]["at_mm"]
    markers[7] = markers.pop(1)


@pytest.mark.parametrize(
    ("change", "file", "key", "message"),
    [
        (_named_flat, "rig", "devices.camera.flat", r"\S+flat\.tiff is not there"),
        (_no_holder, "recipe", "imaging.area", "needs the holder, of which"),
        (_no_optics, "recipe", "imaging.area", "needs the optics of the camera"),
        (_no_black, "recipe", "imaging.exposures", "needs the sensor's black_counts"),
        (_smaller, "scene", "devices.camera.height_px", "got 300; allowed: 360"),
        (_shallow, "scene", "devices.camera.bits", "has no 16; allowed: 16 among them"),
        (_other_lens, "scene", "devices.camera.focal_px", "got 3000; allowed: about 3600"),
        (_off_centre, "scene", "devices.camera.centre_px", r"allowed: about \[239\.5, 179\.5\]"),
        (_no_markers, "scene", "plate", "has no markers; allowed: those of the holder in"),
        (_other_set, "scene", "plate.markers.dictionary", "is DICT_5X5_50; allowed: DICT_4X4_50"),
        (_other_size, "scene", "plate.markers.size_mm", "got 5; allowed: about 6"),
        (_other_place, "scene", r"plate.markers.at_mm\[2\]", r"got \[26.0, 5.0\]; allowed: about \[26.0, -15.0\]"),
        (_other_number, "scene", "plate.markers.at_mm", "does not hold marker 1, which the holder in"),
    ],
)
def test_what_is_refused_before_anything_moves(load, change, file, key, message):
    with pytest.raises(ConfigurationError, match=rf"{file}\.yaml:\d+: key '{key}': .*{message}") as refused:
        load(change)
    assert len(refused.value.faults) == 1


def even(height, width):
    return Flat(np.ones((height, width), np.float32), np.full((height, width), 1e-6, np.float32))


def cut(path):
    even(360, 480).save(path)
    path.write_bytes(path.read_bytes()[: 3 * path.stat().st_size // 4])


def cut_mask(path):
    mask(360, 480)(path)
    path.write_bytes(path.read_bytes()[:-20])


def mask(height, width, value=0):
    return lambda path: path.write_bytes(cv2.imencode(".png", np.full((height, width), value, np.uint8))[1].tobytes())


UNFIT = {
    "size": (
        "flat",
        even(100, 90).save,
        r"is of 90 x 100 pixels, and the camera's pictures have 480 x 360 \(width_px,",
    ),
    "text": ("flat", lambda path: path.write_text("hello"), "is no flat: it must be a TIFF of two pages"),
    "broken": ("flat", cut, "is no flat: it must be a TIFF of two pages"),
    "folder": ("flat", lambda path: path.mkdir(), "cannot be read: "),
    "mask's size": ("bad_pixels", mask(480, 360), "is of 360 x 480 pixels"),
    "broken mask": ("bad_pixels", cut_mask, "is no mask of bad pixels"),
    "inverted mask": ("bad_pixels", mask(360, 480, 255), r"marks 100\.0% of the pixels as bad, where black is good"),
    "no mask": ("bad_pixels", lambda path: path.write_text("hello"), "is no mask of bad pixels"),
}


@pytest.mark.parametrize("unfit", UNFIT)
def test_a_file_of_the_sensor_that_no_maps_can_use_is_refused_where_the_rig_names_it(load, tmp_path, capfd, unfit):
    key, write, message = UNFIT[unfit]
    write(tmp_path / "file of mine")

    def named(recipe, rig, scene):
        rig["devices"]["camera"][key] = "file of mine"

    expected = rf"^\S+rig\.yaml:\d+: key 'devices\.camera\.{key}': \S+file of mine {message}"
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_WARNING)  # as it begins
    with pytest.raises(ConfigurationError, match=expected) as refused:
        load(named)
    assert len(refused.value.faults) == 1
    assert capfd.readouterr().err == "", "OpenCV has said something itself"


def test_files_of_the_sensor_that_fit_are_accepted(load, tmp_path):
    even(360, 480).save(tmp_path / "flat.tiff")
    load(_named_flat)


def test_what_a_person_may_know_wrongly_of_lens_and_holder_is_no_fault(load):
    def a_little_off(recipe, rig, scene):
        rig["devices"]["camera"]["optics"] |= {"focal_px": 3650, "centre_px": [243, 177], "distortion": [0, 0, 0, 0, 0]}
        rig["holder"]["markers"][1] = [26.2, 15.1]

    load(a_little_off)
