"""Precision before the scan: what is predicted is what comes of it."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from click.testing import CliRunner
from numpy.testing import assert_allclose

import goniometer
from acquisition.fit_points import dataset, fit_arguments, surface_family
from acquisition.readings import Reading
from acquisition.recipe import MAX_READINGS, Recipe
from acquisition.timing import READING_S
from goniometer import cli
from goniometer.budget.assumed_sample import assumed_sample
from goniometer.budget.budget import Budget, Outcome, budget
from goniometer.budget.command import BudgetAsked, run_budget
from goniometer.budget.designed_recipe import designed_recipe
from goniometer.budget.forecast import Forecast, forecast, told_by_points
from goniometer.budget.recipe_changes import changes, polarizer_sets
from goniometer.budget.text import cheapest_text
from goniometer.errors import ConfigurationError
from goniometer.load_files import load_recipe
from goniometer.planning import plan, reduction
from model.fit import fit
from model.geometry import in_plane
from sim_devices.analyzer import analyzer_row
from sim_devices.world import surface

ROOT = Path(__file__).resolve().parents[2]
IRON, GLASS = (ROOT / "recipes" / f"{name}_60deg.yaml" for name in ("iron", "glass"))
SHORT = {"exit": {"start_deg": 0.0, "stop_deg": 60.0, "step_deg": 6.0}, "readings": 2}


def write_variant(folder, recipe=IRON, scene_changes=None, **recipe_changes):
    """A copy of a shipped recipe with changes, beside copies of its rig and scene."""
    content = yaml.safe_load(recipe.read_text()) | recipe_changes
    scene = yaml.safe_load((ROOT / "recipes" / content["scene"]).read_text()) | (scene_changes or {})
    for kind, name, text in (
        ("recipes", recipe.name, yaml.safe_dump({key: value for key, value in content.items() if value is not None})),
        ("scenes", Path(content["scene"]).name, yaml.safe_dump(scene)),
        ("rigs", "simulated.yaml", (ROOT / "rigs" / "simulated.yaml").read_text()),
    ):
        (folder / kind).mkdir(exist_ok=True)
        (folder / kind / name).write_text(text)
    return folder / "recipes" / recipe.name


def ask(recipe, **changes):
    nothing = {"rig": None, "wanted": None, "assumptions": (), "plot": None, "design": None, "time_s": None}
    return run_budget(BudgetAsked(recipe=recipe, **{**nothing, "criterion": "d", **changes}))


def loaded(path):
    setup = load_recipe(path)
    return setup, assumed_sample(setup, ())


def scatter(setup, recipe, runs, seed):
    """Fitted parameters (runs, P) of simulated scans, with light and noise as the simulated bench has them."""
    scene, photon_w_s = setup.scene, 6.62607015e-34 * 299792458.0 / (recipe.wavelength_nm * 1e-9)
    noise = {effect.effect: getattr(effect, "power_w", None) for effect in scene.effects}
    held = next(device for device in scene.devices.values() if device.type == "thorlabs_fw102c").slots
    taken = empty_readings(plan(recipe, setup.rig))
    exit_deg, exposure_s = np.array([(reading.exit_deg, reading.exposure_s) for reading in taken]).T
    directions = np.full(len(taken), np.radians(recipe.incidence_deg)), *in_plane(np.radians(exit_deg))
    rows = np.array(
        [row if (row := analyzer_row(held[reading.slot])) is not None else np.zeros(4) for reading in taken]
    )
    reaching_w = scene.lamp.power_w * setup.rig.calibration.acceptance_sr * np.cos(np.radians(exit_deg))
    power_w = reaching_w * (rows * surface(scene).stokes(*directions)).sum(axis=1) + noise["dark_current"]
    random = np.random.default_rng(seed)
    family, reduce = surface_family(recipe.fit, setup.rig.calibration.acceptance_sr), reduction(recipe, setup.rig)
    found = []
    for _ in range(runs):
        noisy_w = random.poisson(power_w * exposure_s / photon_w_s) * photon_w_s / exposure_s
        noisy_w += random.normal(0.0, noise["read_noise"] * np.sqrt(0.003 / exposure_s))
        readings = [replace(reading, power_w=float(power)) for reading, power in zip(taken, noisy_w, strict=True)]
        result = fit(dataset(reduce.scan(readings)), family, **fit_arguments(recipe.fit))
        found.append([result.parameters[name].value for name in family.names])
    return np.array(found)


def empty_readings(steps):
    """Readings of steps, still without power."""
    return [
        Reading(
            point=step.point,
            kind=step.kind,
            repeat=repeat,
            time_s=0.0,
            incidence_deg=step.target.incidence_deg,
            exit_deg=step.target.exit_deg,
            azimuth_deg=step.target.azimuth_deg,
            slot=step.target.slot,
            analyzer_deg=step.analyzer_deg,
            exposure_s=step.exposure_s,
            power_w=0.0,
        )
        for step in steps
        for repeat in range(step.readings)
    ]


def ratios(setup, sample, recipe, runs, seed):
    """Scatter of simulated runs over predicted standard errors, of each parameter."""
    predicted = np.array(list(forecast(recipe, setup.rig, sample).final.values()))
    return scatter(setup, recipe, runs, seed).std(axis=0, ddof=1) / predicted


@pytest.mark.parametrize("path", [IRON, GLASS], ids=["iron", "glass"])
def test_runs_scatter_as_predicted(path):
    """Sixty runs know their scatter to 9 %; three times that is allowed."""
    setup, sample = loaded(path)
    coarse = setup.recipe.model_copy(update={"exit": setup.recipe.exit.model_copy(update={"step_deg": 4.0})})
    assert_allclose(ratios(setup, sample, coarse, 60, seed=1), 1.0, atol=0.28)


@pytest.mark.long
@pytest.mark.timeout(600)
@pytest.mark.parametrize("path", [IRON, GLASS], ids=["iron", "glass"])
def test_300_runs_scatter_as_predicted_within_a_tenth(path):
    """As they are, and as they are designed."""
    setup, sample = loaded(path)
    half_s = forecast(setup.recipe, setup.rig, sample).duration_s / 2.0
    designs = [designed_recipe(setup.recipe, setup.rig, sample, wanted, half_s) for wanted in (None, "n")]
    for recipe in (setup.recipe, *designs):
        assert_allclose(ratios(setup, sample, recipe, 300, seed=1), 1.0, atol=0.1)


@pytest.mark.parametrize("path", [IRON, GLASS], ids=["iron", "glass"])
def test_the_design_is_as_precise_on_the_index_in_less_than_half_the_time(path):
    setup, sample = loaded(path)
    uniform = forecast(setup.recipe, setup.rig, sample)
    time_s = 0.25 * uniform.duration_s
    designed = forecast(designed_recipe(setup.recipe, setup.rig, sample, "n", time_s), setup.rig, sample)
    assert designed.duration_s <= time_s
    assert designed.final["n"] <= uniform.final["n"]


def log_volume(setup, recipe, sample, values):
    """Logarithm of the volume of the parameters' joint confidence region, but for a constant."""
    told = told_by_points(recipe, setup.rig, values, sample.dark_w).sum(axis=0)
    return -0.5 * np.linalg.slogdet(told)[1]


@pytest.mark.parametrize("path", [IRON, GLASS], ids=["iron", "glass"])
def test_each_design_is_best_at_what_it_is_for(path):
    setup, sample = loaded(path)
    for_n, for_all = (designed_recipe(setup.recipe, setup.rig, sample, wanted, 60.0) for wanted in ("n", None))
    n, n_of_all = (forecast(recipe, setup.rig, sample).final["n"] for recipe in (for_n, for_all))
    assert n < n_of_all
    volume_of_n, volume = (log_volume(setup, recipe, sample, sample.values) for recipe in (for_n, for_all))
    assert volume < volume_of_n


def test_the_whole_program_finds_the_errors_and_the_time_that_were_predicted(tmp_path):
    """Over sockets, with different readings at each angle, and fitted while it runs."""
    recipe = write_variant(tmp_path, exit=None, exit_deg=[0.0, 10.0, 40.0, 60.0], readings=[20, 30, 100, 50])
    setup, sample = loaded(recipe)
    predicted = forecast(setup.recipe, setup.rig, sample)
    events = []
    stored = goniometer.run(recipe, out=tmp_path / "runs", speed="max", subscribers=[events.append])
    assert len(stored.readings) == predicted.readings == 5 * 200
    assert stored.fit is not None
    for name, stderr in predicted.final.items():
        assert_allclose(stored.fit.parameters[name].stderr, stderr, rtol=0.05, err_msg=name)
    (ended,) = [event for event in events if type(event).__name__ == "ScanEnded"]
    assert_allclose(ended.bench_duration_s, predicted.duration_s, rtol=0.05)


def test_predicted_covariances_are_those_of_a_run_without_noise(tmp_path):
    """Exactly: the same reduction, of readings that the simulated bench gave."""
    reference = {"exit_deg": 45.0, "every_points": 4}
    recipe = write_variant(tmp_path, scene_changes={"effects": []}, **{**SHORT, "reference": reference})
    setup, sample = loaded(recipe)
    stored = goniometer.run(recipe, out=tmp_path / "runs", speed="max", live_fit=False)
    predicted = forecast(setup.recipe, setup.rig, sample)
    for name, stderr in predicted.final.items():
        assert_allclose(stored.fit.parameters[name].stderr, stderr, rtol=1e-3, err_msg=name)


def test_errors_fall_as_the_scan_goes_on_and_end_with_it():
    setup, sample = loaded(IRON)
    expected = forecast(setup.recipe, setup.rig, sample)
    assert_allclose(expected.duration_s, sum(step.duration_s for step in plan(setup.recipe, setup.rig)))
    assert expected.stderr.shape == (61, 6)
    assert np.isinf(expected.stderr[0]).all()
    assert np.isfinite(expected.stderr[-1]).all()
    with np.errstate(invalid="ignore"):
        assert not (np.diff(expected.stderr, axis=0) > 1e-9 * expected.stderr[1:]).any()


def test_a_prior_of_the_recipe_counts(tmp_path):
    fit_section = {**yaml.safe_load(IRON.read_text())["fit"], "prior": {"n": [2.95, 1e-3]}}
    setup, sample = loaded(write_variant(tmp_path, fit=fit_section))
    without, plain = loaded(IRON)
    known = forecast(setup.recipe, setup.rig, sample).final
    unknown = forecast(without.recipe, without.rig, plain).final
    assert_allclose(known["n"], (1e6 + unknown["n"] ** -2) ** -0.5)
    assert known["k"] < unknown["k"]


def test_changes_cost_and_gain_what_their_own_forecast_says():
    setup, sample = loaded(GLASS)
    found = budget(setup.recipe, setup.rig, sample, "n")
    outcomes = {outcome.words: outcome.forecast for outcome in found.outcomes}
    assert list(outcomes) == [
        "12 readings in every slot",
        "exposure 0.12 s",
        "angles half as far apart",
        "exit angles to 75°",
        "exit angles to -15°",
        next(words for words in outcomes if words.startswith("polarizers")),
    ]
    more = outcomes["12 readings in every slot"]
    turns_s = 4.0  # longer stays make shorter blocks
    assert_allclose(more.duration_s - found.now.duration_s, 61 * 5 * 9 * (0.03 + READING_S), atol=turns_s)
    for name, stderr in more.final.items():
        assert_allclose(stderr, found.now.final[name] / 2.0, rtol=1e-6)
    assert len(outcomes["angles half as far apart"].ends_s) == 121
    assert len(outcomes["exit angles to 75°"].ends_s) == len(outcomes["exit angles to -15°"].ends_s) == 76


def test_changed_recipes_are_valid_and_within_the_rigs_limits(tmp_path):
    recipe = write_variant(tmp_path, exit=None, exit_deg=[80.0, 50.0, 20.0, -70.0], readings=[1, 2, 3, 4])
    setup, _ = loaded(recipe)
    every, triples = polarizer_sets(setup.recipe, setup.rig)
    assert every == []
    assert len(triples) == 4
    for change in (*changes(setup.recipe, setup.rig), *triples):
        Recipe.model_validate(change.recipe.model_dump())
        assert max(map(abs, change.recipe.exit_angles_deg())) <= 85.0, change.words
    finer = next(change for change in changes(setup.recipe, setup.rig) if "half" in change.words).recipe
    assert finer.exit_angles_deg() == (80.0, 65.0, 50.0, 35.0, 20.0, -25.0, -70.0)
    assert finer.readings == (1, 1, 2, 2, 3, 3, 4)
    full = setup.recipe.model_copy(update={"readings": MAX_READINGS, "exposure_s": 9.0})
    assert not any("readings" in change.words or "exposure" in change.words for change in changes(full, setup.rig))


def outcome(words, duration_s, stderr):
    return Outcome(words, Forecast(("n",), np.array([duration_s]), np.array([[stderr]]), 1))


@pytest.mark.parametrize(
    ("now", "others", "cheapest"),
    [
        (0.04, [("a", 200.0, 0.02), ("b", 150.0, 0.025), ("c", 900.0, 0.001)], "b"),
        (0.04, [("a", 101.0, 0.001), ("b", 100.0, 0.039)], "b"),
        (0.04, [("a", 50.0, 0.05), ("b", 200.0, 0.04)], None),
        (np.inf, [("a", 300.0, 0.001), ("b", 200.0, 0.5), ("c", 150.0, np.inf)], "b"),
        (np.inf, [("a", 300.0, np.inf)], None),
    ],
)
def test_the_cheapest_change_gains_most_per_second(now, others, cheapest):
    found = Budget(outcome("now", 100.0, now).forecast, tuple(outcome(*other) for other in others))
    best = found.cheapest("n")
    assert (best.words if best else None) == cheapest
    said = cheapest_text(found, "n")
    assert "inf" not in said
    assert (f"cheapest change is {cheapest}" if cheapest else "none of these changes") in said


def test_what_a_recipe_can_never_determine_is_named(tmp_path):
    fit_section = {**yaml.safe_load(GLASS.read_text())["fit"], "objective": "normalised"}
    recipe = write_variant(tmp_path, GLASS, fit=fit_section, **SHORT)
    report = ask(recipe)
    assert "This recipe can never determine rho_s, rho_d, rho_dd: there are changes of these that leave" in report.text
    assert report.data["undetermined"] == ["rho_s", "rho_d", "rho_dd"]
    assert report.data["stderr"]["rho_s"] is None
    assert 0.0 < report.data["stderr"]["n"] < 1.0
    assert "inf" not in report.text.replace("information", "")
    json.dumps(report.data, allow_nan=False)
    with pytest.raises(ConfigurationError, match=r"never determine rho_s, rho_d, rho_dd.*No design was made"):
        ask(recipe, design=tmp_path / "recipes" / "design.yaml")


def dielectric_with_free_k(folder, **changes):
    section = yaml.safe_load(GLASS.read_text())["fit"]
    section |= {"free": {**section["free"], "k": [0.0, 2.0]}, "fixed": {}}
    return write_variant(folder, GLASS, fit=section, **changes)


def test_a_parameter_without_slope_is_open_and_nothing_is_recommended_for_it(tmp_path):
    """At k = 0 reflectance does not change with k to first order: derivatives are of rounding."""
    report = ask(dielectric_with_free_k(tmp_path, **SHORT), wanted="k", plot=tmp_path / "open.png")
    assert report.data["stderr"]["k"] is None
    assert report.data["undetermined"] == ["k"]
    assert report.data["cheapest"]["k"] is None
    assert all(change["stderr"]["k"] is None for change in report.data["changes"])
    assert "e+" not in report.text
    assert "This recipe can never determine k" in report.text
    assert "k: not determined, and none of these changes determines it." in report.text
    held = ask(write_variant(tmp_path, GLASS, **SHORT)).data["stderr"]
    for name, stderr in held.items():
        assert_allclose(report.data["stderr"][name], stderr, rtol=1e-6, err_msg=name)
    with pytest.raises(ConfigurationError, match=r"never determine k: .*No design was made"):
        ask(dielectric_with_free_k(tmp_path, **SHORT), design=tmp_path / "recipes" / "design.yaml")


def test_an_error_larger_than_the_search_range_is_no_number(tmp_path):
    """With hardly any k the readings hardly change with it: its error would be many times the range."""
    recipe = dielectric_with_free_k(tmp_path, **SHORT)
    report = ask(recipe, assumptions=["k=1e-5"])
    assert report.data["stderr"]["k"] is None
    assert report.data["undetermined"] == ["k"]
    assert "can never determine" not in report.text
    assert "open: not determined; readings do not change with it, or its error is larger than the range" in report.text
    widths = {"sigma": 0.98, "n": 2.9, "k": 2.0}
    for row in report.data["scan"]:
        assert all(row["stderr"][name] is None or row["stderr"][name] <= width for name, width in widths.items())
    assert any(row["stderr"]["n"] is None for row in report.data["scan"])
    assert report.data["stderr"]["n"] is not None


def test_polarizers_that_leave_a_parameter_open_are_not_the_best(monkeypatch):
    setup, sample = loaded(GLASS)
    precise_but_open = Forecast(("n", "k"), np.array([1.0]), np.array([[1e-9, np.inf]]), 1)
    all_known = Forecast(("n", "k"), np.array([100.0]), np.array([[1.0, 1.0]]), 1)
    triple = {tuple(change.recipe.analyzer_deg) for change in polarizer_sets(setup.recipe, setup.rig)[1]}
    good = sorted(triple)[1]

    def pretended(recipe, _rig, _sample):
        return all_known if tuple(recipe.analyzer_deg) == good else precise_but_open

    monkeypatch.setattr("goniometer.budget.budget.forecast", pretended)
    best = budget(setup.recipe, setup.rig, sample).outcomes[-1]
    assert best.words == f"polarizers {', '.join(f'{angle:g}' for angle in good)}"


def test_an_objective_without_errors_is_refused(tmp_path):
    fit_section = {**yaml.safe_load(GLASS.read_text())["fit"], "objective": "rms"}
    with pytest.raises(ConfigurationError, match=r"objective is rms.*Choose the objective dolp"):
        ask(write_variant(tmp_path, GLASS, fit=fit_section, **SHORT))


REAL_RIG = ROOT / "rigs" / "example_hardware.yaml"
EXPECTED = ("sigma=0.15", "n = 1.5", "rho_s=0.7", "rho_d=0.1", "rho_dd=0.05")


def test_a_real_sample_is_what_a_person_expects():
    report = ask(GLASS, rig=REAL_RIG, assumptions=EXPECTED)
    assert report.data["assumed"] == {"sigma": 0.15, "n": 1.5, "rho_s": 0.7, "rho_d": 0.1, "rho_dd": 0.05}
    assert all(stderr > 0.0 for stderr in report.data["stderr"].values())


@pytest.mark.parametrize(
    ("path", "rig", "assumptions", "message"),
    [
        (GLASS, REAL_RIG, EXPECTED[1:], r"nothing is known of sigma, because .*example_hardware.yaml holds no scene.*"),
        (GLASS, None, ["k=0.1"], "--assume k=0.1: k is held by the recipe"),
        (GLASS, None, ["m=0.1"], "--assume m=0.1: m is not a parameter; the recipe's fit has sigma, n, rho_s, rho_d"),
        (GLASS, None, ["n"], r"--assume n: Write a number, .* for example n=1.5 or n=1.5\+-0.1. Nothing was computed"),
        (GLASS, None, ["n=high"], "--assume n=high: Write a number"),
        (GLASS, None, ["n=nan"], "--assume n=nan: Write a number"),
        (GLASS, None, ["n=1.5+--1"], "--assume n=1.5[+]--1: Write a number"),
        (GLASS, None, ["n=5"], r"n = 5 \(.*glass.yaml and --assume\) lies outside the recipe's bounds, 1.1 to 4"),
        (GLASS, None, ["n=3.9±0.2"], r"n = 4.1 .* lies outside the recipe's bounds"),
    ],
)
def test_an_assumption_that_cannot_be_kept_is_refused(path, rig, assumptions, message):
    with pytest.raises(ConfigurationError, match=message):
        ask(path, rig=rig, assumptions=assumptions)


def test_several_bad_assumptions_are_refused_together():
    with pytest.raises(ConfigurationError) as refused:
        ask(GLASS, assumptions=["k=1", "n=x", "sigma=0.1"])
    assert len(refused.value.faults) == 2


def test_instrument_angles_are_in_degrees(tmp_path):
    section = yaml.safe_load(IRON.read_text())["fit"]
    section["free"]["exit_offset_deg"] = [-1.0, 1.0]
    recipe = write_variant(tmp_path, fit=section, **SHORT)
    setup = load_recipe(recipe)
    sample = assumed_sample(setup, ["exit_offset_deg=0.5"])
    assert_allclose(sample.values["exit_offset_rad"], np.radians(0.5))
    report = ask(recipe, assumptions=["exit_offset_deg=0.5"])
    assert_allclose(report.data["assumed"]["exit_offset_deg"], 0.5)
    stored = goniometer.run(recipe, out=tmp_path / "runs", speed="max", live_fit=False)
    reported = json.loads((stored.folder / "fit.json").read_text())["parameters"]["exit_offset_deg"]["stderr"]
    assert_allclose(ask(recipe).data["stderr"]["exit_offset_deg"], reported, rtol=0.1)


def test_an_uncertain_sample_gets_a_design_for_all_that_it_may_be():
    """On the average over the samples it is better than the design for the middle one."""
    setup = load_recipe(GLASS)
    sure, unsure = (assumed_sample(setup, [f"n=2.0{spread}", f"sigma=0.3{spread}"]) for spread in ("", "±0.15"))
    assert len(sure.samples()) == 1
    assert_allclose(np.std([sample["n"] for sample in unsure.samples()[1:]]), 0.15)

    for_sure, for_all = (designed_recipe(setup.recipe, setup.rig, sample, None, 60.0) for sample in (sure, unsure))
    volumes, volumes_of_sure = (
        [log_volume(setup, recipe, unsure, values) for values in unsure.samples()] for recipe in (for_all, for_sure)
    )
    assert np.mean(volumes) < np.mean(volumes_of_sure)


@pytest.mark.parametrize("reference", [None, {"exit_deg": 60.0, "every_points": 10}])
def test_a_design_sweeps_the_quicker_way_and_uses_its_time(tmp_path, reference):
    """References are read at both ends of the sweep, and so decide nothing; but their readings cost time, too."""
    setup, sample = loaded(write_variant(tmp_path, reference=reference))
    designed = designed_recipe(setup.recipe, setup.rig, sample, "n", 40.0)
    other_way = {"exit_deg": designed.exit_deg[::-1], "readings": designed.readings[::-1]}
    assert designed.exit_deg == tuple(sorted(designed.exit_deg))
    duration_s = forecast(designed, setup.rig, sample).duration_s
    other_way_s = forecast(designed.model_copy(update=other_way), setup.rig, sample).duration_s
    assert duration_s <= other_way_s + 1e-9 if reference else duration_s < other_way_s
    assert 40.0 - 5 * (0.03 + READING_S) < duration_s <= 40.0


def test_sets_of_polarizers_are_those_of_the_wheel(tmp_path):
    setup, _ = loaded(write_variant(tmp_path, analyzer_deg=[0.0, 45.0, 90.0]))
    every, triples = polarizer_sets(setup.recipe, setup.rig)
    assert [change.recipe.analyzer_deg for change in every] == [(0.0, 45.0, 90.0, 135.0)]
    assert {change.recipe.analyzer_deg for change in triples} == {
        (0.0, 45.0, 135.0),
        (0.0, 90.0, 135.0),
        (45.0, 90.0, 135.0),
    }


def test_a_designed_recipe_is_checked_and_run_like_any_other(tmp_path):
    recipe = write_variant(tmp_path)
    recipe.write_text(IRON.read_text().replace("readings: 3 ", "readings: 3 # often enough"))
    design = tmp_path / "recipes" / "fast.yaml"
    report = ask(recipe, wanted="n", criterion="c", design=design, time_s=40.0)
    setup = load_recipe(design)
    before = load_recipe(recipe).recipe
    assert (
        setup.recipe.model_copy(update={"exit": before.exit, "exit_deg": None, "readings": before.readings}) == before
    ), "all else stays"
    assert list(setup.recipe.exit_angles_deg()) == report.data["design"]["exit_deg"]
    assert list(setup.recipe.readings) == report.data["design"]["readings_in_every_slot"]
    text = design.read_text()
    assert text.startswith("# Exit angles and readings by: goniometer budget ")
    assert "--time 40 --criterion c --for n" in text.splitlines()[0]
    assert "sigma = 0.1764, n = 2.95" in text
    for comment in ("# often enough", "# a metal: n and k are both unknown", "# Iron at 60 degrees"):
        assert comment in text
    checked = CliRunner().invoke(cli.cli, ["check", str(design)], catch_exceptions=False)
    assert f"{report.data['design']['readings']} readings, 0:40" in checked.stdout
    stored = goniometer.run(design, out=tmp_path / "runs", speed="max")
    assert_allclose(stored.fit.parameters["n"].stderr, report.data["design"]["stderr"]["n"], rtol=0.05)
    assert abs(stored.fit.parameters["n"].value - stored.truth["n"]) < 4 * stored.fit.parameters["n"].stderr


def test_a_design_in_another_folder_still_finds_rig_and_scene(tmp_path):
    recipe = write_variant(tmp_path, **SHORT)
    (tmp_path / "elsewhere" / "deep").mkdir(parents=True)
    design = tmp_path / "elsewhere" / "deep" / "fast.yaml"
    ask(recipe, design=design, time_s=60.0)
    assert load_recipe(design).scene == load_recipe(recipe).scene


BLOCKS = """\
recipe: x
rig: ../rigs/simulated.yaml
scene: ../scenes/iron.yaml
wavelength_nm: 550
incidence_deg: 60
exit_deg:
  - 0
  - 30     # the middle
  - 60
# a remark about analyzers
analyzer_deg: [0, 45, 90, 135]
exposure_s: 0.03
fit:
  lobes: [specular]
  free: {sigma: [0.02, 1.0], n: [1.0, 6.0]}
  fixed: {k: 2.932}
readings:
  3
"""


def test_a_recipe_written_in_blocks_is_rewritten_too(tmp_path):
    recipe = write_variant(tmp_path)
    recipe.write_text(BLOCKS)
    design = tmp_path / "recipes" / "fast.yaml"
    ask(recipe, design=design, time_s=30.0)
    assert load_recipe(design).recipe.fit == load_recipe(recipe).recipe.fit
    assert "\n# a remark about analyzers\nanalyzer_deg: [0, 45, 90, 135]\n" in design.read_text()


def test_nothing_is_overwritten(tmp_path):
    recipe = write_variant(tmp_path, **SHORT)
    before = recipe.read_text()
    with pytest.raises(ConfigurationError, match=r"exists already, and was left as it is\. Choose another name"):
        ask(recipe, design=recipe)
    assert recipe.read_text() == before
    with pytest.raises(ConfigurationError, match="cannot be written: No such file"):
        ask(recipe, design=tmp_path / "nowhere" / "fast.yaml")


def test_a_time_too_short_for_any_design_is_refused(tmp_path):
    with pytest.raises(ConfigurationError, match=r"No design was made: 5 s are not enough to visit"):
        ask(write_variant(tmp_path, **SHORT), design=tmp_path / "fast.yaml", time_s=5.0)


def test_an_adaptive_recipe_gets_a_remark_and_no_design(tmp_path):
    recipe = write_variant(tmp_path, **SHORT, adaptive=True, time_limit_s=100.0)
    assert (
        "This scan steers itself; these figures are for its exit angles as they are listed, once." in ask(recipe).text
    )
    with pytest.raises(ConfigurationError, match="An adaptive recipe chooses its exit angles as it goes"):
        ask(recipe, design=tmp_path / "fast.yaml")


def test_a_picture_is_drawn(tmp_path):
    recipe = write_variant(tmp_path, **SHORT)
    for number, changes_asked in enumerate(({}, {"wanted": "n", "criterion": "c", "design": tmp_path / "d.yaml"})):
        picture = tmp_path / f"{number}.png"
        ask(recipe, plot=picture, **changes_asked)
        assert picture.read_bytes().startswith(b"\x89PNG")
    undetermined = write_variant(tmp_path, exit=None, exit_deg=[30.0])
    ask(undetermined, plot=tmp_path / "open.png")
    with pytest.raises(ConfigurationError, match="cannot be written"):
        ask(recipe, plot=tmp_path / "nowhere" / "b.png")


@pytest.fixture
def call(monkeypatch, capsys):
    """Run `goniometer budget` with arguments; gives its exit code and what it printed."""

    def called(*arguments):
        monkeypatch.setattr("sys.argv", ["goniometer", "budget", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            cli.main()
        printed = capsys.readouterr()
        return ended.value.code or 0, printed.out, printed.err

    return called


def test_the_command_line_prints_tables_or_json(call, tmp_path):
    recipe = write_variant(tmp_path, **SHORT)
    (code, plain, _), (code_too, as_json, _) = call(recipe, "--for", "n"), call(recipe, "--for", "n", "--json")
    assert (code, code_too) == (0, 0)
    assert "n: the cheapest change is " in plain
    data = json.loads(as_json)
    assert data["cheapest"]["n"] in plain
    assert set(data["stderr"]) == {"sigma", "n", "k", "rho_s", "rho_d", "rho_dd"}


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--time", "60"], "--time and --criterion are about a design"),
        (["--design", "x.yaml", "--criterion", "c"], "--criterion c needs a parameter"),
        (["--for", "m"], "the recipe's fit does not search it. Choose one of sigma, n, k, rho_s"),
        (["--design", "x.yaml", "--time", "0"], "0"),
    ],
)
def test_a_command_line_that_makes_no_sense_is_refused(options, message, call):
    code, printed, told = call(IRON, *options)
    assert code == 2
    assert message in told
    assert printed == ""
