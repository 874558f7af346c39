"""Scans out of the plane of incidence, from the recipe to everything that is made of them."""

import copy
from pathlib import Path

import numpy as np
import pytest
import yaml
from matplotlib.figure import Figure
from numpy.testing import assert_allclose, assert_array_equal

import goniometer
import goniometer.bluesky
from acquisition.events import StepStarted
from acquisition.fit_points import dataset, directions
from acquisition.measured_csv import read_measured_csv
from acquisition.measured_nexus import read_measured_nexus
from acquisition.stokes_csv import read_stokes_csv
from goniometer.bluesky.export import run_documents
from goniometer.budget.assumed_sample import AssumedSample
from goniometer.budget.forecast import forecast
from goniometer.check import describe_plan
from goniometer.errors import ConfigurationError, FitError
from goniometer.load_files import load_recipe
from goniometer.planning import plan
from goniometer.run_folder import stored_run
from goniometer.run_recipe import run
from goniometer.run_results import draw
from goniometer.scan_planes import scan_planes

ROOT = Path(__file__).resolve().parents[2]
GRID = {"exit": {"start_deg": 0, "stop_deg": 70, "step_deg": 10}, "exit_azimuth_deg": [-35, 0, 35]}


def content(kind, name):
    return yaml.safe_load((ROOT / kind / f"{name}.yaml").read_text(encoding="utf-8"))


def variant(folder, *, rig=None, scene=None, effects=(), **changes):
    """The out-of-plane recipe with changes, as files of its own; `effects` join the scene's."""
    rigs, scenes = copy.deepcopy(rig or {}), {**(scene or {})}
    scenes["effects"] = [*content("scenes", "iron_out_of_plane")["effects"], *effects]
    for kind, more in (("rigs", rigs), ("scenes", scenes)):
        name = {"rigs": "simulated_out_of_plane", "scenes": "iron_out_of_plane"}[kind]
        (folder / f"{kind}.yaml").write_text(yaml.safe_dump(content(kind, name) | {"rig": "rigs.yaml"} | more))
    recipe = content("recipes", "iron_out_of_plane") | GRID | changes | {"rig": "rigs.yaml", "scene": "scenes.yaml"}
    (folder / "recipe.yaml").write_text(yaml.safe_dump({key: one for key, one in recipe.items() if one is not None}))
    return folder / "recipe.yaml"


def planned(path):
    """The steps of a recipe."""
    setup = load_recipe(path)
    return plan(setup.recipe, setup.rig)


@pytest.fixture(scope="module")
def scanned(tmp_path_factory):
    """A run in three planes, and its events."""
    folder, events = tmp_path_factory.mktemp("aside"), []
    return run(variant(folder), out=folder, speed="max", subscribers=[events.append]), events


@pytest.mark.parametrize("incidence_deg", [50.0, -50.0])
@pytest.mark.parametrize("exit_deg", [40.0, -40.0])
@pytest.mark.parametrize("azimuth_deg", [0.0, 25.0, -130.0])
def test_the_fit_looks_where_the_arms_are(incidence_deg, exit_deg, azimuth_deg):
    """Seen from above, from the source's azimuth right-handed to the detector's: written out anew with vectors."""
    source, detector, turn = np.radians([incidence_deg, exit_deg, azimuth_deg])
    to_source = np.array([np.sin(source), 0.0])
    to_detector = -np.sin(detector) * np.array([np.cos(turn), np.sin(turn)])
    phi = np.arctan2(np.linalg.det([to_source, to_detector]), to_source @ to_detector)
    found = directions(incidence_deg, exit_deg, exit_azimuth_deg=azimuth_deg)
    assert_allclose(found[:2], np.abs([source, detector]))
    assert_allclose(np.exp(1j * found[2]), np.exp(1j * phi), atol=1e-12)


def test_the_fit_recovers_the_sample(scanned):
    stored, _ = scanned
    assert len(stored.points) == 24
    assert stored.fit is not None
    assert stored.fit.p_value > 1e-3
    for name, estimate in stored.fit.parameters.items():
        assert abs(estimate.value - stored.truth[name]) < 4 * estimate.stderr, name


def test_the_detectors_azimuth_is_read_back_with_every_reading(scanned, tmp_path):
    stored, events = scanned
    commanded = stored.recipe.directions_deg()[:, 3]
    for reading in stored.readings:
        assert abs(reading.exit_azimuth_deg - commanded[reading.point]) <= 0.005
    assert {event.exit_azimuth_deg for event in events if isinstance(event, StepStarted)} == {-35.0, 0.0, 35.0}
    coarse = {"effect": "encoder_step", "axis": "detector_azimuth", "step_deg": 0.008}
    few = {"exit": None, "exit_deg": [20, 30, 40, 50], "exit_azimuth_deg": 33.31}
    path = variant(tmp_path, effects=[coarse], **few)
    read = {reading.exit_azimuth_deg for reading in run(path, out=tmp_path, speed="max").readings}
    assert len(read) == 1
    assert_allclose(read.pop(), 33.312, atol=1e-9)


def test_an_offset_of_the_detectors_azimuth_turns_the_polarization_in_plane_aside(tmp_path):
    """Where the arm says 0 it is truly above 0, and S2 below 0, as at every azimuth above 0 on the mirror side."""
    offset = {"effect": "zero_offset", "axis": "detector_azimuth", "offset_deg": 4.0}
    stored = run(variant(tmp_path, effects=[offset], exit_azimuth_deg=[-4, 0]), out=tmp_path, speed="max")
    read_deg = np.array([point.exit_azimuth_deg for point in stored.points])
    s2 = np.array([point.stokes[2] / np.sqrt(point.covariance[2, 2]) for point in stored.points])
    assert_array_equal(read_deg, np.repeat([-4.0, 0.0], 8))
    assert np.abs(s2[read_deg == -4.0]).max() < 4
    assert s2[read_deg == 0.0].min() < -10


def test_polarization_on_both_sides_is_mirrored(scanned):
    stored, _ = scanned
    left, middle, right = (stored.points[first : first + 8] for first in (0, 8, 16))
    for one, centre, other in zip(left, middle, right, strict=True):
        sigmas = np.sqrt(np.diag(one.covariance) + np.diag(other.covariance))
        assert (np.abs(one.stokes - other.stokes * [1, 1, -1]) < 4.5 * sigmas).all()
        assert abs(centre.stokes[2]) < 4.5 * np.sqrt(centre.covariance[2, 2])
    assert all(one.stokes[2] > 5 * np.sqrt(one.covariance[2, 2]) for one in left[1:6])


def test_files_of_a_run_say_the_same_as_the_run(scanned):
    stored, _ = scanned
    expected = dataset(stored.points)
    assert [point.exit_azimuth_deg for point in read_stokes_csv(stored.folder / "stokes.csv")] == [
        point.exit_azimuth_deg for point in stored.points
    ]
    for read in (read_measured_csv(stored.folder / "stokes.csv"), read_measured_nexus(stored.folder / "scan.nxs")[0]):
        assert_array_equal(np.array(read.directions), np.array(expected.directions))
    again = stored_run(stored.folder)
    assert again.readings == stored.readings
    assert again.fit.values == stored.fit.values


def test_an_exit_azimuth_beside_phi_is_refused(tmp_path):
    table = tmp_path / "t.csv"
    table.write_text("incidence_deg,exit_deg,phi_deg,exit_azimuth_deg,dolp\n60,30,180,5,0.2\n")
    with pytest.raises(FitError, match="exit_azimuth_deg goes with a signed exit_deg and without phi_deg"):
        read_measured_csv(table)
    table.write_text("incidence_deg,exit_deg,exit_azimuth_deg,dolp\n60,30,5,0.2\n60,-30,5,0.2\n")
    assert_allclose(read_measured_csv(table).azimuth_rad, np.radians([185.0, 5.0]))


def test_exit_azimuths_are_a_dimension_of_the_loaded_run(scanned):
    stored, _ = scanned
    loaded = goniometer.load(stored.folder)
    assert dict(loaded.dolp.sizes) == {"exit_deg": 8, "exit_azimuth_deg": 3}
    assert_allclose(loaded.exit_azimuth_deg, [-35, 0, 35], atol=0.005)
    point = stored.points[0]
    cell = loaded.stokes_per_sr.sel(exit_deg=0, exit_azimuth_deg=-35, method="nearest")
    assert_array_equal(cell, point.stokes)
    assert loaded.reading_exit_azimuth_deg.attrs["units"] == "degree"


def test_documents_of_the_event_model_name_the_exit_azimuth(scanned):
    stored, _ = scanned
    of_run = list(run_documents(stored.folder))
    _, start = of_run[0]
    assert start["hints"]["dimensions"] == [[["exit_azimuth_deg"], "primary"], [["exit_deg"], "primary"]]
    events = [document for kind, document in of_run if kind == "event"]
    assert events[0]["data"]["exit_azimuth_deg"] == stored.readings[0].exit_azimuth_deg


def test_the_picture_has_a_curve_for_each_plane(scanned, monkeypatch, tmp_path):
    stored, _ = scanned
    tolerances = {role: axis.tolerance_deg for role, axis in stored.rig.axes().items()}
    planes = scan_planes(stored.points, tolerances)
    assert_allclose([plane.exit_azimuth_deg for plane in planes], [-35, 0, 35], atol=0.005)
    assert [plane.rows.tolist() for plane in planes] == [list(range(first, first + 8)) for first in (0, 8, 16)]
    figures = []
    monkeypatch.setattr(Figure, "savefig", lambda self, path, **_: (figures.append(self), Path(path).touch()))
    draw(tmp_path / "report.png", stored)
    (figure,) = figures
    texts = [text.get_text() for text in figure.legends[1].get_texts()]
    assert texts[0] == "incidence, exit azimuth: 60.00°, -35.00°"
    assert any("exit azimuth -35.00° to 35.00°" in text.get_text() for text in figure.texts)
    aolp = figure.axes[2] if "angle of linear" in figure.axes[2].get_title("left") else figure.axes[4]
    ends = sorted(float(np.sign(line.get_ydata()[100])) for line in aolp.get_lines() if len(line.get_xdata()) > 50)
    assert ends[0] == -1.0
    assert ends[-1] == 1.0, "the curves of both sides go opposite ways"


def test_the_plan_shows_the_axis_and_holds(scanned, tmp_path):
    stored, _ = scanned
    text = describe_plan(load_recipe(variant(tmp_path)))
    assert "detector azimuth 105°" in text
    assert "exit azimuth" in text
    assert "-35.00°" in text
    planned_s = sum(step.duration_s for step in planned(tmp_path / "recipe.yaml"))
    ended_s = stored.readings[-1].time_s - stored.readings[0].time_s
    assert abs(ended_s / planned_s - 1.0) < 0.05


def test_a_slower_axis_is_planned_for(tmp_path):
    devices = copy.deepcopy(content("rigs", "simulated_out_of_plane")["devices"])
    before_s = sum(step.duration_s for step in planned(variant(tmp_path, direction_within_s=0)))
    devices["arms"]["axes"]["detector_azimuth"]["velocity_deg_s"] = 0.5
    path = variant(tmp_path, rig={"devices": devices}, direction_within_s=0)
    steps = planned(path)
    after_s = sum(step.duration_s for step in steps)
    assert after_s - before_s == pytest.approx(105 / 0.5 - 35 / 20 - 2 * 35 / 20, abs=6.0)
    turns = np.diff([step.target.exit_azimuth_deg for step in steps])
    assert np.count_nonzero(turns) == 2, "plane after plane"


def test_the_reference_stays_in_the_plane_of_incidence(tmp_path):
    path = variant(tmp_path, reference={"exit_deg": 45, "every_points": 6})
    references = {step.target for step in planned(path) if step.kind == "reference"}
    assert {(target.exit_deg, target.exit_azimuth_deg) for target in references} == {(45.0, 0.0)}
    stored = run(path, out=tmp_path, speed="max")
    read = [reading.exit_azimuth_deg for reading in stored.readings if reading.kind == "reference"]
    assert_allclose(read, 0.0, atol=0.005)


def test_points_have_exit_azimuths_of_their_own(tmp_path):
    table = "incidence_deg,exit_deg,exit_azimuth_deg\n60,20,-10\n60,40,15\n30,30,60\n30,50,0\n45,-20,20\n45,60,-60\n"
    product = {"incidence_deg": None, "exit": None, "exit_azimuth_deg": None}
    stored = run(variant(tmp_path, points=table, **product), out=tmp_path, speed="max")
    read = [(point.incidence_deg, point.exit_deg, point.azimuth_deg, point.exit_azimuth_deg) for point in stored.points]
    assert_allclose(read, stored.recipe.directions_deg(), atol=0.02)
    assert stored.fit.p_value > 1e-3
    names, *rows = [line.split(",") for line in table.splitlines()]
    listed = [dict(zip(names, map(float, row), strict=True)) for row in rows]
    same = load_recipe(variant(tmp_path, points=listed, **product)).recipe
    assert_array_equal(same.directions_deg(), stored.recipe.directions_deg())


def test_an_adaptive_scan_stays_in_the_plane_that_the_recipe_says(tmp_path):
    adaptive = {"adaptive": True, "time_limit_s": 120, "exit_azimuth_deg": 20, "readings": 2}
    stored = run(variant(tmp_path, **adaptive), out=tmp_path, speed="max")
    assert len(stored.points) >= 4
    assert_allclose([reading.exit_azimuth_deg for reading in stored.readings], 20.0, atol=0.005)
    with pytest.raises(ConfigurationError, match="several exit azimuths cannot be measured so"):
        load_recipe(variant(tmp_path, adaptive=True, time_limit_s=120, readings=2))


def test_a_forecast_knows_what_the_planes_tell(tmp_path):
    setup = load_recipe(variant(tmp_path))
    sample = AssumedSample(setup.scene.truth(), {}, 2e-10, "the scene")
    stored = run(tmp_path / "recipe.yaml", out=tmp_path, speed="max")
    expected = forecast(setup.recipe, setup.rig, sample)
    for name in ("sigma", "n", "k"):
        assert_allclose(expected.final[name], stored.fit.parameters[name].stderr, rtol=0.2)


def test_a_stage_of_its_own_turns_the_detector_arm(tmp_path):
    """A K10CR1, which has to be homed, in place of the third axis of the arms' controller."""
    rig, scene = content("rigs", "simulated_out_of_plane"), content("scenes", "iron_out_of_plane")
    del rig["devices"]["arms"]["axes"]["detector_azimuth"]
    keys = {"velocity_deg_s": 10, "acceleration_deg_s2": 20, "settle_s": 0.2, "tolerance_deg": 0.01}
    axes = {"detector_azimuth": {"limits_deg": [-60, 60], "home_at_start": True, **keys}}
    rig["devices"]["turntable"] = {"driver": "thorlabs_apt", "port": "simulated", "stage": "K10CR1", "axes": axes}
    scene["devices"]["arms"]["axes"] = {1: "source_arm", 2: "detector_arm"}
    scene["devices"]["turntable"] = {"type": "thorlabs_apt", "stage": "K10CR1", "axes": {1: "detector_azimuth"}}
    path = variant(
        tmp_path,
        rig={"devices": rig["devices"]},
        scene={"devices": scene["devices"], "start_deg": {"detector_azimuth": 17.0}},
        exit={"start_deg": 20, "stop_deg": 60, "step_deg": 20},
    )
    stored = run(path, out=tmp_path, speed="max")
    read = np.array([point.exit_azimuth_deg for point in stored.points])
    assert_allclose(read, np.repeat([-35, 0, 35], 3), atol=0.01)
    assert (np.array([point.stokes[2] for point in stored.points])[read < -1] > 0).all()


def test_a_scan_by_the_source_keeps_out_of_a_collision_zone(tmp_path):
    """On the source's side the arms would touch on the short way from one azimuth to the other."""
    rig = {"collision_zones": [{"arms_closer_than_deg": 12}]}
    bodies = {"source_arm_half_deg": 5.5, "detector_arm_half_deg": 5.5, "frame_deg": 110}
    scene = {"bodies": bodies, "start_deg": {"source_arm": 30, "detector_arm": 40}}
    aside = {"incidence_deg": 40, "exit_deg": [-40, -30, 40, 50], "exit": None, "exit_azimuth_deg": [-30, 30]}
    points = [{"incidence_deg": 40, "exit_deg": -40, "exit_azimuth_deg": one} for one in (-30, 30)]
    path = variant(tmp_path, rig=rig, points=points, incidence_deg=None, exit=None, exit_azimuth_deg=None)
    with pytest.raises(ConfigurationError, match="incidence/exit/azimuth/exit azimuth 40/-40/0/-30 to 40/-40/0/30"):
        load_recipe(path)
    stored = run(variant(tmp_path, rig=rig, scene=scene, **aside), out=tmp_path, speed="max")
    assert len(stored.points) == 8


def test_the_axis_is_a_motor_for_bluesky():
    with goniometer.bluesky.devices(ROOT / "scenes" / "iron_out_of_plane.yaml", speed="max") as bench:
        bench.detector_azimuth.set(-12.5).wait()
        (position,) = [
            value["value"] for name, value in bench.detector_azimuth.read().items() if "setpoint" not in name
        ]
        assert_allclose(position, -12.5, atol=0.005)
    with goniometer.bluesky.devices(ROOT / "scenes" / "iron.yaml", speed="max") as bench:
        assert bench.detector_azimuth is None
