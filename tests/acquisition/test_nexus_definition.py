"""The NeXus file holds what the application definition NXoptical_spectroscopy demands, with units and errors."""

from collections.abc import Iterator
from datetime import datetime
from pathlib import Path

import h5py
import numpy as np
import pytest
from numpy.testing import assert_allclose

from acquisition.expand import Step, Target
from acquisition.expected_noise import Detection, expected_readings
from acquisition.fit_points import dataset
from acquisition.nexus import write_nexus
from acquisition.reduce import NoiseModel, Radiometry, Reduction
from model.fit import fit, lobe_family

NOISE = NoiseModel(read_w=2e-11, sample_s=0.003, shot=True, wavelength_nm=633)
DETECTION = Detection(Radiometry(1e-4, 1e-4), NOISE, dark_w=2e-10)
PROVENANCE = {"recipe": "recipe: iron", "started": "2026-11-22T14:12:31+00:00"}
MEASURED = {"S0", "S1", "S2", "DoLP", "DoLP_debiased", "AoLP", "raw", "sigma", "rho_s"}
"""Fields that are measured, or follow from what is, and so have errors."""


@pytest.fixture
def entry(tmp_path: Path) -> Iterator[h5py.Group]:
    family = lobe_family(["specular"], free={"sigma": (0.02, 1.0)}, fixed={"n": 2.9, "k": 2.9})
    truth = family.surface_of({"sigma": 0.2, "rho_s": 0.7})
    exits_deg = np.arange(0.0, 80.0, 10.0)
    kinds = [("signal", angle) for angle in (0.0, 45.0, 90.0, 135.0)] + [("dark", None)]
    steps = [
        Step(point, kind, Target(50.0, exit_deg, 0.0, slot), angle, 3, 0.03, 1.0)
        for point, exit_deg in enumerate(exits_deg)
        for slot, (kind, angle) in enumerate(kinds)
    ]
    light = truth.stokes(np.full(8, np.radians(50.0)), np.radians(exits_deg), np.full(8, np.pi))
    readings = expected_readings(steps, lambda *_: np.repeat(light, 5, axis=0), DETECTION)
    points = Reduction(DETECTION.radiometry, NOISE, has_dark=True).scan(readings)
    found = fit(dataset(points), family)
    path = tmp_path / "scan.nxs"
    write_nexus(path, title="iron", readings=readings, points=points, fit=found, noise=NOISE, provenance=PROVENANCE)
    with h5py.File(path) as file:
        yield file[file.attrs["default"]]


def fields(entry: h5py.Group) -> dict[str, h5py.Dataset]:
    found: dict[str, h5py.Dataset] = {}

    def note(name: str, node: h5py.Group | h5py.Dataset) -> None:
        if isinstance(node, h5py.Dataset):
            found[name] = node

    entry.visititems(note)
    return found


def test_every_number_has_units_and_what_is_measured_has_errors(entry: h5py.Group) -> None:
    numbers = {name: node for name, node in fields(entry).items() if node.dtype.kind in "iuf"}
    assert [name for name, node in numbers.items() if "units" not in node.attrs] == []
    measured = {name for name in numbers if name.rpartition("/")[2] in MEASURED}
    assert {name.rpartition("/")[2] for name in measured} == MEASURED
    for name in measured:
        errors = numbers[f"{name}_errors"]
        assert errors.shape == numbers[name].shape, name
        assert errors.attrs["units"] == numbers[name].attrs["units"], name
        assert (errors[()] > 0.0).all(), name


def test_the_file_declares_its_definition_with_version_and_address(entry: h5py.Group) -> None:
    assert entry["definition"].asstr()[()] == "NXoptical_spectroscopy"
    assert entry["definition"].attrs["version"].startswith("v")
    assert entry["definition"].attrs["URL"].endswith("NXoptical_spectroscopy.html")
    assert "polarimetric" in entry["experiment_type"].asstr()[()]
    assert entry["experiment_type"].attrs["custom"], "for it is none of those that the definition lists"
    assert datetime.fromisoformat(entry["start_time"].asstr()[()]).utcoffset() is not None


@pytest.mark.parametrize(
    ("group", "nexus_class", "field"),
    [
        ("instrument", "NXinstrument", "angle_reference_frame"),
        ("instrument/beam_lamp", "NXbeam", "parameter_reliability"),
        ("instrument/beam_lamp", "NXbeam", "incident_wavelength"),
        ("instrument/detector_power_meter", "NXdetector", "detector_channel_type"),
        ("instrument/detector_power_meter/raw_data", "NXdata", "raw"),
        ("instrument/source_lamp", "NXsource", "associated_beam"),
        ("instrument/software_goniometer", "NXprogram", "program"),
        ("sample", "NXsample", "name"),
        ("stokes", "NXdata", "S0"),
    ],
)
def test_groups_that_the_definition_names_are_there(
    entry: h5py.Group, group: str, nexus_class: str, field: str
) -> None:
    assert entry[group].attrs["NX_class"] == nexus_class
    assert field in entry[group]


def test_every_plot_has_a_signal_over_axes_of_its_length(entry: h5py.Group) -> None:
    plots = [entry[entry.attrs["default"]], entry["dolp"], entry["aolp"]]
    plots.append(entry["instrument/detector_power_meter/raw_data"])
    assert plots[-1].attrs["signal"] == "raw", "which the definition demands"
    for plot in plots:
        (axis,) = plot.attrs["axes"]
        assert plot[plot.attrs["signal"]].shape == plot[axis].shape == plot[f"{plot.attrs['signal']}_errors"].shape


def test_paths_lead_to_what_they_name(entry: h5py.Group) -> None:
    instrument = entry["instrument"]
    assert entry[instrument["beam_lamp/associated_source"].asstr()[()]] == instrument["source_lamp"]
    assert entry[instrument["source_lamp/associated_beam"].asstr()[()]] == instrument["beam_lamp"]
    assert_allclose(instrument["angle_of_detection"], instrument["detector_power_meter/raw_data/exit_angle"])
    assert instrument["beam_lamp/incident_wavelength"][()] == 633


def test_errors_of_raw_readings_are_those_of_detector_and_photons(entry: h5py.Group) -> None:
    raw = entry["instrument/detector_power_meter/raw_data"]
    photon_j = 6.62607015e-34 * 299792458.0 / 633e-9
    expected_w = np.sqrt((2e-11) ** 2 * 0.003 / 0.03 + photon_j * raw["raw"][()] / 0.03)
    assert_allclose(raw["raw_errors"], expected_w, rtol=1e-12)


def test_without_a_beginning_no_definition_is_declared(tmp_path: Path) -> None:
    path = tmp_path / "scan.nxs"
    write_nexus(path, title="x", readings=[], points=[], fit=None, noise=NOISE, provenance={})
    with h5py.File(path) as file:
        assert "definition" not in file["entry"]
