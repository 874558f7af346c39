"""Scans at several wavelengths, by a wheel of filters: from the command to n and k against the wavelength."""

import json
import re
import sqlite3
from pathlib import Path

import numpy as np
import pytest
import yaml
from click.testing import CliRunner
from matplotlib.figure import Figure
from numpy.testing import assert_allclose, assert_array_equal

import goniometer
from acquisition.events import FitUpdated, PointReduced, ScanEnded, ScanStarted, SpectrumFitted, WavelengthChanged
from acquisition.journal import Journal
from acquisition.stokes_csv import read_stokes_csv
from goniometer.cli import cli
from goniometer.errors import ConfigurationError, FitError, PositionError
from goniometer.planning import detection
from goniometer.run_folder import measured, stored_run
from goniometer.run_recipe import run
from model import materials

ROOT = Path(__file__).resolve().parents[2]
RECIPE = ROOT / "recipes" / "iron_wavelengths.yaml"
LISTED_NM = (580.0, 525.0)
EXITS_DEG = [20, 45, 60, 75]


def scene_with(folder, *, sample=None, **changes):
    """The scene of iron behind filters with changes, in a file of its own."""
    scene = yaml.safe_load((ROOT / "scenes" / "iron_filters.yaml").read_text()) | changes
    scene["rig"] = str(ROOT / "rigs" / "simulated_filters.yaml")
    scene["sample"] = {name: value for name, value in (scene["sample"] | (sample or {})).items() if value is not None}
    path = folder / "scene.yaml"
    path.write_text(yaml.safe_dump(scene))
    return path


def recipe_with(folder, scene=None, **changes):
    """The recipe at two wavelengths in four directions, with changes; n and k are known, so that few are enough."""
    recipe = yaml.safe_load(RECIPE.read_text()) | {"wavelength_nm": list(LISTED_NM), "exit_deg": EXITS_DEG}
    recipe |= {"rig": str(ROOT / "rigs" / "simulated_filters.yaml"), "exit": None, "reference": None}
    recipe["scene"] = str(scene or ROOT / "scenes" / "iron_filters.yaml")
    recipe["fit"] = {
        "lobes": ["specular", "diffuse", "directional"],
        "free": {"sigma": [0.02, 1.0]},
        "fixed": {"n": 2.95, "k": 2.932},
        "search": "sobol",
    }
    recipe |= changes
    path = folder / "recipe.yaml"
    path.write_text(yaml.safe_dump({key: value for key, value in recipe.items() if value is not None}))
    return path


@pytest.fixture(scope="module")
def iron(tmp_path_factory):
    """The recipe as it comes, through the command: what it printed, and the run."""
    out = tmp_path_factory.mktemp("iron")
    done = CliRunner().invoke(cli, ["run", str(RECIPE), "--speed", "max", "--out", str(out)], catch_exceptions=False)
    assert done.exit_code == 0, done.output
    (folder,) = out.iterdir()
    return done.output, folder


@pytest.fixture(scope="module")
def short(tmp_path_factory, drawing):
    """A short run without references, its bytes and its events; the sample's n and k are the same everywhere."""
    folder, events = tmp_path_factory.mktemp("short"), []
    grey = {"material": None, "index": {"n": 2.95, "k": 2.932}}
    with drawing():
        stored = run(
            recipe_with(folder, scene_with(folder, sample=grey)),
            out=folder,
            speed="max",
            trace=True,
            subscribers=[events.append],
        )
    return stored, events


def test_n_and_k_of_iron_are_found_at_every_wavelength(iron):
    printed, folder = iron
    found = json.loads((folder / "fit.json").read_text())["wavelengths"]
    assert [one["wavelength_nm"] for one in found] == [525.0, 550.0, 580.0]
    for one in found:
        index = materials.index("Fe", one["wavelength_nm"])
        for name, true in (("n", index.real), ("k", index.imag)):
            estimate = one["parameters"][name]
            assert estimate["truth"] == true
            assert abs(estimate["value"] - true) < 3 * estimate["stderr"], (one["wavelength_nm"], name)
            assert estimate["stderr"] < 0.02
    ks = [one["parameters"]["k"] for one in found]
    assert ks[2]["value"] - ks[0]["value"] > 5 * np.hypot(ks[2]["stderr"], ks[0]["stderr"]), "the dispersion shows"
    rows = re.findall(r"^(\d+) nm +([\d.]+) ± [\d.]+ +([\d.]+) ± [\d.]+ +([\d.]+) ±", printed, re.MULTILINE)
    assert [row[0] for row in rows] == ["525", "550", "580"]
    assert_allclose([float(row[3]) for row in rows], [k["value"] for k in ks], atol=1e-3)
    assert "wavelength   sigma" in printed
    assert printed.count("could not be fitted") == 0


def test_every_wavelength_has_its_own_references_and_darks_and_the_plan_holds(iron):
    with Journal.open(iron[1] / "journal.sqlite") as journal:
        readings = journal.readings()
    order = list(dict.fromkeys(one.wavelength_nm for one in readings))
    assert order == [525.0, 550.0, 580.0], "round the wheel from its first slot"
    for number, wavelength_nm in enumerate(order):
        of_one = [one for one in readings if one.wavelength_nm == wavelength_nm]
        assert {one.point for one in of_one} == set(range(41 * number, 41 * (number + 1)))
        assert sum(one.kind == "dark" for one in of_one) == 3 * 41
        references = [one for one in of_one if one.kind == "reference"]
        assert len(references) == 3 * 4
        assert of_one[0].kind == of_one[-1].kind == "reference"


def test_points_are_numbered_by_the_recipe_and_measured_round_the_wheel(short):
    stored, events = short
    order = list(dict.fromkeys(one.wavelength_nm for one in stored.readings))
    assert order == [525.0, 580.0], "slot 1 is in the beam at first"
    assert [point.point for point in stored.points] == list(range(8))
    assert [point.wavelength_nm for point in stored.points] == [580.0] * 4 + [525.0] * 4
    assert_allclose([point.exit_deg for point in stored.points], EXITS_DEG * 2, atol=0.01)
    at = {one.point: one.wavelength_nm for one in stored.readings}
    assert at == dict.fromkeys(range(4), 580.0) | dict.fromkeys(range(4, 8), 525.0)
    reduced = [event.stokes_point for event in events if isinstance(event, PointReduced)]
    assert {one.point for one in reduced[:4]} == {4, 5, 6, 7}
    for one in reduced:
        assert_array_equal(one.stokes, stored.points[one.point].stokes)


def test_the_scan_takes_as_long_as_was_planned(short):
    (started,) = [event for event in short[1] if isinstance(event, ScanStarted)]
    (ended,) = [event for event in short[1] if isinstance(event, ScanEnded)]
    assert (started.points, started.readings) == (8, 8 * 5 * 3)
    assert ended.bench_duration_s == pytest.approx(started.expected_duration_s, rel=0.05)


def test_light_and_noise_are_those_of_the_wavelength(short):
    """The filters pass 0.8 and 0.9 of the lamp; without that in the rig, reflectances would differ as much."""
    stored, _ = short
    for one, share in zip(stored.spectrum, (0.9, 0.8), strict=True):
        assert one.fit is not None
        sigma = one.fit.parameters["sigma"]
        assert abs(sigma.value - 0.1764) < 5 * sigma.stderr
        power_w = {x.exit_deg: x.power_w for x in one.readings if x.analyzer_deg == 90 and x.exit_deg > 70}
        s0, s1, _ = one.points[-1].stokes
        passed_w = 0.5 * (s0 - s1) * share * 1e-8 * np.cos(np.radians(75))
        assert_allclose(list(power_w.values()), passed_w + 2e-10, rtol=0.01)
        detected = detection(one.recipe, one.rig)
        assert detected.noise.wavelength_nm == one.recipe.one_wavelength_nm
        assert detected.radiometry.beam_power_w == pytest.approx(share * 1e-4)


def test_the_meter_is_told_every_wavelength_and_asked_for_it(short):
    """Before the first reading at it; the scan begins in slot 1, at 525 nm."""
    text = (short[0].folder / "wire.log").read_text()
    sent = re.findall(r"SENS:CORR:WAV (\d+)", text)
    assert list(dict.fromkeys(sent[-2:])) == ["525", "580"]
    assert text.count("SENS:CORR:WAV?") >= len(sent)
    turned = [match.start() for match in re.finditer(r"filters.*pos=3", text)]
    assert turned
    assert turned[0] < text.rindex("SENS:CORR:WAV 580")


def test_each_wavelength_is_fitted_live_by_itself(short):
    stored, events = short
    changes = [event for event in events if isinstance(event, WavelengthChanged)]
    assert [change.wavelength_nm for change in changes] == [525.0, 580.0]
    for change in changes:
        assert change.truth["k"] == 2.932
    assert all(event.points <= 4 for event in events if isinstance(event, FitUpdated))
    (spectrum,) = [event for event in events if isinstance(event, SpectrumFitted)]
    assert spectrum.wavelengths_nm == LISTED_NM
    assert spectrum.results == tuple(one.fit for one in stored.spectrum)


def test_the_files_hold_the_wavelength(short):
    h5py = pytest.importorskip("h5py")
    stored, _ = short
    folder = stored.folder
    points = read_stokes_csv(folder / "stokes.csv")
    assert [point.wavelength_nm for point in points] == [580.0] * 4 + [525.0] * 4
    with h5py.File(folder / "scan.nxs") as file:
        assert_array_equal(file["entry/instrument/beam_lamp/incident_wavelength"], [525, 580])
        raw = file["entry/instrument/detector_power_meter/raw_data"]
        assert_array_equal(raw["wavelength"], [one.wavelength_nm for one in stored.readings])
        assert_array_equal(file["entry/stokes/wavelength"], [580] * 4 + [525] * 4)
        power_w, errors_w = raw["raw"][()], raw["raw_errors"][()]
        photon_j = 6.62607015e-34 * 299792458.0 / (raw["wavelength"][()] * 1e-9)
        assert_allclose(errors_w**2, (2e-11**2 * 0.003 + photon_j * power_w) / 0.03, rtol=1e-6)
    pictures = {path.name for path in folder.glob("*.png")}
    assert pictures == {"report.png", "report_525nm.png", "report_580nm.png"}


def test_a_run_is_read_back_with_a_dimension_for_the_wavelength(short):
    pytest.importorskip("xarray")
    stored, _ = short
    loaded = goniometer.load(stored.folder)
    assert loaded.stokes_per_sr.dims == ("wavelength_nm", "exit_deg", "stokes")
    assert loaded.fit_value.dims == ("wavelength_nm", "parameter")
    assert loaded.wavelength_nm.attrs["units"] == "nm"
    assert_array_equal(loaded.wavelength_nm, LISTED_NM)
    for one in stored.spectrum:
        at_one = loaded.sel(wavelength_nm=one.recipe.one_wavelength_nm)
        assert_array_equal(at_one.stokes_per_sr, [point.stokes for point in one.points])
        assert float(at_one.fit_value.sel(parameter="sigma")) == one.fit.parameters["sigma"].value
        assert_array_equal(at_one.point, [point.point for point in one.points])
    assert_array_equal(loaded.reading_wavelength_nm, [one.wavelength_nm for one in stored.readings])


def test_a_scan_cut_short_is_read_and_fitted_as_far_as_it_went(short, tmp_path):
    """All of 525 nm, and of 580 nm two of four directions."""
    folder = tmp_path / short[0].folder.name
    folder.mkdir()
    with Journal.open(short[0].folder / "journal.sqlite") as journal:
        readings, about = journal.readings(), journal.about()
    about.pop("format")
    with Journal.create(folder / "journal.sqlite", about) as journal:
        for reading in readings:
            if reading.wavelength_nm == 525.0 or reading.point < 2:
                journal.append(reading)
    stored = stored_run(folder)
    assert [point.point for point in stored.points] == [0, 1, 4, 5, 6, 7]
    assert [len(one.points) for one in stored.spectrum] == [2, 4]
    xarray = pytest.importorskip("xarray")
    loaded = goniometer.load(folder)
    assert isinstance(loaded, xarray.Dataset)
    assert loaded.stokes_per_sr.dims == ("point", "stokes")
    assert_array_equal(loaded.wavelength_nm, [580.0] * 2 + [525.0] * 4)


def test_a_filter_wheel_turned_by_hand_is_noticed_and_nothing_of_it_stored(tmp_path):
    """In the middle of the second wavelength: what comes next in slot 4 is no light at all."""
    faults = [{"fault": "wheel_by_hand", "device": "filters", "at_s": 26.0}]
    path = recipe_with(tmp_path, scene_with(tmp_path, faults=faults))
    with pytest.raises(PositionError, match=r"slot 4 \(nothing\) is in the beam instead of slot 3 \(580 nm\)"):
        run(path, out=tmp_path, speed="max")
    (folder,) = [one for one in tmp_path.iterdir() if one.is_dir()]
    with Journal.open(folder / "journal.sqlite") as journal:
        readings = journal.readings()
    assert {one.wavelength_nm for one in readings} == {525.0, 580.0}
    lit = [one.power_w for one in readings if one.kind == "signal"]
    assert min(lit) > 3e-10, "what is stored was read in the light"
    assert max(one.time_s for one in readings) < 26.0


def test_a_wheel_turned_to_another_filter_before_the_scan_is_brought_back(tmp_path):
    faults = [{"fault": "wheel_by_hand", "device": "filters", "at_s": 0.0}]
    grey = {"material": None, "index": {"n": 2.95, "k": 2.932}}
    path = recipe_with(tmp_path, scene_with(tmp_path, sample=grey, faults=faults), wavelength_nm=525.0)
    stored = run(path, out=tmp_path, speed="max")
    sigma = stored.fit.parameters["sigma"]
    assert abs(sigma.value - 0.1764) < 5 * sigma.stderr
    assert {one.wavelength_nm for one in stored.readings} == {525.0}


def test_a_link_to_the_filters_that_is_lost_is_taken_up_again(tmp_path, short):
    faults = [{"fault": "cable_pulled", "device": "filters", "at_s": 15.0, "for_s": 3.0}]
    path = recipe_with(tmp_path, scene_with(tmp_path, faults=faults))
    stored = run(path, out=tmp_path, speed="max")
    assert any(key.startswith("link lost") for key in stored.about)
    assert [one.point for one in stored.points] == list(range(8))
    assert len(stored.readings) == len(short[0].readings)


@pytest.mark.parametrize("keys", [{"until": {"sigma": 0.01}}, {"adaptive": True}], ids=["until", "adaptive"])
def test_a_scan_that_decides_as_it_goes_measures_at_one_of_the_filters(tmp_path, keys):
    index = materials.index("Fe", 580.0)
    fit = {"lobes": ["specular", "diffuse", "directional"], "fixed": {"n": index.real, "k": index.imag}}
    fit |= {"free": {"sigma": [0.02, 1.0]}, "search": "sobol"}
    path = recipe_with(tmp_path, wavelength_nm=580, time_limit_s=60, fit=fit, **keys)
    stored = run(path, out=tmp_path, speed="max")
    assert {one.wavelength_nm for one in stored.readings} == {580.0}
    assert stored.truth["k"] == index.imag
    rho_s = stored.fit.parameters["rho_s"].value
    assert rho_s == pytest.approx(0.7, rel=0.03), "behind another filter there is another power"
    sigma = stored.fit.parameters["sigma"]
    assert abs(sigma.value - 0.1764) < 5 * sigma.stderr


def test_what_makes_one_fit_of_all_refuses_several_wavelengths(short, tmp_path):
    folder = short[0].folder
    from goniometer.budget.command import BudgetAsked, run_budget
    from goniometer.compare.command import compare_models
    from goniometer.fitting.command import fit_one
    from goniometer.pbsdf.export import export_pbsdf

    with pytest.raises(FitError, match=r"several wavelengths.*Nothing was fitted"):
        fit_one(folder, changes={"robust": True})
    with pytest.raises(FitError, match="has a fit for each wavelength"):
        fit_one(folder, profiled=["sigma"])
    with pytest.raises(FitError, match="several wavelengths"):
        compare_models(folder, None, None)
    with pytest.raises(FitError, match="column wavelength_nm holds several"):
        fit_one(folder / "stokes.csv")
    with pytest.raises(FitError, match="holds several wavelengths"):
        fit_one(folder / "scan.nxs")
    with pytest.raises(FitError, match=r"no surface to export: .*several wavelengths \(580, 525 nm\)"):
        export_pbsdf(folder, tmp_path / "x.pbsdf")
    with pytest.raises(ConfigurationError, match=r"several wavelengths \(580, 525 nm\)"):
        run_budget(BudgetAsked(recipe_with(tmp_path), None, None, (), None, None, None, "d"))


def test_a_table_of_one_wavelength_out_of_several_can_be_fitted(short, tmp_path):
    from goniometer.fitting.command import fit_one

    lines = (short[0].folder / "stokes.csv").read_text().splitlines()
    kept = [line for line in lines if ",525.0," not in line]
    assert len(kept) == len(lines) - 4
    (tmp_path / "one.csv").write_text("\n".join(kept) + "\n")
    found = fit_one(tmp_path / "one.csv", changes={"free": {"sigma": (0.02, 1.0)}, "fixed": {"n": 2.94, "k": 2.986}})
    assert found.result.degrees_of_freedom == 4 * 3 - 4


def test_the_documents_for_bluesky_have_the_wavelength_outermost(short):
    from goniometer.bluesky.export import run_documents

    documents = list(run_documents(short[0].folder))
    (start,) = [document for kind, document in documents if kind == "start"]
    assert start["hints"]["dimensions"] == [[["wavelength_nm"], "primary"], [["exit_deg"], "primary"]]
    descriptors = [document for kind, document in documents if kind == "descriptor"]
    assert all(one["data_keys"]["wavelength_nm"]["units"] == "nm" for one in descriptors)
    (stop,) = [document for kind, document in documents if kind == "stop"]
    assert (stop["exit_status"], stop["num_events"]) == ("success", {"primary": 120, "stokes": 8})


def test_a_run_from_before_readings_had_a_wavelength_is_read_as_at_the_recipe_s(tmp_path):
    stored = run(recipe_with(tmp_path, wavelength_nm=525), out=tmp_path, speed="max")
    with sqlite3.connect(stored.folder / "journal.sqlite", isolation_level=None) as connection:
        connection.execute("ALTER TABLE readings DROP COLUMN wavelength_nm")
        connection.execute("UPDATE about SET value = '2' WHERE key = 'format'")
    connection.close()
    old = measured(stored.folder)
    assert {one.wavelength_nm for one in (*old.readings, *old.points)} == {525.0}
    for one, other in zip(old.points, stored.points, strict=True):
        assert_array_equal(one.stokes, other.stokes)


def test_the_picture_has_a_curve_a_wavelength_and_each_parameter_against_it(short, tmp_path, monkeypatch):
    from goniometer import spectrum_picture

    figures = []
    monkeypatch.setattr(Figure, "savefig", lambda figure, *args, **options: figures.append(figure))
    monkeypatch.setattr(spectrum_picture, "written_whole", lambda path: open(tmp_path / "x", "wb"))  # noqa: PTH123, SIM115
    spectrum_picture.draw_spectrum(tmp_path / "report.png", short[0].spectrum)
    (figure,) = figures
    by_title = {axes.get_title("left"): axes for axes in figure.axes}
    assert {"$S_0$ (1/sr)", "degree of linear polarization", "sigma", "rho_s"} <= set(by_title)
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["525 nm", "580 nm"]
    s0 = by_title["$S_0$ (1/sr)"]
    curves = [line for line in s0.lines if line.get_linestyle() == "-"]
    assert len({line.get_color() for line in curves}) == 2
    at_nm = sorted(float(line.get_xdata()[0]) for line in by_title["sigma"].lines if line.get_marker() == "o")
    assert at_nm == [525.0, 580.0]


def test_check_lists_the_filters_in_the_order_in_which_they_come(tmp_path):
    done = CliRunner().invoke(cli, ["check", str(recipe_with(tmp_path))], catch_exceptions=False)
    assert "filters: 525 nm (slot 1), then 580 nm (slot 3)" in done.output
    lines = done.output.splitlines()
    first, second = lines.index("at 525 nm:"), lines.index("at 580 nm:")
    assert first < second
    assert "8 directions" in lines[0]
