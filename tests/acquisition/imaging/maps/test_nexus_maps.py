"""Maps in a NeXus file: what was written comes back, viewers find their signal, what is missing is NaN and named."""

from __future__ import annotations

from dataclasses import replace

import h5py
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from acquisition.imaging.maps.direction_maps import DirectionMaps, PixelDirections
from acquisition.imaging.maps.nexus_maps import write_maps
from acquisition.imaging.maps.nexus_materials import write_materials
from acquisition.imaging.maps.pixel_fits import MaterialMaps
from acquisition.imaging.place.map_grid import MapGrid
from goniometer.errors import ReductionError
from model.many_fits.result import Status

GRID = MapGrid(left_mm=-6.0, top_mm=4.0, pixel_mm=0.5, width=24, height=16)
NAMES = (
    *("S0", "S1", "S2", "S0_variance", "S1_variance", "S2_variance", "S0_S1_covariance"),
    *("DoLP", "DoLP_variance", "AoLP_rad", "AoLP_rad_variance"),
)


def direction(point, exit_deg, seed=0, **others):
    random = np.random.default_rng([seed, point])
    maps = {name: random.uniform(0.1, 1.0, (GRID.height, GRID.width)).astype(np.float32) for name in NAMES}
    maps["S0"][2, 3] = np.nan
    given = {"exit_azimuth_deg": None, "grid": GRID, "maps": maps} | others
    return DirectionMaps(point, 60.0, exit_deg, 10.0, **given)


@pytest.fixture
def entry(tmp_path):
    with h5py.File(tmp_path / "scan.nxs", "w") as file:
        yield file.create_group("entry")


def plotted(data):
    """What the NeXus rules of NXdata have a viewer plot: signals with their errors, over axes that fit them."""
    assert data.attrs["NX_class"] == "NXdata"
    signals = [data.attrs["signal"], *data.attrs.get("auxiliary_signals", [])]
    axes = list(data.attrs["axes"])
    for name in signals:
        assert data[name].ndim == len(axes)
        assert {"units"} <= data[name].attrs.keys()
        assert f"{name}_errors" not in data or data[f"{name}_errors"].shape == data[name].shape
        assert data[name].attrs["units"] == data[signals[0]].attrs["units"]  # drawn over one axis
        for place, axis in enumerate(axes):
            assert data[axis].shape == (data[name].shape[place],)
            assert data.attrs[f"{axis}_indices"] == place
    return signals


def test_maps_come_back_as_they_were(entry):
    scan = [direction(0, 0.0), direction(1, 5.0), direction(2, 10.0)]
    write_maps(entry, iter(scan))
    assert plotted(entry["maps"]) == ["S0", "S1", "S2"]
    assert plotted(entry["maps_dolp"]) == ["DoLP"]
    assert plotted(entry["maps_aolp"]) == ["AoLP"]
    for number, one in enumerate(scan):
        assert_array_equal(entry["maps/S0"][number], one.maps["S0"])
        assert_array_equal(entry["maps/S0_S1_covariance"][number], one.maps["S0_S1_covariance"])
        assert_array_equal(entry["maps_dolp/DoLP"][number], one.maps["DoLP"])
        assert_allclose(entry["maps/S1_errors"][number] ** 2, one.maps["S1_variance"], rtol=1e-6)
        assert_allclose(np.radians(entry["maps_aolp/AoLP"][number]), one.maps["AoLP_rad"], rtol=1e-6)
        assert_allclose(
            np.radians(entry["maps_aolp/AoLP_errors"][number]) ** 2, one.maps["AoLP_rad_variance"], rtol=1e-6
        )
    assert np.isnan(entry["maps/S0"][0, 2, 3])
    for name in ("maps", "maps_dolp", "maps_aolp"):
        assert_array_equal(entry[name]["exit_angle"], [0.0, 5.0, 10.0])
        assert_array_equal(entry[name]["incidence_angle"], 60.0)
        assert_array_equal(entry[name]["sample_azimuth"], 10.0)
        assert_array_equal(entry[name]["point"], [0, 1, 2])
        assert_allclose(entry[name]["x"][[0, -1]], [-5.75, 5.75])
        assert_allclose(entry[name]["y"][[0, -1]], [3.75, -3.75])
        assert entry[name]["y"].attrs["units"] == "mm"
        assert "exit_azimuth" not in entry[name]
    units = {name: entry[name].attrs["units"] for name in ("maps/S0", "maps/S0_S1_covariance", "maps_aolp/AoLP")}
    assert units == {"maps/S0": "1/sr", "maps/S0_S1_covariance": "1/sr^2", "maps_aolp/AoLP": "deg"}


def test_each_plane_is_compressed_by_itself_in_single_precision(entry):
    write_maps(entry, [direction(0, 0.0), direction(1, 5.0)])
    stored = entry["maps/S2"]
    assert (stored.dtype, stored.compression, stored.shuffle) == (np.float32, "gzip", True)
    assert stored.chunks == (1, GRID.height, GRID.width)


def test_a_direction_is_asked_for_only_when_the_one_before_is_in_the_file(entry):
    def scan():
        yield direction(0, 0.0)
        for number in (1, 2):
            assert_array_equal(entry["maps/S1"][number - 1], direction(number - 1, 0.0).maps["S1"])
            yield direction(number, 5.0 * number)

    write_maps(entry, scan())
    assert entry["maps/S1"].shape == (3, GRID.height, GRID.width)


def test_directions_without_maps_are_nan_and_say_why(entry):
    none = {"maps": {}, "notes": ("No markers were found.", "The pose is unknown.")}
    scan = [direction(0, 0.0, **none), direction(1, 5.0, notes=("One marker was hidden.",)), direction(2, 10.0)]
    write_maps(entry, [*scan, direction(3, 15.0, **none)])
    for name in ("maps/S0", "maps/S2_errors", "maps_dolp/DoLP", "maps_aolp/AoLP_errors"):
        known = np.isfinite(entry[name][()]).any(axis=(1, 2))
        assert_array_equal(known, [False, True, True, False])
        assert len(entry[name]) == 4
    hidden = "No markers were found. The pose is unknown."
    assert entry["maps/notes"].asstr()[()].tolist() == [hidden, "One marker was hidden.", "", hidden]
    assert_array_equal(entry["maps/S1"][2], scan[2].maps["S1"])


def test_without_any_map_the_reasons_are_there_all_the_same(entry):
    write_maps(entry, [direction(4, 20.0, maps={}, notes=("The camera was unplugged.",))])
    assert entry["maps"].attrs["NX_class"] == "NXcollection"
    assert entry["maps/notes"].asstr()[0] == "The camera was unplugged."
    assert entry["maps/exit_angle"][0] == 20.0


def test_no_direction_leaves_nothing(entry):
    write_maps(entry, [])
    assert not entry.keys()


def test_camera_pixels_relative_light_and_directions_out_of_plane(entry):
    angles = PixelDirections(*(np.full((GRID.height, GRID.width), angle, np.float32) for angle in (5.0, 170.0, -3.0)))
    one = direction(0, 5.0, grid=None, is_calibrated=False, exit_azimuth_deg=-20.0, pixel_directions=angles)
    write_maps(entry, [one])
    assert_array_equal(entry["maps/x"], np.arange(GRID.width))
    assert entry["maps/y"].attrs["units"] == "pixel"
    assert entry["maps/S0"].attrs["units"] == ""
    assert_array_equal(entry["maps_dolp/exit_azimuth"], [-20.0])
    for name, value in (("pixel_exit_angle", 5.0), ("pixel_azimuth", 170.0), ("pixel_s_direction", -3.0)):
        assert_array_equal(entry["maps"][name], np.full((1, GRID.height, GRID.width), value, np.float32))


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"grid": MapGrid(0.0, 0.0, 0.5, 24, 16)}, "grid"),
        ({"is_calibrated": False}, "being calibrated"),
        ({"maps": {"S0": np.ones((16, 24), np.float32)}}, "maps"),
        ({"maps": {name: np.ones((8, 24), np.float32) for name in NAMES}}, "size"),
    ],
)
def test_directions_that_are_not_alike_are_refused(entry, change, said):
    with pytest.raises(ReductionError, match=f"direction 1 differ in {said} from those of direction 0"):
        write_maps(entry, [direction(0, 0.0), replace(direction(1, 5.0), **change)])


def test_a_map_that_has_no_place_is_refused_rather_than_dropped(entry):
    maps = dict(direction(0, 0.0).maps)
    with pytest.raises(ReductionError, match=r"no place .* for maps called DoCP\."):
        write_maps(entry, [direction(0, 0.0, maps=maps | {"DoCP": maps["S0"]})])


def test_fits_of_pixels_come_back_with_why_there_are_none(entry):
    shape = GRID.height, GRID.width
    values = np.random.default_rng(1).uniform(1.0, 2.0, shape)
    values[4, 5] = np.nan
    status = np.where(np.isnan(values), Status.TOO_FEW, Status.FITTED)
    found = MaterialMaps(
        grid=GRID,
        bin_px=2,
        parameters={"n": values, "exit_offset_deg": 0.1 * values},
        stderr={"n": 0.01 * values, "exit_offset_deg": 0.02 * values},
        at_bound={"n": values > 1.9, "exit_offset_deg": np.zeros(shape, bool)},
        chi_square=30.0 * values,
        degrees_of_freedom=np.full(shape, 33),
        directions=np.full(shape, 13),
        status=status,
        notes=("1 of 14 directions have no maps: 3.",),
    )
    write_materials(entry, found)
    material = entry["material_maps"]
    assert material.attrs["NX_class"] == "NXprocess"
    assert material.attrs["default"] == "n"
    for name in ("n", "exit_offset_deg", "chi_square", "degrees_of_freedom", "directions", "status"):
        assert plotted(material[name]) == [name]
    assert_array_equal(material["n/n"], values)
    assert_array_equal(material["n/n_errors"], 0.01 * values)
    assert_array_equal(material["n/at_bound"], values > 1.9)
    assert material["exit_offset_deg/exit_offset_deg"].attrs["units"] == "deg"
    assert_array_equal(material["status/status"], status)
    assert "1: too_few" in material["status/status"].attrs["meaning"]
    assert material["notes"].asstr()[()] == found.notes[0]
    assert material["block"][()] == 2
