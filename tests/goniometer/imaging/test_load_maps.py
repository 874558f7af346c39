"""Maps out of a run's NeXus file, with labels."""

from pathlib import Path

import h5py
import numpy as np
import pytest
import yaml
from numpy.testing import assert_allclose, assert_array_equal

import goniometer
from acquisition.imaging.maps.direction_maps import DirectionMaps
from acquisition.imaging.maps.nexus_maps import write_maps
from acquisition.imaging.place.map_grid import MapGrid
from goniometer.errors import JournalError

GRID = MapGrid(left_mm=-3.0, top_mm=2.0, pixel_mm=0.5, width=12, height=8)
NAMES = ("S0", "S1", "S2", "S0_variance", "S1_variance", "S2_variance", "DoLP", "DoLP_variance", "AoLP_rad")


RIG = (Path(__file__).resolve().parents[3] / "rigs" / "simulated_camera.yaml").read_text()


def direction(point, exit_deg, grid=GRID, incidence_deg=60.0, **more):
    random = np.random.default_rng(point)
    maps = {name: random.uniform(0.1, 0.5, (8, 12)).astype(np.float32) for name in NAMES}
    return DirectionMaps(point, incidence_deg, exit_deg, 0.0, None, grid, maps, **more)


def written(folder, directions):
    with h5py.File(folder / "scan.nxs", "w") as file:
        entry = file.create_group("entry")
        entry["provenance/rig/data"] = RIG
        write_maps(entry, iter(directions))
    return goniometer.load_maps(folder)


def test_maps_come_back_with_places_units_and_errors(tmp_path):
    made = [direction(0, 10.0), direction(1, 35.0), direction(2, -20.0)]
    found = written(tmp_path, made)
    assert dict(found.sizes) == {"exit_deg": 3, "y_mm": 8, "x_mm": 12}
    for one in made:
        there = found.sel(exit_deg=one.exit_deg)
        assert int(there.point) == one.point
        assert float(there.incidence_deg) == 60.0
        assert_array_equal(there.s0_per_sr, one.maps["S0"])
        assert_allclose(there.s1_stderr_per_sr, np.sqrt(one.maps["S1_variance"]), rtol=1e-6)
        assert_allclose(there.dolp_stderr, np.sqrt(one.maps["DoLP_variance"]), rtol=1e-6)
        assert_allclose(there.aolp_deg, np.degrees(one.maps["AoLP_rad"]), rtol=1e-6)
        corner = there.s2_per_sr.sel(x_mm=-2.75, y_mm=1.75)
        assert float(corner) == one.maps["S2"][0, 0], "the first pixel is the one at the left and above"
    assert found.s0_per_sr.attrs["units"] == "1/sr"


def test_a_direction_without_maps_is_nan_and_says_why(tmp_path):
    hidden = DirectionMaps(1, 60.0, 35.0, 0.0, None, GRID, notes=("two markers are hidden",))
    found = written(tmp_path, [direction(0, 10.0), hidden])
    assert np.isnan(found.s0_per_sr.sel(exit_deg=35.0)).all()
    assert str(found.notes.sel(exit_deg=35.0).item()) == "two markers are hidden"


def test_exit_angles_that_stand_twice_are_told_apart_by_their_points(tmp_path):
    found = written(tmp_path, [direction(4, 10.0), direction(7, 10.0)])
    assert_array_equal(found.point, [4, 7])
    assert_array_equal(found.s0_per_sr.sel(point=7), direction(7, 10.0).maps["S0"])


def test_a_grid_of_angles_that_were_not_quite_reached_has_a_dimension_for_each(tmp_path):
    cells = [(20.001, 40.001), (69.999, 40.0), (70.0, 29.999), (20.0, 30.001)]
    made = [direction(number, exit_deg, incidence_deg=incidence) for number, (incidence, exit_deg) in enumerate(cells)]
    found = written(tmp_path, made)
    assert dict(found.sizes) == {"incidence_deg": 2, "exit_deg": 2, "y_mm": 8, "x_mm": 12}
    assert_allclose(found.incidence_deg, [20.0005, 69.9995])
    assert_allclose(found.exit_deg, [30.0, 40.0005])
    assert found.exit_deg.attrs["units"] == "deg"
    for one in made:
        there = found.sel(incidence_deg=one.incidence_deg, exit_deg=one.exit_deg, method="nearest")
        assert int(there.point) == one.point
        assert_array_equal(there.s0_per_sr, one.maps["S0"])


def test_a_run_has_the_same_dimensions_of_its_maps_as_of_its_points(camera_recipe, tmp_path):
    recipe = camera_recipe([30, 40], incidence_deg=[20, 70])
    scene = yaml.safe_load((tmp_path / "scene.yaml").read_text())
    scene["effects"] = [{"effect": "encoder_noise", "axis": "detector_arm", "stddev_deg": 0.001}]
    (tmp_path / "scene.yaml").write_text(yaml.safe_dump(scene))
    folder = goniometer.run(recipe, speed="max", out=tmp_path / "runs", live_fit=False).folder
    maps, points = goniometer.load_maps(folder), goniometer.load(folder)
    for name in ("incidence_deg", "exit_deg"):
        assert maps.sizes[name] == 2
        assert_allclose(maps[name], points[name], atol=0.01)
    assert_array_equal(maps.point, points.point)
    assert_array_equal(maps.notes, np.full((2, 2), ""))


def test_maps_in_the_cameras_pixels_say_so(tmp_path):
    found = written(tmp_path, [direction(0, 10.0, grid=None)])
    assert {"x_px", "y_px"} < set(found.sizes)


def test_a_run_without_maps_is_refused_in_words(tmp_path):
    with pytest.raises(JournalError, match=r"scan\.nxs cannot be read"):
        goniometer.load_maps(tmp_path)
    with h5py.File(tmp_path / "scan.nxs", "w") as file:
        file.create_group("entry")
    with pytest.raises(JournalError, match="holds no maps: the recipe asks for none"):
        goniometer.load_maps(tmp_path / "journal.sqlite")
    written(tmp_path, [direction(0, 10.0)])
    with h5py.File(tmp_path / "scan.nxs", "a") as file:
        del file["entry/provenance"]
    with pytest.raises(JournalError, match=r"does not say which rig .* Write it again with: goniometer fit"):
        goniometer.load_maps(tmp_path)
