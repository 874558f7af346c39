"""What a run wrote as NeXus reads back to the same numbers; any other file is refused with the reason."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from numpy.testing import assert_array_equal

from acquisition.fit_points import dataset
from acquisition.measured_nexus import read_measured_nexus
from acquisition.nexus import write_nexus
from acquisition.readings import StokesPoint
from acquisition.reduce import NoiseModel
from goniometer.errors import FitError, JournalError

NOISE = NoiseModel(read_w=2e-11, sample_s=0.003, shot=True, wavelength_nm=550)
PROVENANCE = {"recipe": "recipe: iron # µ", "a/b": "slash"}


def points() -> list[StokesPoint]:
    rng = np.random.default_rng(2)
    made = []
    for number, exit_deg in enumerate((-20.0, 1.0 / 3.0, 45.0)):
        root = rng.normal(size=(3, 4)) * 1e-3
        polarization = (0.5, 0.49, 0.01, -30.0, 0.7)
        made.append(StokesPoint(number, 60.0, exit_deg, 12.5, rng.normal(size=3), root @ root.T, *polarization))
    return made


@pytest.fixture
def scan(tmp_path: Path) -> Path:
    path = tmp_path / "scan.nxs"
    write_nexus(path, title="iron", readings=[], points=points(), fit=None, noise=NOISE, provenance=PROVENANCE)
    return path


def test_the_same_numbers_and_texts_come_back(scan: Path) -> None:
    data, about = read_measured_nexus(scan)
    measured = dataset(points())
    for name in ("incidence_rad", "exit_rad", "azimuth_rad", "values", "covariance"):
        assert_array_equal(getattr(data, name), getattr(measured, name), err_msg=name)
    assert data.name == "scan.nxs"
    assert about == PROVENANCE


def test_s3_comes_back_where_it_was_measured(tmp_path: Path) -> None:
    measured = [
        replace(point, stokes=np.append(point.stokes, 0.1), covariance=np.diag([1e-6, 2e-6, 3e-6, 4e-6]))
        for point in points()
    ]
    path = tmp_path / "scan.nxs"
    with_degrees = [replace(point, docp=0.1, docp_stderr=0.01, dop=0.5, dop_stderr=0.01) for point in measured]
    write_nexus(path, title="iron", readings=[], points=with_degrees, fit=None, noise=NOISE, provenance={})
    data, _ = read_measured_nexus(path)
    assert data.observable.columns == ("s0", "s1", "s2", "s3")
    assert_array_equal(data.values, dataset(measured).values)
    assert_array_equal(data.covariance, dataset(measured).covariance)


def test_texts_are_not_needed(scan: Path) -> None:
    with h5py.File(scan, "a") as file:
        del file["entry/provenance"]
    assert read_measured_nexus(scan)[1] == {}


def _resize(file: h5py.File) -> None:
    values = file["entry/stokes/S1"][:2]
    del file["entry/stokes/S1"]
    file["entry/stokes/S1"] = values
    file["entry/stokes/S1"].attrs["units"] = "1/sr"


def _replace(name: str, value: object) -> Callable[[h5py.File], None]:
    def change(file: h5py.File) -> None:
        del file[f"entry/stokes/{name}"]
        file[f"entry/stokes/{name}"] = value

    return change


def _spoil(file: h5py.File) -> None:
    file["entry/stokes/S0"][1] = np.nan


def _rename(file: h5py.File) -> None:
    file["entry/stokes/exit_angle"].attrs["units"] = "rad"


def _link(file: h5py.File) -> None:
    del file["entry/stokes/S0"]
    file["entry/stokes/S0"] = h5py.ExternalLink("nowhere.nxs", "/S0")


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (lambda file: file.pop("entry"), "entry/stokes/S0 is missing"),
        (lambda file: file["entry/stokes"].pop("covariance"), "entry/stokes/covariance is missing"),
        (_link, "entry/stokes/S0 is missing"),
        (_resize, "the arrays of entry/stokes differ in length"),
        (_replace("S1", np.zeros((3, 2))), "entry/stokes/S1 is not an array of numbers"),
        (_replace("S1", ["a", "b", "c"]), "entry/stokes/S1 is not an array of numbers"),
        (_replace("S1", np.zeros(3)), "entry/stokes/S1 is in None; a scan's is in 1/sr"),
        (_rename, "entry/stokes/exit_angle is in rad; a scan's is in deg"),
        (_spoil, "Row 1 of scan.nxs .*: s0 is not a finite number"),
    ],
)
def test_another_form_is_refused(scan: Path, change: Callable[[h5py.File], None], complaint: str) -> None:
    with h5py.File(scan, "a") as file:
        change(file)
    with pytest.raises(FitError, match=rf"{complaint}.*Nothing was fitted"):
        read_measured_nexus(scan)


def test_a_scan_without_points_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "scan.nxs"
    write_nexus(path, title="nothing yet", readings=[], points=[], fit=None, noise=NOISE, provenance={})
    with pytest.raises(FitError, match="no row"):
        read_measured_nexus(path)


def test_a_file_that_is_no_hdf5_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "scan.nxs"
    path.write_text("incidence_deg,exit_deg\n")
    with pytest.raises(JournalError, match=r"scan\.nxs cannot be read as a NeXus file.*goniometer fit RUN"):
        read_measured_nexus(path)


@pytest.mark.parametrize("share", [0.0, 0.01, 0.3, 0.9, 0.999])
def test_a_file_that_was_cut_short_is_refused(scan: Path, share: float) -> None:
    whole = scan.read_bytes()
    scan.write_bytes(whole[: int(share * len(whole))])
    with pytest.raises(JournalError, match="cannot be read as a NeXus file"):
        read_measured_nexus(scan)
