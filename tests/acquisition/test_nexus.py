"""The NeXus file: what a viewer needs to plot it, units everywhere, and never half a file."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from numpy.testing import assert_array_equal

from acquisition.nexus import write_nexus
from acquisition.readings import Reading, StokesPoint
from acquisition.reduce import NoiseModel
from goniometer.errors import JournalError
from model.fit import Estimate, FitResult
from model.lobes import Diffuse
from model.surface import Surface

NOISE = NoiseModel(read_w=2e-11, sample_s=0.003, shot=True, wavelength_nm=550)
EXIT_DEG = [-10.0, 0.0, 35.0]
READINGS = [
    Reading(0, "signal", 0, 1.5, 60.0, -10.0, 0.0, 2, 45.0, 0.03, 1.25e-9),
    Reading(0, "dark", 0, 2.5, 60.0, -10.0, 0.0, 6, None, 0.03, 2e-10),
]
POINTS = [
    StokesPoint(
        point=index,
        incidence_deg=60.0,
        exit_deg=exit_deg,
        azimuth_deg=0.0,
        stokes=np.array([0.5, 0.1, -0.01]) * (index + 1),
        covariance=np.diag([4e-6, 9e-6, 16e-6]),
        dolp=0.2,
        dolp_debiased=0.19,
        dolp_stderr=0.02,
        aolp_deg=-3.0,
        aolp_stderr_deg=1.5,
    )
    for index, exit_deg in enumerate(EXIT_DEG)
]
FIT = FitResult(
    parameters={"sigma": Estimate(0.3, 0.01, False), "rho_d": Estimate(0.0, None, True)},
    chi_square=8.5,
    degrees_of_freedom=8,
    names=("sigma",),
    correlation=np.eye(1),
    stokes=np.array([point.stokes for point in POINTS]) * 1.01,
    columns=("s0", "s1", "s2"),
    fitted=np.array([point.stokes for point in POINTS]) * 1.01,
    surface=Surface([Diffuse(0.1, 0.3)]),
)
PROVENANCE = {"recipe": "recipe: iron\nwavelength_nm: 550  # µ\n", "scene": "", "numpy": "2.0", "a/b": "slash"}


@pytest.fixture
def file(tmp_path: Path) -> Iterator[h5py.File]:
    path = tmp_path / "scan.nxs"
    write_nexus(path, title="iron", readings=READINGS, points=POINTS, fit=FIT, noise=NOISE, provenance=PROVENANCE)
    with h5py.File(path) as opened:
        yield opened


def _datasets(file: h5py.File) -> dict[str, h5py.Dataset]:
    found: dict[str, h5py.Dataset] = {}
    file.visititems(lambda name, entry: found.update({name: entry} if isinstance(entry, h5py.Dataset) else {}))
    return found


def test_every_number_has_units(file: h5py.File) -> None:
    numeric = {name: entry for name, entry in _datasets(file).items() if entry.dtype.kind in "iuf"}
    assert len(numeric) > 30
    assert [name for name, entry in numeric.items() if "units" not in entry.attrs] == []
    assert numeric["entry/stokes/S0"].attrs["units"] == "1/sr"
    assert numeric["entry/instrument/detector_power_meter/raw_data/raw"].attrs["units"] == "W"


def test_every_group_has_a_nexus_class(file: h5py.File) -> None:
    unclassed: list[str] = []
    file.visititems(
        lambda name, entry: (
            unclassed.append(name) if isinstance(entry, h5py.Group) and "NX_class" not in entry.attrs else None
        )
    )
    assert unclassed == []
    assert file.attrs["NX_class"] == "NXroot"


def test_a_viewer_that_follows_the_defaults_plots_s0_against_the_exit_angle(file: h5py.File) -> None:
    entry = file[file.attrs["default"]]
    plot = entry[entry.attrs["default"]]
    assert plot.attrs["NX_class"] == "NXdata"
    (axis,) = plot.attrs["axes"]
    assert_array_equal(plot[axis], EXIT_DEG)
    assert_array_equal(plot[plot.attrs["signal"]], [0.5, 1.0, 1.5])
    assert_array_equal(plot[plot.attrs["signal"] + "_errors"], np.sqrt([4e-6] * 3))
    assert set(plot.attrs["auxiliary_signals"]) >= {"S0_fit"}


@pytest.mark.parametrize("group", ["stokes", "dolp", "aolp"])
def test_signals_axes_and_errors_have_one_length(file: h5py.File, group: str) -> None:
    plot = file["entry"][group]
    signals = [plot.attrs["signal"], *plot.attrs.get("auxiliary_signals", [])]
    measured = [name for name in signals if not name.endswith("_fit")]
    for name in [*signals, *(f"{name}_errors" for name in measured), *plot.attrs["axes"]]:
        assert plot[name].shape == (len(POINTS),)


def test_raw_readings_lie_beside_the_reduced_points(file: h5py.File) -> None:
    raw = file["entry/instrument/detector_power_meter/raw_data"]
    assert_array_equal(raw["raw"], [1.25e-9, 2e-10])
    assert_array_equal(raw["polarizer_angle"], [45.0, np.nan])
    assert list(raw["kind"].asstr()) == ["signal", "dark"]
    assert file["entry/instrument/analyzer/polarizer_angle"] == raw["polarizer_angle"]


def test_s3_and_its_retarder_stand_beside_the_rest(tmp_path: Path) -> None:
    points = [
        replace(
            point,
            stokes=np.array([1.0, 0.1, 0.0, -0.2]),
            covariance=np.diag([1e-6, 4e-6, 9e-6, 16e-6]),
            docp=-0.2,
            docp_stderr=0.004,
            dop=0.22,
            dop_stderr=0.003,
        )
        for point in POINTS
    ]
    readings = [replace(READINGS[0], retarder_deg=-15.1, retardance_deg=88.0), READINGS[1]]
    fit = replace(FIT, columns=("s0", "s1", "s2", "s3"), fitted=np.array([point.stokes for point in points]))
    write_nexus(
        tmp_path / "scan.nxs", title="iron", readings=readings, points=points, fit=fit, noise=NOISE, provenance={}
    )
    with h5py.File(tmp_path / "scan.nxs") as file:
        stokes = file["entry/stokes"]
        assert_array_equal(stokes["S3"], [-0.2] * 3)
        assert_array_equal(stokes["S3_errors"], [4e-3] * 3)
        assert stokes["covariance"].shape == (3, 4, 4)
        assert set(stokes.attrs["auxiliary_signals"]) == {"S0_fit", "S1", "S1_fit", "S2", "S2_fit", "S3"}
        assert "clockwise" in stokes["S3"].attrs["long_name"]
        assert_array_equal(file["entry/docp/DoCP"], [-0.2] * 3)
        assert_array_equal(file["entry/dop/DoP_errors"], [0.003] * 3)
        retarder = file["entry/instrument/retarder"]
        assert_array_equal(retarder["fast_axis_angle"], [-15.1, np.nan])
        assert_array_equal(retarder["retardance"], [88.0, np.nan])
        numeric = {name: entry for name, entry in _datasets(file).items() if entry.dtype.kind in "iuf"}
        assert [name for name, entry in numeric.items() if "units" not in entry.attrs] == []


def test_without_s3_nothing_is_said_of_it(file: h5py.File) -> None:
    assert not {"S3", "S3_errors"} & set(file["entry/stokes"])
    assert not {"docp", "dop"} & set(file["entry"])
    assert "retarder" not in file["entry/instrument"]


def test_fitted_parameters_have_their_errors(file: h5py.File) -> None:
    parameters = file["entry/fit/parameters"]
    assert parameters["sigma"][()] == 0.3
    assert parameters["sigma_errors"][()] == 0.01
    assert np.isnan(parameters["rho_d_errors"][()])
    assert parameters["rho_d"].attrs["at_bound"]
    assert file["entry/fit/degrees_of_freedom"][()] == 8


def test_provenance_texts_come_back_whatever_their_names_and_characters(file: h5py.File) -> None:
    notes = file["entry/provenance"].values()
    texts = {
        note["description"].asstr()[()]: note["data"][()].decode() for note in notes if isinstance(note, h5py.Group)
    }
    assert texts == PROVENANCE


def test_without_fit_points_or_readings_the_file_still_opens(tmp_path: Path) -> None:
    path = tmp_path / "scan.nxs"
    write_nexus(path, title="nothing yet", readings=[], points=[], fit=None, noise=NOISE, provenance={})
    with h5py.File(path) as file:
        assert file["entry/stokes/S0"].shape == (0,)
        assert "fit" not in file["entry"]


def test_a_writer_that_fails_leaves_the_old_file_and_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "scan.nxs"
    write_nexus(path, title="first", readings=READINGS, points=POINTS, fit=None, noise=NOISE, provenance={})
    before = path.read_bytes()
    with pytest.raises(AttributeError):
        write_nexus(path, title="second", readings=READINGS, points=[object()], fit=None, noise=NOISE, provenance={})  # type: ignore[list-item]
    assert path.read_bytes() == before
    assert [entry.name for entry in tmp_path.iterdir()] == ["scan.nxs"]


def test_a_folder_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(JournalError, match="cannot be written"):
        write_nexus(
            tmp_path / "no" / "scan.nxs", title="x", readings=[], points=[], fit=None, noise=NOISE, provenance={}
        )
