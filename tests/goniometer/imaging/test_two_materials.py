"""Iron and glass before a camera, from the recipe to the maps: where they are, what they are, and how well known."""

import importlib.util
import json
from pathlib import Path

import cv2
import h5py
import numpy as np
import pytest
from click.testing import CliRunner
from numpy.testing import assert_allclose, assert_array_equal

from goniometer.cli import cli
from goniometer.errors import SaturatedError
from goniometer.imaging.run_maps import run_maps
from goniometer.run_folder import measured

_spec = importlib.util.spec_from_file_location("two_materials", Path(__file__).with_name("two_materials.py"))
truth = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(truth)

ROOT = Path(__file__).resolve().parents[3]
SMALL = truth.Scene(edge_mm=2, disk_mm=(9, 0, 3), half_mm=6.1, right_mm=21)
WHOLE = truth.Scene(edge_mm=4, disk_mm=(12, 0, 5), half_mm=11, right_mm=20)
EXITS_DEG = [0, 15, 30, 45, 60]
AT_REST = {"sensor": {"dark_counts": 200, "dark_counts_per_s": 50}}
"""A sensor without noise: whatever differs is no chance."""
BLURRED = [{"effect": "blur", "sigma_px": 0.7}]
WEDGE = [*BLURRED, {"effect": "wedge", "deviation_px": 1.5, "direction_deg": 20}]


@pytest.fixture(scope="module")
def scan(tmp_path_factory, run_in):
    """Five directions, with all that the demonstration has; two exposures."""
    folder = tmp_path_factory.mktemp("scan")
    return run_in(folder, exit_deg=EXITS_DEG, imaging={"exposures": [1, 0.1], "material": {"bin_px": 4}})


@pytest.fixture(scope="module")
def maps(scan):
    return scan.maps()


def place(maps):
    return np.meshgrid(maps["x"], maps["y"])


def pulls(maps, scene, areas_px, margin_mm):
    """Of the DoLP of each material in each direction: error over stated error."""
    x, y = place(maps)
    found = {}
    for row, exit_deg in enumerate(maps["exit_angle"]):
        for name, where in scene.of_material(x, y, margin_mm).items():
            dolp, stderr = truth.dolp_of_mean(maps, row, where, areas_px[row])
            assert stderr < 0.005
            found[row, name] = (dolp - truth.true_dolp(name, x, y, where, exit_deg)) / stderr
    return np.array(list(found.values()))


def require_aligned(maps, scene, within_px):
    x, y = place(maps)
    for row, exit_deg in enumerate(maps["exit_angle"]):
        s0 = maps["S0"][row]
        off = (scene.edge_px(s0, x, y, exit_deg), *scene.disk_px(s0, x, y, exit_deg))
        assert_allclose(off, 0.0, atol=within_px, err_msg=f"edge along x, disk along x and y at {exit_deg}°")


def test_features_lie_at_their_place_in_all_directions(maps):
    assert_array_equal(maps["exit_angle"].round(2), EXITS_DEG)
    assert maps["notes"][:-1] == [""] * (len(EXITS_DEG) - 1)
    assert maps["notes"][-1] in ("", "not found: marker 0"), "at 60° markers of this size are hard to read"
    require_aligned(maps, SMALL, within_px=0.3)


def test_polarization_of_each_material_is_the_truth_within_its_error(scan, maps):
    areas_px = [one.noise_area_px for one in run_maps(measured(scan.folder))]
    off = pulls(maps, SMALL, areas_px, margin_mm=1.8)
    assert np.abs(off).max() < 3.5
    assert 0.5 < np.sqrt((off**2).mean()) < 1.5


def test_stokes_parameters_of_every_pixel_are_the_truth_within_its_error(maps):
    """Vignetting takes up to a percent of the light: S1 and S2 are compared over S0."""
    x, y = place(maps)
    for row, exit_deg in enumerate(maps["exit_angle"]):
        for name, where in SMALL.of_material(x, y, 1.8).items():
            true = truth.stokes(name, x[where], y[where], exit_deg)
            s0, s1, s2 = (maps[parameter][row][where] for parameter in ("S0", "S1", "S2"))
            assert_allclose(s0.mean(), true[:, 0].mean(), rtol=0.005)
            for found, column in ((s1, 1), (s2, 2)):
                errors = maps[f"S{column}_errors"][row][where]
                off = (found / s0 * true[:, 0] - true[:, column]) / errors
                assert np.sqrt((off**2).mean()) < 1.3, (name, exit_deg)
                assert abs(off.mean()) < 0.3, (name, exit_deg)


def test_every_pixel_has_its_own_direction(maps):
    x, y = place(maps)
    for row, exit_deg in enumerate(maps["exit_angle"]):
        exit_rad = np.radians(exit_deg)
        ray = truth.DISTANCE_MM * np.array([0.0, -np.sin(exit_rad), np.cos(exit_rad)]) - np.stack([x, y, 0 * x], -1)
        polar_deg = np.degrees(np.arccos(ray[..., 2] / np.linalg.norm(ray, axis=-1)))
        assert_allclose(maps["pixel_exit_angle"][row], polar_deg, atol=0.6)


def test_the_region_s_fit_while_the_camera_scans_finds_the_iron(scan):
    found = json.loads((scan.folder / "fit.json").read_text())["parameters"]
    for name, true in truth.TRUTH["iron"].items():
        estimate = found[name]
        assert estimate["truth"] == pytest.approx(true)
        assert abs(estimate["value"] - true) < 3.5 * estimate["stderr"], name
    assert found["sigma"]["stderr"] < 0.001


def test_the_nexus_file_holds_what_the_maps_were(scan, maps):
    made = list(run_maps(measured(scan.folder)))
    polarization = scan.maps("maps_dolp") | scan.maps("maps_aolp")
    for row, one in enumerate(made):
        for name in ("S0", "S1", "S2", "S0_S1_covariance", "S1_S2_covariance"):
            assert_array_equal(maps[name][row], one.maps[name])
        assert_allclose(maps["S1_errors"][row], np.sqrt(one.maps["S1_variance"]), rtol=1e-6)
        assert_array_equal(polarization["DoLP"][row], one.maps["DoLP"])
        assert_allclose(polarization["AoLP"][row], np.degrees(one.maps["AoLP_rad"]), rtol=1e-5, atol=1e-5)
    assert_allclose(maps["x"], made[0].grid.x_mm())
    assert_allclose(maps["y"], made[0].grid.y_mm())


def test_maps_of_the_material_hold_the_parameters_of_each(scan):
    with h5py.File(scan.folder / "scan.nxs") as file:
        process = file["entry/material_maps"]
        x, y = np.meshgrid(process["sigma/x"][()], process["sigma/y"][()])
        status, chi_square = process["status/status"][()], process["chi_square/chi_square"][()]
        freedom = process["degrees_of_freedom/degrees_of_freedom"][()]
        for name, where in SMALL.of_material(x, y, 2.3).items():
            assert where.sum() > 40
            assert (status[where] == 0).all()
            assert np.median(chi_square[where] / freedom[where]) < 2
            for parameter, true in truth.TRUTH[name].items():
                values, errors = (process[f"{parameter}/{parameter}{kind}"][()][where] for kind in ("", "_errors"))
                off = (values - true) / errors
                known = np.isfinite(off)
                assert np.median(np.abs(off[known])) < 1.5, (name, parameter)
                assert np.percentile(np.abs(off[known]), 95) < 4.0, (name, parameter)
        iron, glass = (process["sigma/sigma"][()][where] for where in SMALL.of_material(x, y, 2.3).values())
        assert iron.max() < 0.27 < glass.min()


def test_without_area_maps_are_in_the_camera_s_pixels(tmp_path, run_in):
    scan = run_in(tmp_path, exit_deg=[0, 60], imaging={"area": None, "registration": None}, lens=BLURRED)
    maps = scan.maps()
    assert maps["S0"].shape == (2, 150, 200)
    assert maps["notes"] == ["", ""]
    assert_array_equal(maps["x"], np.arange(200))
    region = np.s_[:, 70:80, 95:105]
    for one, s0, s1 in zip(measured(scan.folder).points, maps["S0"][region], maps["S1"][region], strict=True):
        stderr = np.sqrt(np.diag(one.covariance))
        assert_allclose((s0.mean(), s1.mean()), one.stokes[:2], atol=2 * stderr[:2].max(), rtol=0)
        assert stderr.max() < 3e-3 * one.stokes[0]


@pytest.fixture(scope="module")
def bright(tmp_path_factory, run_in):
    """Iron saturates the long exposure at 60°, glass does not."""
    folder = tmp_path_factory.mktemp("bright")
    return run_in(folder, exit_deg=[30, 60], exposure_s=0.8, imaging={"exposures": [1, 0.1]})


def test_what_saturates_in_the_long_exposure_comes_from_the_short_one(bright):
    signals = [one for one in bright.readings if one.kind == "signal"]
    assert [one.exposure_s for one in signals if one.point == 0] == pytest.approx([0.8] * 4)
    assert 0.08 in [round(one.exposure_s, 6) for one in signals if one.point == 1]
    maps = bright.maps()
    assert not any("saturated" in note for note in maps["notes"])
    assert np.isfinite(maps["S0"]).all()
    off = pulls(maps, SMALL, [one.noise_area_px for one in run_maps(measured(bright.folder))], margin_mm=1.8)
    assert np.abs(off).max() < 4


def test_a_region_that_is_saturated_in_the_only_exposure_ends_the_scan(tmp_path, run_in):
    with pytest.raises(SaturatedError, match="the detector was saturated: 100 of the region's 100 pixels"):
        run_in(tmp_path, exit_deg=[30, 60], exposure_s=0.8)


def test_registration_takes_out_what_a_wedge_makes_of_edges(tmp_path, run_in):
    asked = {"exit_deg": [30], **AT_REST}
    dolp = {}
    for name, lens, registration in (
        ("straight", BLURRED, None),
        ("moved", WEDGE, None),
        ("registered", WEDGE, "ecc"),
    ):
        scan = run_in(tmp_path / name, lens=lens, imaging={"registration": registration}, **asked)
        found = scan.maps()
        dolp[name] = scan.maps("maps_dolp")["DoLP"][0]
    x, y = place(found)
    edge = (np.abs(x - SMALL.edge_mm) < 0.5) & (np.abs(y) < 5)
    moved, registered = (np.abs(dolp[name] - dolp["straight"])[edge].max() for name in ("moved", "registered"))
    assert moved > 0.1
    assert registered < 0.1 * moved


def test_pictures_of_the_maps_are_drawn(tmp_path, run_in, map_drawing):
    with map_drawing():
        scan = run_in(tmp_path, exit_deg=[30], imaging={"registration": None}, lens=BLURRED)
    (page,) = (scan.folder / "maps").iterdir()
    assert page.name == "point_000_exit_+30.00.png"
    for path in (page, scan.folder / "maps.png"):
        drawn = cv2.imread(str(path))
        assert min(drawn.shape[:2]) > 200
        assert drawn.std() > 10


@pytest.mark.long
def test_the_whole_recipe(tmp_path):
    recipe = ROOT / "recipes" / "two_materials.yaml"
    done = CliRunner().invoke(cli, ["run", str(recipe), "--speed", "max", "--out", str(tmp_path)])
    assert done.exit_code == 0, done.output
    assert "maps of 13 of 13 directions" in done.output
    (folder,) = tmp_path.iterdir()
    with h5py.File(folder / "scan.nxs") as file:
        maps = {name: item[()] for name, item in file["entry/maps"].items() if isinstance(item, h5py.Dataset)}
    require_aligned(maps, WHOLE, within_px=0.1)
    off = pulls(maps, WHOLE, [one.noise_area_px for one in run_maps(measured(folder))], margin_mm=1.2)
    assert np.abs(off).max() < 3.5
    assert 0.6 < np.sqrt((off**2).mean()) < 1.2


def test_an_area_that_no_picture_shows_has_no_maps_and_says_so(run_in, tmp_path):
    area = {"x_mm": [60, 70], "y_mm": [-5, 5], "pixel_mm": 0.5}
    found = run_in(tmp_path, imaging={"area": area}, exit_deg=[30])
    with h5py.File(found.folder / "scan.nxs") as file:
        (note,) = file["entry/maps/notes"].asstr()[()]
    assert "Nothing of the recipe's area is known in this picture" in note
    assert len(found.readings) == 5
