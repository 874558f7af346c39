"""Does a calibrated analyzer measure DoLP to within its stated error, and an uncalibrated one not?

Every seed draws another analyzer (angles ±1 degree, transmissions ±5 %, extinction 1:200), other errors of the
reference as large as its recipe says, other light before it, and other noise; it is calibrated, then measures iron. A
few seeds go over the whole bench, every byte over a socket; the same readings without sockets, made by the bench's own
world, go over hundreds.
"""

import math
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
import yaml
from numpy.testing import assert_allclose

from acquisition.calibration_problem import CalibrationScan
from acquisition.calibration_recipe import calibration_steps
from acquisition.fit_points import dataset, fit_arguments, surface_family
from acquisition.readings import Reading
from goniometer.calibrating.command import calibrate
from goniometer.calibrating.solve import solved
from goniometer.calibrating.stored_scan import StoredScan, stored_scan
from goniometer.load_files import load_calibration_recipe, load_recipe
from goniometer.planning import plan, reduction, slots, timing
from goniometer.run_folder import MeasuredRun, measured
from goniometer.run_recipe import run
from goniometer.shared_errors import refits, with_shared_errors
from model.fit import fit
from model.lobes import Diffuse, Directional, Specular
from model.surface import Surface
from sim_devices.scene import Scene
from sim_devices.world import World

ROOT = Path(__file__).resolve().parents[2]
REFERENCE = {"zero_stderr_deg": 0.05, "setting_stderr_deg": 0.02, "angles_deg": [0, 36, 72, 108, 144]}
IRON = Surface([Specular(0.7, 0.1764, 2.950 + 2.932j), Diffuse(0.1, 0.1764), Directional(0.05, 0.1764, 2.950 + 2.932j)])
NORMAL = {0.6827: 1.0, 0.95: 1.959964}


def analyzer(rng):
    """What is wrong with a wheel of polarizers, as effects of a scene."""
    return [
        {"effect": "slot_angle_errors", "errors_deg": {slot: rng.uniform(-1.0, 1.0) for slot in (2, 3, 4, 5)}},
        {"effect": "slot_transmissions", "relative": {slot: rng.uniform(0.9, 1.0) for slot in (2, 3, 4, 5)}},
        {"effect": "extinction_ratio", "ratio": 200.0},
    ]


def changed(scene, effects, seed):
    """A scene with another analyzer, another reference and other noise."""
    names = {effect["effect"] for effect in effects}
    kept = [effect for effect in scene["effects"] if effect["effect"] not in names]
    return scene | {"effects": kept + effects, "seed": seed}


def written(folder, readings, step_deg, back_and_forth):
    """The shipped recipes with their rig, for a scan of some directions of iron and a calibration of some readings."""
    for name in ("recipes", "rigs", "scenes"):
        (folder / name).mkdir(parents=True)
    (folder / "rigs" / "simulated.yaml").write_text((ROOT / "rigs" / "simulated.yaml").read_text())
    scenes = {}
    for name in ("iron_imperfect_polarizers", "calibrate_polarizer"):
        scenes[name] = yaml.safe_load((ROOT / "scenes" / f"{name}.yaml").read_text())
        (folder / "scenes" / f"{name}.yaml").write_text(yaml.safe_dump(scenes[name]))
        recipe = yaml.safe_load((ROOT / "recipes" / f"{name}.yaml").read_text())
        if "calibrate" in recipe:
            recipe |= {"readings": back_and_forth, "calibrate": recipe["calibrate"] | REFERENCE}
        else:
            recipe |= {"readings": readings, "exit": {"start_deg": 0.0, "stop_deg": 60.0, "step_deg": step_deg}}
        (folder / "recipes" / f"{name}.yaml").write_text(yaml.safe_dump(recipe))
    return folder / "recipes", scenes


def read_without_sockets(scene, steps):
    """The readings of steps, by the bench's own world, with everything standing where it was sent."""
    world, now_s, readings = World(Scene.model_validate(scene)), 0.0, []
    for step in steps:
        target = step.target
        world.angle_deg["source_arm"] = lambda _, at=target.incidence_deg: at
        world.angle_deg["detector_arm"] = lambda _, at=target.exit_deg: at
        now_s = world.analyzer.wheel.turn(target.slot, now_s, slots=6, slot_s=0.01) + 1.0
        for repeat in range(step.readings):
            power_w = world.measure_w(now_s, step.exposure_s)
            now_s += step.exposure_s
            at = (now_s, target.incidence_deg, target.exit_deg, target.azimuth_deg, target.slot, step.analyzer_deg)
            readings.append(Reading(step.point, step.kind, repeat, *at, step.exposure_s, power_w))
    return tuple(readings)


def true_polarization(exit_deg):
    s0, s1, s2, _ = IRON.stokes(math.radians(60.0), math.radians(abs(exit_deg)), math.pi)
    return math.hypot(s1, s2) / s0, math.degrees(0.5 * math.atan2(s2, s1))


class Seeds:
    """Calibrations and scans of one seed after another, without sockets."""

    def __init__(self, recipes, scenes):
        self.setup = load_recipe(recipes / "iron_imperfect_polarizers.yaml")
        self.reference = load_calibration_recipe(recipes / "calibrate_polarizer.yaml")
        self.scenes = scenes

    def drawn(self, seed):
        """The calibration of a seed's analyzer, and the readings of iron through it."""
        rng = np.random.default_rng([7, seed])
        effects, rig, recipe = analyzer(rng), self.reference.rig, self.reference.recipe
        zero_deg, scans = rng.normal(0.0, REFERENCE["zero_stderr_deg"]), []
        lamp = {"effect": "polarized_lamp", "s1": rng.uniform(-0.9, 0.1), "s2": rng.uniform(-0.4, 0.4)}
        steps = calibration_steps(recipe, slots(rig), timing(rig))
        for number, angle_deg in enumerate(recipe.calibrate.angles_deg):
            error_deg = zero_deg + rng.normal(0.0, REFERENCE["setting_stderr_deg"])
            at = {"effect": "reference_polarizer", "angle_deg": angle_deg, "error_deg": error_deg}
            scene = changed(self.scenes["calibrate_polarizer"], [*effects, lamp, at], 100 * seed + number)
            scan = CalibrationScan(str(number), recipe.calibrate, angle_deg, read_without_sockets(scene, steps))
            scans.append(StoredScan(scan, recipe, rig, datetime.now(UTC), "0"))
        scene = changed(self.scenes["iron_imperfect_polarizers"], effects, 100 * seed + 99)
        return solved(scans), read_without_sockets(scene, plan(self.setup.recipe, self.setup.rig))

    def reduced(self, calibration, readings):
        """Points with a calibration and without."""
        recipe = self.setup.recipe.model_copy(update={"calibration": "here"})
        return (
            reduction(recipe, self.setup.rig, calibration).scan(readings),
            reduction(self.setup.recipe, self.setup.rig).scan(readings),
        )


def pulls(points):
    """Errors of DoLP and AoLP in units of the stated ones, (N, 2)."""
    rows = []
    for point in points:
        dolp, aolp_deg = true_polarization(point.exit_deg)
        off_deg = math.remainder(point.aolp_deg - aolp_deg, 180.0)
        rows.append(((point.dolp_debiased - dolp) / point.dolp_stderr, off_deg / point.aolp_stderr_deg))
    return np.array(rows)


def test_readings_without_sockets_are_those_of_the_bench(tmp_path):
    """Of a scan and of a calibration, with all noise: same seed, same readings."""
    recipes, scenes = written(tmp_path, 2, 20.0, 1)
    stored = run(recipes / "iron_imperfect_polarizers.yaml", out=tmp_path / "runs", speed="max", live_fit=False)
    steps = plan(stored.recipe, stored.rig)
    here = read_without_sockets(scenes["iron_imperfect_polarizers"], steps)
    assert [(r.point, r.kind, r.slot, r.analyzer_deg) for r in here] == [
        (r.point, r.kind, r.slot, r.analyzer_deg) for r in stored.readings
    ]
    assert_allclose([r.power_w for r in here], [r.power_w for r in stored.readings], rtol=1e-5)

    setup = load_calibration_recipe(recipes / "calibrate_polarizer.yaml")
    calibrate([recipes / "calibrate_polarizer.yaml"], out=tmp_path / "scans", speed="max", ask=str, tell=str)
    scans = [stored_scan(folder).scan for folder in (tmp_path / "scans").iterdir()]
    for number, scan in enumerate(sorted(scans, key=lambda scan: scan.setting_deg)[:2]):
        at = {"effect": "reference_polarizer", "angle_deg": scan.setting_deg, "error_deg": 0.02}
        scene = changed(scenes["calibrate_polarizer"], [at], 1 + number)
        here = read_without_sockets(scene, calibration_steps(setup.recipe, slots(setup.rig), timing(setup.rig)))
        assert_allclose([r.power_w for r in here], [r.power_w for r in scan.readings], rtol=1e-5)


def test_a_few_whole_benches_measure_dolp_within_its_stated_error(tmp_path):
    """3 seeds, 4 directions each, every byte over a socket; seeds are fixed, so this passes or fails always."""
    calibrated, plain = [], []
    for seed in range(3):
        folder = tmp_path / str(seed)
        recipes, scenes = written(folder, 4, 20.0, 12)
        rng = np.random.default_rng([8, seed])
        effects = analyzer(rng)
        at = {"effect": "reference_polarizer", "error_deg": rng.normal(0.0, 0.05)}
        for name, more in (("calibrate_polarizer", [at]), ("iron_imperfect_polarizers", [])):
            scene = changed(scenes[name], [*effects, *more], 100 * (seed + bool(more)))
            (folder / "scenes" / f"{name}.yaml").write_text(yaml.safe_dump(scene))
        iron = recipes / "iron_imperfect_polarizers.yaml"
        plain += run(iron, out=folder / "runs", speed="max", live_fit=False).points
        calibrate(
            [recipes / "calibrate_polarizer.yaml"],
            out=folder / "scans",
            speed="max",
            store=folder / "found.yaml",
            ask=str,
            tell=str,
        )
        named = yaml.safe_load(iron.read_text()) | {"calibration": "../found.yaml", "calibration_max_age_days": 1.0}
        iron.write_text(yaml.safe_dump(named))
        stored = run(iron, out=folder / "runs", speed="max", live_fit=False)
        calibrated += measured(stored.folder).points
    assert np.abs(pulls(calibrated)).max() < 3.5
    assert np.mean(np.square(pulls(calibrated))) < 2.0
    assert np.sqrt(np.mean(np.square(pulls(plain)[:, 0]))) > 5.0


def test_over_20_seeds_without_sockets_the_stated_errors_hold(tmp_path):
    seeds = Seeds(*written(tmp_path, 3, 20.0, 10))
    found = [seeds.reduced(*seeds.drawn(seed)) for seed in range(20)]
    calibrated = np.array([pulls(points) for points, _ in found])
    plain = np.array([pulls(points) for _, points in found])
    assert 0.7 < np.sqrt(np.mean(calibrated**2)) < 1.3
    assert np.mean(np.abs(plain[..., 0]) < 1.96) < 0.5
    dimmed = [replace(point, dolp_stderr=point.dolp_stderr / 2.0) for points, _ in found for point in points]
    assert np.sqrt(np.mean(pulls(dimmed)[:, 0] ** 2)) > 1.4, "the test would see errors that are stated too small"


@pytest.mark.long
@pytest.mark.timeout(1800)
def test_over_100_seeds_the_intervals_of_a_fit_hold_the_truth_although_directions_share_an_error(tmp_path):
    seeds = Seeds(*written(tmp_path, 3, 2.0, 20))
    recipe = seeds.setup.recipe.model_copy(update={"calibration": "here"})
    truth, apart, together = seeds.setup.scene.truth(), [], []
    for seed in range(100):
        calibration, readings = seeds.drawn(seed)
        points, _ = seeds.reduced(calibration, readings)
        run_of_seed = MeasuredRun(tmp_path, recipe, seeds.setup.rig, readings, points, {}, (), calibration)
        family = surface_family(recipe.fit, seeds.setup.rig.calibration.acceptance_sr)
        alone = fit(dataset(points), family, **fit_arguments(recipe.fit))
        for fitted, collected in (
            (alone, apart),
            (with_shared_errors(alone, refits(run_of_seed)), together),
        ):
            collected.append(
                [(fit_of.value - truth[name]) / fit_of.stderr for name, fit_of in fitted.parameters.items()]
            )
    for name, one, other in zip(truth, np.array(apart).T, np.array(together).T, strict=True):
        print(f"{name}: rms pull {np.sqrt(np.mean(other**2)):.2f}, as if independent {np.sqrt(np.mean(one**2)):.2f}")
    assert np.mean(np.abs(together) < NORMAL[0.95], axis=0).min() > 0.88
    assert np.sqrt(np.mean(np.square(apart), axis=0)).max() > 1.4


@pytest.mark.long
@pytest.mark.timeout(1800)
def test_over_300_seeds_the_intervals_hold_dolp_as_often_as_they_say(tmp_path, record_property):
    count = 300
    seeds = Seeds(*written(tmp_path, 3, 10.0, 20))
    calibrated, plain, errors, stderrs = [], [], [], []
    for seed in range(count):
        with_it, without = seeds.reduced(*seeds.drawn(seed))
        calibrated.append(pulls(with_it))
        plain.append(pulls(without))
        errors.append([[p.dolp - true_polarization(p.exit_deg)[0] for p in points] for points in (with_it, without)])
        stderrs.append([point.dolp_stderr for point in with_it])
    calibrated, plain, errors = np.array(calibrated), np.array(plain), np.array(errors)
    for which, name in enumerate(("DoLP", "AoLP")):
        pull, bare = calibrated[..., which], plain[..., which]
        if name == "AoLP":  # light of the first direction, along the normal, is hardly polarized
            pull, bare = pull[:, 1:], bare[:, 1:]
        held = {share: float(np.mean(np.abs(pull) < width)) for share, width in NORMAL.items()}
        bare_held = {share: float(np.mean(np.abs(bare) < width)) for share, width in NORMAL.items()}
        print(
            f"{name}: calibrated {held}, mean pull {pull.mean():.3f}, rms {np.sqrt(np.mean(pull**2)):.3f}; "
            f"uncalibrated {bare_held}, rms pull {np.sqrt(np.mean(bare**2)):.1f}"
        )
        record_property(name, held)
        # readings of one seed share their calibration: as good as independent are the seeds alone
        for share, observed in held.items():
            assert abs(observed - share) < 3.0 * math.sqrt(share * (1.0 - share) / count), name
        assert abs(pull.mean()) < 3.0 / math.sqrt(count)
    rms, stated = np.sqrt(np.mean(errors**2, axis=0)), np.sqrt(np.mean(np.square(stderrs), axis=0))
    for point, (with_it, without, said) in enumerate(zip(*rms, stated, strict=True)):
        print(f"exit {10 * point}: rms error of DoLP {with_it:.5f} (stated {said:.5f}), uncalibrated {without:.5f}")
    bright = slice(3, None)  # from 30 degrees on the detector's noise does not hide what the analyzer does
    assert (rms[1, bright] > 10.0 * rms[0, bright]).all()
    assert np.mean(np.abs(plain[..., 0]) < NORMAL[0.95]) < 0.3
