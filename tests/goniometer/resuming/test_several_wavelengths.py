"""A scan at several wavelengths that was cut: before, within and behind the change from one to the next."""

import pytest
import yaml

import goniometer
from acquisition.events import WavelengthChanged
from goniometer.load_files import load_recipe
from goniometer.planning import alike, plan, references
from goniometer.resume_run import resume
from goniometer.run_folder import measured

DISTURBED = [
    {"effect": "lamp_drift", "relative_per_hour": 0.5},
    {"effect": "wheel_wobble", "stddev_deg": 0.3},
    {"effect": "backlash", "axis": "detector_arm", "play_deg": 0.1},
    {"effect": "shot_noise"},
]
READINGS = 2 * (3 * 5 * 2 + 3 * 2)
"""Of three directions in five slots and three references, at each of two wavelengths."""


@pytest.fixture(scope="session")
def coloured(tmp_path_factory, root):
    """A recipe at two wavelengths, with references, for a lamp that drifts."""
    folder = tmp_path_factory.mktemp("coloured")
    scene = yaml.safe_load((root / "scenes" / "iron_filters.yaml").read_text())
    scene |= {"rig": str(root / "rigs" / "simulated_filters.yaml"), "effects": DISTURBED}
    (folder / "scene.yaml").write_text(yaml.safe_dump(scene))
    recipe = yaml.safe_load((root / "recipes" / "iron_wavelengths.yaml").read_text())
    recipe |= {"rig": scene["rig"], "scene": str(folder / "scene.yaml"), "wavelength_nm": [580, 525]}
    recipe |= {"exit_deg": [20, 45, 60], "readings": 2, "reference": {"exit_deg": 60, "every_points": 2}}
    del recipe["exit"]
    recipe["fit"] = {"lobes": ["specular"], "free": {"sigma": [0.02, 1.0]}, "fixed": {"n": 2.95, "k": 2.93}}
    (folder / "recipe.yaml").write_text(yaml.safe_dump(recipe))
    return folder / "recipe.yaml"


@pytest.fixture(scope="session")
def whole(coloured, tmp_path_factory):
    return goniometer.run(coloured, speed="max", out=tmp_path_factory.mktemp("whole"), live_fit=False).folder


@pytest.mark.usefixtures("no_results")
@pytest.mark.parametrize("part", [0, 3])
def test_after_many_readings(part, whole, cut, rows):
    expected = rows(whole)
    assert len(expected) == READINGS
    for readings in range(part, READINGS, 5):
        folder = cut(whole, readings, str(readings))
        resume(folder, speed="max", live_fit=False)
        assert rows(folder) == expected, f"cut after {readings} readings"


def test_every_result_is_the_same(whole, cut, assert_same_results, drawing):
    """Cut in the second wavelength: the first one's points are there, and its fit, and its picture."""
    folder, events = cut(whole, READINGS // 2 + 5), []
    with drawing():
        resumed = resume(folder, speed="max", live_fit=False, subscribers=[events.append])
    assert_same_results(folder, whole)
    assert [one.recipe.one_wavelength_nm for one in resumed.run.spectrum] == [580.0, 525.0]
    changes = [event.wavelength_nm for event in events if isinstance(event, WavelengthChanged)]
    assert changes == [525.0, 580.0]
    assert {path.name for path in folder.glob("report*.png")} == {"report.png", "report_525nm.png", "report_580nm.png"}


def test_when_time_was_lost_the_lamp_is_read_anew_at_the_wavelength_of_the_cut(whole, cut, rows):
    for readings, wavelength_nm in ((5, 525.0), (READINGS // 2 + 5, 580.0)):
        folder = cut(whole, readings, f"at {readings}")
        resume(folder, speed=400, live_fit=False)
        run = measured(folder)
        besides = run.readings[readings : readings + 2]
        assert [one.kind for one in besides] == ["reference"] * 2
        assert {one.wavelength_nm for one in besides} == {wavelength_nm}
        assert len(run.readings) == READINGS + 2
        assert len(run.points) == 6
        lit = [
            one for one in measured(whole).readings if one.kind == "reference" and one.wavelength_nm == wavelength_nm
        ]
        assert besides[0].power_w == pytest.approx(lit[0].power_w, rel=0.02)


def test_references_besides_the_plan_stand_behind_the_filter_of_their_point(coloured):
    setup = load_recipe(coloured)
    besides = references(setup.recipe, setup.rig)
    planned = {step.point: step for step in plan(setup.recipe, setup.rig)}
    for point, step in planned.items():
        (reference,) = besides(point)
        assert (reference.wavelength_nm, reference.target.filter_slot) == (step.wavelength_nm, step.target.filter_slot)


def test_light_behind_another_filter_is_other_light(coloured, whole):
    setup = load_recipe(coloured)
    are_alike = alike(setup.recipe, setup.rig)
    first, second = (
        next(one for one in measured(whole).readings if one.kind == "reference" and one.wavelength_nm == wavelength_nm)
        for wavelength_nm in (525.0, 580.0)
    )
    assert are_alike(first, first)
    assert not are_alike(first, second)
