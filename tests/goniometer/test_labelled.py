"""A run as a labelled dataset: every number where its labels say, with its unit and its error."""

import builtins
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from numpy.testing import assert_allclose, assert_array_equal

import goniometer
from acquisition.readings import StokesPoint
from goniometer.directions import directions_of
from goniometer.errors import ConfigurationError

ROOT = Path(__file__).resolve().parents[2]
TOLERANCES_DEG = {"source_arm": 0.05, "detector_arm": 0.05, "sample_azimuth": 0.05}


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("iron")
    content = yaml.safe_load((ROOT / "recipes" / "iron_60deg.yaml").read_text())
    content |= {"exit_deg": [60, 50, 40, 20, 0, -10], "readings": 2, "rig": str(ROOT / "rigs" / "simulated.yaml")}
    content |= {"scene": str(ROOT / "scenes" / "iron.yaml")}
    del content["exit"]
    (folder / "recipe.yaml").write_text(yaml.safe_dump(content))
    return goniometer.run(folder / "recipe.yaml", out=folder / "runs", speed="max")


@pytest.fixture(scope="module")
def dataset(run):
    return goniometer.load(run.folder)


def test_points_are_found_by_their_angle(run, dataset):
    assert dataset.dolp.dims == ("exit_deg",)
    assert_array_equal(dataset.exit_deg, sorted(point.exit_deg for point in run.points))
    for point in run.points:
        here = dataset.sel(exit_deg=point.exit_deg)
        assert_array_equal(here.stokes_per_sr, point.stokes)
        assert_array_equal(here.stokes_covariance_per_sr2, point.covariance)
        assert_allclose(here.stokes_stderr_per_sr.sel(stokes="S1") ** 2, point.covariance[1, 1], rtol=1e-12)
        for name in ("point", "dolp", "dolp_debiased", "dolp_stderr", "aolp_deg", "aolp_stderr_deg"):
            assert here[name].item() == getattr(point, name), name
    assert (dataset.incidence_deg, dataset.azimuth_deg, dataset.wavelength_nm) == (60.0, 0.0, 550.0)


def test_a_fit_stands_beside_what_it_was_made_of(run, dataset):
    for name, estimate in run.fit.parameters.items():
        assert dataset.fit_value.sel(parameter=name) == estimate.value
        assert dataset.fit_stderr.sel(parameter=name) == estimate.stderr
    assert dataset.fit_correlation.sel(parameter="n", parameter_2="n") == pytest.approx(1.0)
    names = list(run.fit.names)
    correlation = run.fit.correlation[names.index("n"), names.index("k")]
    assert dataset.fit_correlation.sel(parameter="n", parameter_2="k") == correlation
    left = (dataset.stokes_per_sr - dataset.stokes_fit_per_sr) / dataset.stokes_stderr_per_sr
    assert abs(left).max() < 6.0
    assert dataset.chi_square == run.fit.chi_square


def test_raw_readings_come_along_in_the_order_they_were_taken(run, dataset):
    assert dataset.sizes["reading"] == len(run.readings) == 6 * 5 * 2
    assert_array_equal(dataset.reading_power_w, [reading.power_w for reading in run.readings])
    assert_array_equal(dataset.reading_kind, [reading.kind for reading in run.readings])
    is_dark = dataset.reading_kind == "dark"
    assert np.isnan(dataset.reading_analyzer_deg[is_dark]).all()
    assert set(dataset.reading_analyzer_deg[~is_dark].values) == {0.0, 45.0, 90.0, 135.0}


def test_every_variable_says_what_it_is_and_every_number_its_unit(dataset):
    for name, variable in dataset.variables.items():
        assert variable.attrs["long_name"], name
        assert ("units" in variable.attrs) == (variable.dtype.kind not in "UOT"), name
    units = {name: dataset[name].attrs["units"] for name in ("stokes_per_sr", "stokes_covariance_per_sr2", "dolp")}
    assert units == {"stokes_per_sr": "sr-1", "stokes_covariance_per_sr2": "sr-2", "dolp": "1"}
    units = {name: dataset[name].attrs["units"] for name in ("exit_deg", "reading_power_w", "reading_time_s")}
    assert units == {"exit_deg": "degree", "reading_power_w": "W", "reading_time_s": "s"}


def test_provenance_is_in_the_attributes(run, dataset):
    assert dataset.attrs["recipe"] == run.about["recipe"]
    assert dataset.attrs["goniometer"] == goniometer.__version__
    assert dataset.attrs["title"] == "iron at 60 degrees"
    assert "fit_refusal" not in dataset.attrs


def test_a_netcdf_file_gives_the_same_dataset_back(dataset, tmp_path):
    import xarray

    dataset.to_netcdf(tmp_path / "iron.nc", engine="scipy")
    with xarray.open_dataset(tmp_path / "iron.nc", engine="scipy") as again:
        xarray.testing.assert_identical(again.load(), dataset)


def test_without_xarray_it_is_said_what_to_install(run, monkeypatch):
    real_import = builtins.__import__

    def without(name, *arguments, **more):
        if name == "xarray":
            raise ImportError(name)
        return real_import(name, *arguments, **more)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(ConfigurationError, match=r"pip install 'goniometer\[xarray\]'"):
        goniometer.load(run.folder)


def test_a_run_that_cannot_be_fitted_says_why(run, tmp_path):
    from acquisition.journal import FILE_NAME, Journal

    with Journal.open(run.folder / FILE_NAME) as stored, Journal.create(tmp_path / FILE_NAME, {}) as cut:
        cut._connection.executemany("INSERT OR REPLACE INTO about VALUES (?, ?)", stored.about().items())
        for reading in stored.readings()[:10]:
            cut.append(reading)
    dataset = goniometer.load(tmp_path)
    assert dataset.sizes["exit_deg"] == 1
    assert "fit_value" not in dataset
    assert dataset.attrs["fit_refusal"]


def test_four_stokes_parameters_are_four_components(run, monkeypatch):
    points = [
        replace(
            point, stokes=np.append(point.stokes, 0.01), covariance=np.diag([1.0, 2.0, 3.0, 4.0]), docp=0.1, dop=0.2
        )
        for point in run.points
    ]
    monkeypatch.setattr("goniometer.labelled.stored_run", lambda _: replace(run, points=tuple(points)))
    dataset = goniometer.load(run.folder)
    assert list(dataset.stokes) == ["S0", "S1", "S2", "S3"]
    assert (dataset.stokes_per_sr.sel(stokes="S3") == 0.01).all()
    assert (dataset.stokes_stderr_per_sr.sel(stokes="S3") == 2.0).all()
    assert_array_equal(dataset.docp, [0.1] * 6)
    assert "docp_stderr" not in dataset  # no point has one
    assert_array_equal(dataset.stokes_fit_per_sr.sel(stokes=["S0", "S1", "S2"]), run.fit.stokes[::-1, :3])


def point(number, incidence_deg, exit_deg, azimuth_deg=0.0):
    return StokesPoint(
        number, incidence_deg, exit_deg, azimuth_deg, np.full(4, float(number)), np.eye(4), 0.1, 0.1, 0.01, 0.0, 1.0
    )


def test_a_full_grid_has_a_dimension_for_each_angle_that_varies():
    draw = np.random.default_rng(0)
    cells = [(incidence, exit_) for incidence in (30.0, 60.0) for exit_ in (40.0, 0.0, -20.0)]
    order = draw.permutation(6)
    points = [point(n, *(np.array(cells[cell]) + draw.uniform(-0.04, 0.04, 2))) for n, cell in enumerate(order)]
    found = directions_of(points, TOLERANCES_DEG)
    assert found.dimensions == ("incidence_deg", "exit_deg")
    assert_allclose(found.coordinates["incidence_deg"][1], [30.0, 60.0], atol=0.04)
    assert_allclose(found.coordinates["exit_deg"][1], [-20.0, 0.0, 40.0], atol=0.04)
    assert found.coordinates["azimuth_deg"] == ((), 0.0)
    stokes = found.arranged(np.array([point.stokes for point in points]))
    assert stokes.shape == (2, 3, 4)
    for number, cell in enumerate(order):
        incidence, exit_ = cells[cell]
        place = [30.0, 60.0].index(incidence), [-20.0, 0.0, 40.0].index(exit_)
        assert_array_equal(stokes[place], number)
        assert found.coordinates["point"][1][place] == number


@pytest.mark.parametrize(
    "cells",
    [
        [(30.0, 0.0), (30.0, 10.0), (60.0, 0.0)],  # a corner is missing
        [(60.0, 0.0), (60.0, 10.0), (60.0, 0.04)],  # one direction twice
    ],
    ids=["no grid", "twice"],
)
def test_anything_else_is_a_list_of_points(cells):
    found = directions_of([point(number, *cell) for number, cell in enumerate(cells)], TOLERANCES_DEG)
    assert found.dimensions == ("point",)
    assert_array_equal(found.coordinates["point"][1], [0, 1, 2])
    assert_array_equal(found.coordinates["exit_deg"][1], [exit_ for _, exit_ in cells])
    assert_array_equal(found.arranged(np.arange(3)), [0, 1, 2])
