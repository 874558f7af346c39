"""Scans with several incidences, azimuths, points and repeats, from the recipe to the picture."""

from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
import yaml
from matplotlib.figure import Figure
from numpy.testing import assert_allclose, assert_array_equal

import goniometer
from acquisition.events import PointReduced, ScanStarted
from acquisition.measured_csv import read_measured_csv
from acquisition.measured_nexus import read_measured_nexus
from goniometer.run_folder import stored_run
from goniometer.run_recipe import run
from goniometer.scan_planes import scan_planes

ROOT = Path(__file__).resolve().parents[2]
PLANES = {
    "incidence_deg": [60, 30],
    "azimuth_deg": [0, 40],
    "exit": {"start_deg": 0, "stop_deg": 60, "step_deg": 20},
    "repeats": 2,
}
POINTS = [(60.0, 10.0, 0.0), (30.0, 20.0, 5.0), (60.0, 45.0, 0.0), (31.0, -20.0, 0.0), (30.0, 35.0, 0.0)]


def variant(folder, **changes):
    """The iron recipe with changes; n and k are known, so that few directions are enough."""
    recipe = yaml.safe_load((ROOT / "recipes" / "iron_60deg.yaml").read_text()) | changes
    recipe |= {"rig": str(ROOT / "rigs" / "simulated.yaml"), "scene": str(ROOT / "scenes" / "iron.yaml")}
    recipe["fit"] = {
        "lobes": ["specular", "diffuse", "directional"],
        "free": {"sigma": [0.02, 1.0]},
        "fixed": {"n": 2.95, "k": 2.932},
        "search": "sobol",
    }
    path = folder / "recipe.yaml"
    path.write_text(yaml.safe_dump({key: value for key, value in recipe.items() if value is not None}))
    return path


@pytest.fixture(scope="module")
def planes(tmp_path_factory):
    """A run in four planes, twice, and its events."""
    folder, events = tmp_path_factory.mktemp("planes"), []
    return run(variant(folder, **PLANES), out=folder, speed="max", subscribers=[events.append]), events


def test_every_plane_is_measured_and_the_fit_to_all_finds_the_sample(planes):
    stored, _ = planes
    assert len(stored.points) == 16
    assert len(stored.readings) == 16 * 5 * 3 * 2
    targets = stored.recipe.directions_deg()[:, :3]
    read = [(point.incidence_deg, point.exit_deg, point.azimuth_deg) for point in stored.points]
    assert_allclose(read, targets, atol=0.03)
    assert stored.fit is not None
    sigma = stored.fit.parameters["sigma"]
    assert abs(sigma.value - stored.truth["sigma"]) < 5 * sigma.stderr
    assert stored.fit.p_value > 1e-4


def test_what_is_shown_while_it_runs_ends_as_what_is_stored(planes):
    """The second time round, a point is reduced with the readings of the first, and has less noise."""
    stored, events = planes
    reduced = [event.stokes_point for event in events if isinstance(event, PointReduced)]
    assert len(reduced) == 32
    last = {point.point: point for point in reduced}
    first = {point.point: point for point in reversed(reduced)}
    for point in stored.points:
        assert_allclose(last[point.point].stokes, point.stokes, rtol=1e-12)
        ratio = last[point.point].covariance[0, 0] / first[point.point].covariance[0, 0]
        assert ratio == pytest.approx(0.5, rel=0.1)
    (started,) = [event for event in events if isinstance(event, ScanStarted)]
    assert (started.points, started.readings, started.has_planes) == (16, 480, True)


def test_a_run_is_read_back_with_a_dimension_for_each_angle(planes):
    pytest.importorskip("xarray")
    loaded = goniometer.load(planes[0].folder)
    assert loaded.stokes_per_sr.dims == ("incidence_deg", "exit_deg", "azimuth_deg", "stokes")
    assert loaded.stokes_per_sr.shape == (2, 4, 2, 3)
    assert_allclose(loaded.incidence_deg, [30, 60], atol=0.01)
    assert_array_equal(loaded.point.sel(incidence_deg=60, azimuth_deg=40, method="nearest"), [4, 5, 6, 7])


def test_the_files_hold_every_incidence(planes):
    stored, _ = planes
    for data in (read_measured_csv(stored.folder / "stokes.csv"), read_measured_nexus(stored.folder / "scan.nxs")[0]):
        found = np.degrees(data.incidence_rad)
        assert_allclose(found, [point.incidence_deg for point in stored.points], atol=1e-9)


def test_each_plane_has_a_colour_and_a_curve_of_its_own(planes, tmp_path, monkeypatch):
    stored, _ = planes
    figures = []
    monkeypatch.setattr(Figure, "savefig", lambda figure, *args, **options: figures.append(figure))
    from goniometer import report
    from goniometer.run_results import draw

    monkeypatch.setattr(report, "written_whole", _nothing_written)
    draw(tmp_path / "report.png", stored)
    (figure,) = figures
    (s0,) = [axes for axes in figure.axes if axes.get_title("left") == "$S_0$ (1/sr)"]
    curves = [line for line in s0.lines if len(line.get_xdata()) > 100]
    dots = [line for line in s0.lines if line.get_marker() == "o"]
    assert len(curves) == len({line.get_color() for line in curves}) == 4
    assert [line.get_color() for line in dots] == [line.get_color() for line in curves]
    for dotted, curve in zip(dots, curves, strict=True):
        at_deg, s0_values = dotted.get_data()
        assert_allclose(np.interp(at_deg, *curve.get_data()), s0_values, rtol=0.1)
    said = [text.get_text() for legend in figure.legends for text in legend.get_texts()]
    assert any(text.startswith("incidence, azimuth: 30.00°, 0.00°") for text in said)
    assert "60.00°, 40.00°" in said
    head = " ".join(text.get_text() for text in figure.texts)
    assert "incidence 30.00° to 60.00°" in head
    assert "sample azimuth 0.00° to 40.00°" in head


@contextmanager
def _nothing_written(path):
    yield path


def test_a_table_of_points_is_measured_and_the_run_needs_the_file_no_more(tmp_path):
    pytest.importorskip("xarray")
    path = variant(tmp_path, incidence_deg=None, exit=None, points_file="points.csv")
    rows = "".join(f"{incidence},{exit_},{azimuth}\n" for incidence, exit_, azimuth in POINTS)
    (tmp_path / "points.csv").write_text(f"incidence_deg,exit_deg,azimuth_deg\n{rows}")
    folder = run(path, out=tmp_path / "runs", speed="max").folder
    (tmp_path / "points.csv").unlink()
    path.unlink()
    stored = stored_run(folder)
    read = [(point.incidence_deg, point.exit_deg, point.azimuth_deg) for point in stored.points]
    assert_allclose(read, POINTS, atol=0.03)
    assert stored.fit is not None
    assert goniometer.load(folder).stokes_per_sr.dims == ("point", "stokes")
    tolerances = {role: axis.tolerance_deg for role, axis in stored.rig.axes().items()}
    assert [plane.rows.tolist() for plane in scan_planes(stored.points, tolerances)] == [[4], [1], [3], [0, 2]]
