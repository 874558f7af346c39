"""Plates as scenes write them, and what is refused."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from pydantic import ValidationError

from goniometer.errors import ConfigurationError
from model.lobes import Diffuse, Specular
from model.surface import Surface
from sim_devices.camera.plate import Plate
from sim_devices.camera.render import Renderer
from sim_devices.camera.view import View
from sim_devices.sample import Sample

cv2 = pytest.importorskip("cv2")

PLAIN = {"index": {"n": 1.5, "k": 0.0}, "sigma": 0.17, "rho_s": 1.0, "rho_d": 0.2, "rho_dd": 0.0}
METAL = {"index": {"n": 2.95, "k": 2.93}, "sigma": 0.25, "rho_s": 0.6, "rho_d": 0.3, "rho_dd": 0.0}
DEFAULT = Sample(**PLAIN)
# 1 mm is 4 pixels, and the plate's middle lies between pixels
VIEW = View(80, 60, 600.0, (39.5, 29.5), 150.0)


def picture(layout, sample_azimuth_deg=0.0):
    return Renderer(layout, VIEW, 550.0).stokes(30, 0, sample_azimuth_deg)


def uniform(kind):
    return picture(Plate(size_mm=(60.0, 40.0)).load(None, Sample(**kind)))


def test_a_later_patch_lies_on_an_earlier_one():
    strip = {"rectangle_mm": [-5, -5, 5, 5], **METAL}
    disk = {"disk_mm": [0, 0, 2], **PLAIN}
    over = picture(Plate.model_validate({"size_mm": [60, 40], "patches": [strip, disk]}).load(None, DEFAULT))
    under = picture(Plate.model_validate({"size_mm": [60, 40], "patches": [disk, strip]}).load(None, DEFAULT))
    assert_array_equal(over[:, 30, 40], uniform(PLAIN)[:, 30, 40])
    assert_array_equal(under[:, 30, 40], uniform(METAL)[:, 30, 40])
    # 4 mm to the right of the middle is the strip, 6 mm is the plate
    for seen in (over, under):
        assert_array_equal(seen[:, 30, 55], uniform(METAL)[:, 30, 55])
        assert_array_equal(seen[:, 30, 64], uniform(PLAIN)[:, 30, 64])


def test_a_material_map_lies_upright_around_the_middle(tmp_path):
    # 3 x 2 cells of 2 mm; only the upper left one is of metal
    cells = np.full((2, 3), 255, np.uint8)
    cells[0, 0] = 7
    cv2.imwrite(str(tmp_path / "map.png"), cells)
    sections = {"image": "map.png", "pixel_mm": 2, "values": {7: METAL, 255: {**PLAIN, "rho_d": 0.9}}}
    seen = picture(Plate.model_validate({"size_mm": [60, 40], "material_map": sections}).load(tmp_path, DEFAULT))
    bright = uniform({**PLAIN, "rho_d": 0.9})
    # x from -3 to -1 mm and y from 0 to 2 mm: columns 28 to 35, rows 22 to 29
    assert_array_equal(seen[:, 22:30, 28:36], uniform(METAL)[:, 22:30, 28:36])
    assert_array_equal(seen[:, 30:38, 28:52], bright[:, 30:38, 28:52])
    assert_array_equal(seen[:, 22:30, 36:52], bright[:, 22:30, 36:52])
    assert_array_equal(seen[:, :22], uniform(PLAIN)[:, :22])


def test_a_roughness_map_takes_the_place_of_sigma_but_in_patches(tmp_path):
    # a ramp along x, of 16 bits, each cell as wide as 4 pixels
    ramp = np.tile(np.linspace(0, 65535, 60).astype(np.uint16), (40, 1))
    cv2.imwrite(str(tmp_path / "rough.png"), ramp)
    sections = {
        "roughness_map": {"image": "rough.png", "pixel_mm": 1, "sigma": [0.1, 0.3]},
        "patches": [{"rectangle_mm": [5, -5, 8, 5], **METAL}],
    }
    layout = Plate.model_validate({"size_mm": [60, 40], **sections}).load(tmp_path, DEFAULT)
    seen = picture(layout)
    assert_array_equal(seen[:, 30, 63], uniform(METAL)[:, 30, 63])
    x, y = VIEW.centres
    for column in (2, 21, 38, 57, 77):
        sigma = 0.1 + 0.2 * ramp[0, 20 + column // 4] / 65535
        surface = Surface([Specular(1.0, sigma, 1.5 + 0j), Diffuse(0.2, sigma)])
        tangent = math.hypot(x[30, column], y[30, column])
        phi = math.atan2(x[30, column], y[30, column])
        expected = surface.stokes(math.radians(30), math.atan(tangent), phi)
        assert_allclose(seen[0, 30, column], expected[0], rtol=2e-3)


def test_the_light_of_mapped_sigmas_is_right_to_a_thousandth(tmp_path):
    for low in np.linspace(0.1, 0.104, 7):
        # the levels start at the lowest sigma, that of the one black cell
        cells = np.full((40, 60), 100, np.uint8)
        cells[0, 0] = 0
        cv2.imwrite(str(tmp_path / "even.png"), cells)
        sections = {"image": "even.png", "pixel_mm": 1, "sigma": [float(low), 0.3]}
        layout = Plate.model_validate({"size_mm": [60, 40], "roughness_map": sections}).load(tmp_path, DEFAULT)
        sigma = float(low + (0.3 - low) * 100 / 255)
        assert_allclose(picture(layout)[:2], uniform({**PLAIN, "sigma": sigma})[:2], rtol=1e-3, atol=1e-7)


def refused(match, **sections):
    with pytest.raises(ValidationError, match=match):
        Plate.model_validate({"size_mm": [60, 40], **sections})


def test_what_cannot_be_is_refused():
    refused("exactly one of the two", patches=[METAL])
    refused("exactly one of the two", patches=[{**METAL, "disk_mm": [0, 0, 1], "rectangle_mm": [0, 0, 1, 1]}])
    refused("left of right", patches=[{**METAL, "rectangle_mm": [1, 0, 0, 1]}])
    refused("radius is above 0", patches=[{**METAL, "disk_mm": [0, 0, 0]}])
    refused("reaches over the edge", markers={"dictionary": "4x4_50", "size_mm": 6, "at_mm": {0: [26.5, 0]}})
    refused("has markers 0 to 49", markers={"dictionary": "4x4_50", "size_mm": 6, "at_mm": {50: [0, 0]}})
    refused("are square", markers={"dictionary": "4x5_50", "size_mm": 6, "at_mm": {0: [0, 0]}})
    refused("Extra inputs", patch=[])


def test_pictures_that_do_not_fit_are_refused(tmp_path):
    cv2.imwrite(str(tmp_path / "colour.png"), np.zeros((4, 4, 3), np.uint8))
    cv2.imwrite(str(tmp_path / "gray.png"), np.full((4, 4), 9, np.uint8))
    (tmp_path / "text.png").write_text("no picture")

    def load(**sections):
        Plate.model_validate({"size_mm": [60, 40], **sections}).load(tmp_path, DEFAULT)

    def mapped(image):
        return {"material_map": {"image": image, "pixel_mm": 1, "values": {0: METAL}}}

    with pytest.raises(ConfigurationError, match=r"nowhere\.png: there is no such picture"):
        load(**mapped("nowhere.png"))
    with pytest.raises(ConfigurationError, match="has 3 channels of uint8"):
        load(**mapped("colour.png"))
    with pytest.raises(ConfigurationError, match="cannot be read as a picture"):
        load(**mapped("text.png"))
    with pytest.raises(ConfigurationError, match=r"gray values \[9\], for which"):
        load(**mapped("gray.png"))
    with pytest.raises(ConfigurationError, match="covers 4 x 4 mm of a plate of 60 x 40 mm"):
        load(roughness_map={"image": "gray.png", "pixel_mm": 1, "sigma": [0.1, 0.2]})
    with pytest.raises(ConfigurationError, match="follows 3 bounces"):
        load(patches=[{**METAL, "disk_mm": [0, 0, 1], "bounces": 3}])
