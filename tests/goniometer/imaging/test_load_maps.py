"""Maps out of a run's NeXus file, with labels."""

import h5py
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import goniometer
from acquisition.imaging.maps.direction_maps import DirectionMaps
from acquisition.imaging.maps.nexus_maps import write_maps
from acquisition.imaging.place.map_grid import MapGrid
from goniometer.errors import JournalError

GRID = MapGrid(left_mm=-3.0, top_mm=2.0, pixel_mm=0.5, width=12, height=8)
NAMES = ("S0", "S1", "S2", "S0_variance", "S1_variance", "S2_variance", "DoLP", "DoLP_variance", "AoLP_rad")


def direction(point, exit_deg, grid=GRID, **more):
    random = np.random.default_rng(point)
    maps = {name: random.uniform(0.1, 0.5, (8, 12)).astype(np.float32) for name in NAMES}
    return DirectionMaps(point, 60.0, exit_deg, 0.0, None, grid, maps, **more)


def written(folder, directions):
    with h5py.File(folder / "scan.nxs", "w") as file:
        write_maps(file.create_group("entry"), iter(directions))
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
