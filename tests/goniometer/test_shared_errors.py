"""The covariance of a fit takes in what errors of calibration and zeros do to all directions at once."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import yaml
from numpy.testing import assert_allclose
from pydantic import ValidationError

from acquisition.calibrated_slots import SlotCalibration
from acquisition.expected_noise import expected_points, light_of
from acquisition.fit_points import dataset, fit_arguments, surface_family
from goniometer.errors import ConfigurationError
from goniometer.load_files import load_recipe
from goniometer.planning import detection, plan
from goniometer.rig_file import Rig
from goniometer.run_folder import MeasuredRun
from goniometer.shared_errors import moved_calibrations, refits, shifted, with_shared_errors
from model.fit import Dataset, fit
from model.lobes import Diffuse, Specular
from model.surface import Surface

ROOT = Path(__file__).resolve().parents[2]


def calibration():
    rng = np.random.default_rng(1)
    mixing = np.eye(6) + 0.3 * rng.normal(size=(6, 6))
    covariance = mixing @ mixing.T
    unit = np.sqrt(np.diag(covariance))
    errors = {"angle_stderr_deg": 0.1, "leak_stderr": 1e-3, "transmission_stderr": 0.0}
    return SlotCalibration(
        calibration="test",
        measured="2026-01-31T12:00:00+00:00",
        rig="bench",
        devices={"wheel": "thorlabs_fw102c"},
        analyzer="wheel",
        offset_deg=0.0,
        layout={2: 0.0, 3: 60.0},
        wavelength_nm=550.0,
        reference="polarizer",
        scans=("one",),
        chi_square=10.0,
        degrees_of_freedom=9,
        relative_to_slot=2,
        slots={
            2: errors | {"holds": 0.0, "angle_deg": 1.0, "leak": 0.005, "transmission": 1.0},
            3: errors
            | {"holds": 60.0, "angle_deg": 59.0, "leak": 0.002, "transmission": 0.9, "transmission_stderr": 0.01},
        },
        correlation=(covariance / np.outer(unit, unit)).tolist(),
    )


def test_a_fit_that_follows_the_calibration_linearly_gets_its_covariance_by_the_same_line():
    """theta = theta_0 + M c: what is added must be M C M^T, whatever axes the covariance has."""
    surface = Surface([Specular(0.7, 0.2, 1.5), Diffuse(0.1, 0.2)])
    angles = np.radians(np.arange(0.0, 60.0, 5.0))
    directions = np.full_like(angles, 1.0), angles, np.full_like(angles, np.pi)
    values = surface.stokes(*directions)[:, :3]
    data = Dataset(*directions, values=values, covariance=np.tile(1e-6 * np.eye(3), (len(angles), 1, 1)))
    result = fit(data, surface, start={"sigma": 0.2, "n": 1.5, "k": 0.0, "rho_s": 0.7, "rho_d": 0.1})
    given, names = calibration(), result.names
    line = np.random.default_rng(2).normal(size=(len(names), 6)) * [1.0, 50.0, 5.0, 1.0, 50.0, 5.0]
    origin = np.array([value for found in given.slots.values() for value in found.values])

    def refit(moved, start):
        by = np.array([value for found in moved.slots.values() for value in found.values]) - origin
        there = {
            name: replace(result.parameters[name], value=start[name] + change)
            for name, change in zip(names, line @ by, strict=True)
        }
        return replace(result, parameters=result.parameters | there)

    enlarged = with_shared_errors(result, [partial(refit, moved) for moved in moved_calibrations(given)])
    before, after = (
        one.correlation * np.outer(*[[one.parameters[name].stderr for name in names]] * 2) for one in (result, enlarged)
    )
    assert_allclose(after - before, line @ given.covariance @ line.T, rtol=1e-6, atol=1e-9)
    assert {name: one.value for name, one in enlarged.parameters.items()} == result.values


def test_a_shift_moves_each_slot_by_its_own_amounts():
    moved = shifted(calibration(), np.array([0.1, 0.01, 0.2, -0.3, 0.02, -0.1]))
    assert_allclose(moved.slots[2].values, (1.1, 0.015, 1.2))
    assert_allclose(moved.slots[3].values, (58.7, 0.022, 0.8))


def measured_iron(**keys):
    """A run that measured iron without noise, with these keys of its axes, and the truth."""
    setup = load_recipe(ROOT / "recipes" / "iron_60deg.yaml")
    content = yaml.safe_load(setup.rig_text)
    for role, more in keys.items():
        content["devices"]["arms"]["axes"][role] |= more
    rig = Rig.model_validate(content)
    family = surface_family(setup.recipe.fit, rig.calibration.acceptance_sr)
    truth = setup.scene.truth()
    light = light_of(family.seen({name: truth[name] for name in family.names}))
    points = expected_points(plan(setup.recipe, rig), light, detection(setup.recipe, rig, 0.0))
    return MeasuredRun(ROOT, setup.recipe, rig, (), points, {}, (), None), truth


def fitted(run, choice=None):
    choice = choice or run.recipe.fit
    return fit(dataset(run.points), surface_family(choice, 1e-4), **fit_arguments(choice))


@pytest.mark.parametrize(
    ("role", "name"), [("source_arm", "incidence_offset_deg"), ("detector_arm", "exit_offset_deg")]
)
def test_a_zero_known_to_a_hundredth_of_a_degree_moves_parameters_by_what_an_arm_that_far_off_would(role, name):
    run, truth = measured_iron(**{role: {"zero_stderr_deg": 0.01}})
    alone = fitted(run)
    both = with_shared_errors(alone, refits(run))
    off = fitted(run, run.recipe.fit.model_copy(update={"fixed": {name: -0.01}}))
    for parameter in truth:
        before, after = (one.parameters[parameter].stderr for one in (alone, both))
        shift = off.values[parameter] - alone.values[parameter]
        assert_allclose(after, np.hypot(before, shift), rtol=0.1)  # to the other side it is not quite as much
    assert any(both.parameters[name].stderr > 1.1 * alone.parameters[name].stderr for name in truth)


def test_a_fit_that_searches_or_holds_the_offset_itself_is_left_alone():
    run, _ = measured_iron(detector_arm={"zero_stderr_deg": 0.1})
    choice = run.recipe.fit.model_copy(update={"fixed": {"exit_offset_deg": 0.05}})
    held = replace(run, recipe=run.recipe.model_copy(update={"fit": choice}))
    assert len(list(refits(run))) == 1
    assert list(refits(held)) == []
    alone = fitted(run)
    assert with_shared_errors(alone, []) is alone


@pytest.mark.parametrize(
    ("age_days", "fault"),
    [(5.0, None), (31.0, r"zero of detector_arm .* was measured 31\.0 days ago"), (-2.0, "clock")],
)
def test_an_arm_that_was_aligned_too_long_ago_is_refused(tmp_path, age_days, fault):
    when = datetime.now(UTC) - timedelta(days=age_days)
    rig = yaml.safe_load((ROOT / "rigs" / "simulated.yaml").read_text())
    rig["devices"]["arms"]["axes"]["detector_arm"]["zero_measured"] = when.isoformat(timespec="seconds")
    (tmp_path / "rig.yaml").write_text(yaml.safe_dump(rig))
    scene = yaml.safe_load((ROOT / "scenes" / "iron.yaml").read_text())
    (tmp_path / "scene.yaml").write_text(yaml.safe_dump(scene))
    recipe = yaml.safe_load((ROOT / "recipes" / "iron_60deg.yaml").read_text())
    recipe |= {"rig": "rig.yaml", "scene": "scene.yaml", "calibration_max_age_days": 30}
    (tmp_path / "recipe.yaml").write_text(yaml.safe_dump(recipe))
    if fault is None:
        load_recipe(tmp_path / "recipe.yaml")
        return
    with pytest.raises(ConfigurationError, match=fault):
        load_recipe(tmp_path / "recipe.yaml")


def test_a_date_that_is_none_is_refused():
    with pytest.raises(ValidationError, match="allowed: a time with its zone"):
        measured_iron(detector_arm={"zero_measured": "2026-01-31T12:00:00"})
