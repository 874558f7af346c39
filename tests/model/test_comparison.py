"""Comparison of models: the model that made the data wins; criteria and predictions are what statistics says."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.stats import multivariate_normal

from goniometer.errors import FitError
from model.comparison.candidates import Candidate, candidates
from model.comparison.comparison import Compared, akaike, compare
from model.comparison.held_out import FOLDS, folds, held_out
from model.comparison.measured_dolp import measured_dolp
from model.fit import Dataset, fit, lobe_family
from model.fit.observable import MUELLER, Elements, Ratios
from model.geometry import FloatArray, in_plane

HALF_ANGLE = np.radians(0.5)
ALL = {candidate.name: candidate for candidate in candidates(detector_half_angle_rad=HALF_ANGLE)}
ONE_BOUNCE = {name: candidate for name, candidate in ALL.items() if name != "V-grooves, 3 bounces"}
# As far as the exit angle of 80° the only difference, the masking of the light that leaves, is not there.
SAME = {"Hao2023": "V-grooves, 1 bounce", "V-grooves, 1 bounce": "Hao2023"}
BACK_AND_FORTH = np.arange(-40.0, 81.0, 2.0)
WEIGHTS = {"rho_s": 0.7, "rho_d": 0.1, "rho_dd": 0.05}
TABLE_I = {
    "iron": {"sigma": 0.1764, "n": 2.95, "k": 2.932, **WEIGHTS},
    "alumina": {"sigma": 0.2153, "n": 1.77, "k": 0.0, **WEIGHTS},
    "glass": {"sigma": 0.12, "n": 1.525, "k": 0.0, **WEIGHTS},
    "pvc": {"sigma": 0.3796, "n": 1.545, "k": 0.0, **WEIGHTS},
}


def measure(
    candidate: Candidate,
    truth: dict[str, float],
    exit_deg: FloatArray = BACK_AND_FORTH,
    noise_seed: int | None = None,
    relative: float = 1e-3,
) -> Dataset:
    """A scan at 60° incidence with 1e-4/sr of read noise and some of the signal, or none of it."""
    exit_rad, azimuth_rad = in_plane(np.radians(exit_deg))
    incidence_rad = np.full(len(exit_rad), np.radians(60.0))
    stokes = candidate.family.seen(truth).stokes(incidence_rad, exit_rad, azimuth_rad)[:, :3]
    stddev = np.hypot(1e-4, relative * stokes[:, :1]) * np.ones((1, 3))
    # The analyzer's inversion leaves S0 and S1 correlated.
    correlation = np.array([[1.0, 0.3, 0.0], [0.3, 1.0, 0.0], [0.0, 0.0, 1.0]])
    if noise_seed is not None:
        noise = np.random.default_rng(noise_seed).standard_normal(stokes.shape)
        stokes = stokes + stddev * noise @ np.linalg.cholesky(correlation).T
    return Dataset(incidence_rad, exit_rad, azimuth_rad, stokes, stddev[..., None] ** 2 * correlation)


def some_surface(candidate: Candidate, seed: int) -> dict[str, float]:
    """Random parameters; of a metal with odd seeds, where the model knows metals."""
    rng = np.random.default_rng(seed)
    is_metal = seed % 2 == 1 and "k" in candidate.family.names
    ranges = {
        **dict.fromkeys(("sigma", "alpha"), (0.12, 0.45)),
        "n": (0.3, 3.0) if is_metal else (1.3, 2.2),
        "k": (1.0, 5.0) if is_metal else (0.0, 0.0),
        "rho_s": (0.4, 1.0),
        "rho_d": (0.05, 0.5),
        "rho_dd": (0.02, 0.2),
    }
    return {name: float(rng.uniform(*ranges[name])) for name in candidate.family.names}


def names(models: Sequence[Compared]) -> list[str]:
    return [model.candidate.name for model in models]


def above_best(models: Sequence[Compared], name: str) -> tuple[float, float]:
    """By how much a model's criterion, and the deviance of its predictions, are above the lowest."""
    found = models[names(models).index(name)]
    assert found.aic is not None
    assert found.held_out is not None
    deviances = [model.held_out.deviance for model in models if model.held_out is not None]
    return found.aic - models[0].aic, found.held_out.deviance - min(deviances)


def check_that_the_true_model_wins(name: str, seed: int, noise_seed: int | None) -> None:
    data = measure(ALL[name], some_surface(ALL[name], seed), noise_seed=noise_seed)
    models = compare(data, tuple(ONE_BOUNCE.values()))
    aic, deviance = above_best(models, name)
    # Models that hold the true one and more can gain by chance: chi-square with few degrees of freedom.
    assert aic < (1e-6 if noise_seed is None else 6.0)
    assert deviance < (1e-3 if noise_seed is None else 8.0)
    rivals = [model for model in models if model.candidate.name not in (name, SAME.get(name))]
    if noise_seed is None:
        assert all(model.aic is not None and model.aic > models[0].aic + 1.0 for model in rivals)


@pytest.mark.parametrize("noise_seed", [None, 0])
@pytest.mark.parametrize("name", ONE_BOUNCE)
def test_the_model_that_made_the_data_ranks_first(name: str, noise_seed: int | None) -> None:
    for seed in range(2):
        check_that_the_true_model_wins(name, seed, noise_seed)


@pytest.mark.long
@pytest.mark.parametrize("name", ONE_BOUNCE)
def test_the_model_that_made_the_data_ranks_first_in_many_scans(name: str) -> None:
    for seed in range(2, 22):
        check_that_the_true_model_wins(name, seed, None)
        check_that_the_true_model_wins(name, seed, seed)


@pytest.mark.parametrize("sample", TABLE_I)
def test_several_bounces_are_told_from_one(sample: str) -> None:
    data = measure(ALL["V-grooves, 3 bounces"], TABLE_I[sample], np.arange(0.0, 61.0, 2.0), noise_seed=1)
    models = compare(data, tuple(ALL.values()))
    assert names(models)[0] == "V-grooves, 3 bounces"
    assert above_best(models, "V-grooves, 3 bounces") == (0.0, 0.0)
    assert models[0].fit is not None
    assert models[0].fit.p_value > 1e-3
    for rival in models[1:]:
        assert rival.fit is not None
        assert rival.fit.p_value < 1e-3


def test_models_that_no_reading_tells_apart_are_as_good() -> None:
    # Without diffuse light and without masking on the mirror side, Hyde's facets are Priest and Germer's.
    data = measure(ALL["PriestGermer"], {"sigma": 0.2, "n": 1.5, "k": 2.0, "rho_s": 1.0}, np.arange(0.0, 61.0))
    models = {model.candidate.name: model for model in compare(data, [ALL["PriestGermer"], ALL["Hyde"]])}
    assert_allclose(models["Hyde"].aic - models["PriestGermer"].aic, 2.0, rtol=1e-6)


def test_akaike_is_the_likelihood_and_two_for_every_parameter() -> None:
    data = measure(ALL["Hyde"], some_surface(ALL["Hyde"], 0), noise_seed=0)
    few, many = (fit(data, ALL[name].family) for name in ("PriestGermer", "ThreeComponent"))

    def criterion(found) -> float:
        assert data.covariance is not None
        rows = zip(data.values, found.fitted, data.covariance, strict=True)
        ln_likelihood = sum(multivariate_normal(mean, covariance).logpdf(row) for row, mean, covariance in rows)
        return -2.0 * ln_likelihood + 2.0 * len(found.parameters)

    assert_allclose(akaike(data, few) - akaike(data, many), criterion(few) - criterion(many), rtol=1e-9)


def test_akaike_counts_the_size_of_unknown_errors_as_a_parameter() -> None:
    data = replace(measure(ALL["Hyde"], some_surface(ALL["Hyde"], 0), noise_seed=0), covariance=None)
    few, many = (fit(data, ALL[name].family) for name in ("PriestGermer", "ThreeComponent"))

    def criterion(found) -> float:
        left, count, size = data.values - found.fitted, data.values.size, len(found.parameters) + 1
        variance = np.mean(left**2)
        minus_2_ln_likelihood = np.sum(left**2 / variance + np.log(2.0 * np.pi * variance))
        return minus_2_ln_likelihood + 2.0 * size * count / (count - size - 1.0)  # Hurvich and Tsai 1989

    assert_allclose(akaike(data, few) - akaike(data, many), criterion(few) - criterion(many), rtol=1e-9)


def test_akaike_is_infinite_where_there_are_hardly_more_values_than_parameters() -> None:
    data = measure(ALL["Hyde"], some_surface(ALL["Hyde"], 0), np.array([20.0, 60.0]))
    found = fit(replace(data, covariance=None), ALL["PriestGermer"].family)
    assert akaike(replace(data, covariance=None), found) == np.inf


def test_folds_leave_each_row_out_once_and_neighbours_together() -> None:
    data = measure(ALL["Hyde"], some_surface(ALL["Hyde"], 0), np.arange(0.0, 61.0))
    out = folds(data)
    assert_array_equal(np.sum(out, axis=0), 1)
    for fold in out:
        # Lengths of the blocks: nothing lies between two neighbours that are predicted from the rest.
        edges = np.flatnonzero(np.diff(np.concatenate([[0], fold.astype(int), [0]])))
        assert np.diff(edges)[::2].min() >= 4
    order = np.random.default_rng(0).permutation(len(data))
    shuffled = folds(data.some(order))
    assert_array_equal(shuffled, np.array(out)[:, order])


def test_folds_leave_all_readings_at_an_exit_angle_out_together() -> None:
    data = measure(ALL["Hyde"], some_surface(ALL["Hyde"], 0), np.repeat(np.arange(-20.0, 21.0, 5.0), 3))
    signed_rad = np.where(np.cos(data.azimuth_rad) < 0.0, data.exit_rad, -data.exit_rad)
    for fold in folds(data):
        assert not set(signed_rad[fold]) & set(signed_rad[~fold])


def test_too_few_exit_angles_to_leave_some_out_are_refused() -> None:
    data = measure(ALL["Hyde"], some_surface(ALL["Hyde"], 0), np.arange(0.0, 40.0, 10.0))
    with pytest.raises(FitError, match=rf"4 exit angles.*Measure at least {FOLDS}"):
        held_out(data, ALL["Hyde"].family)


@pytest.mark.parametrize("errors_known", [True, False])
def test_predictions_are_those_of_linear_regression(errors_known: bool) -> None:
    # Light is linear in weights: what they predict, and how well, is in any book.
    shapes = {"sigma": 0.3, "n": 1.5, "k": 0.0}
    family = lobe_family(("specular", "diffuse"), {}, shapes)
    made = Candidate("", "", family)
    data = measure(made, {"rho_s": 0.7, "rho_d": 0.3}, np.arange(0.0, 61.0, 3.0), noise_seed=4)
    design = np.stack(
        [
            family.seen(dict(zip(("rho_s", "rho_d"), pair, strict=True))).stokes(*data.directions)[:, :3]
            for pair in np.eye(2)
        ],
        axis=-1,
    )
    covariance = data.covariance if errors_known else np.broadcast_to(np.eye(3), data.covariance.shape)
    chi_square = vagueness = 0.0
    for out in folds(data):
        whitener = np.linalg.inv(np.linalg.cholesky(covariance))
        columns, values = whitener @ design, (whitener @ data.values[..., None])[..., 0]
        left, rest = columns[out].reshape(-1, 2), columns[~out].reshape(-1, 2)
        inverse = np.linalg.inv(rest.T @ rest)
        spread = np.eye(len(left)) + left @ inverse @ left.T
        difference = values[out].ravel() - left @ inverse @ rest.T @ values[~out].ravel()
        chi_square += difference @ np.linalg.solve(spread, difference)
        vagueness += np.linalg.slogdet(spread)[1]
    found = held_out(data if errors_known else replace(data, covariance=None), family)
    assert found.count == data.values.size
    assert_allclose(found.chi_square, chi_square, rtol=1e-6)
    misfit = chi_square if errors_known else found.count * np.log(chi_square / found.count)
    assert_allclose(found.deviance, misfit + vagueness, rtol=1e-6)


def test_a_true_model_predicts_as_well_as_the_noise_allows() -> None:
    # So few directions that the parameters' own errors matter: without them chi-square would be a third too high.
    truth = {"sigma": 0.3, "n": 2.0, "k": 3.0, "rho_s": 0.8, "rho_d": 0.3}
    exit_deg = np.arange(-30.0, 80.0, 8.0)
    found = [held_out(measure(ALL["Hyde"], truth, exit_deg, noise_seed=seed), ALL["Hyde"].family) for seed in range(40)]
    count = sum(one.count for one in found)
    total = sum(one.chi_square for one in found)
    # Predictions of one scan share readings, so that they scatter by somewhat more than chi-square does.
    assert abs(total - count) < 4.0 * np.sqrt(2.0 * count)


def test_a_wrong_model_predicts_badly_though_it_fits_what_it_saw() -> None:
    data = measure(ALL["ThreeComponent"], some_surface(ALL["ThreeComponent"], 0), noise_seed=0)
    right, wrong = (held_out(data, ALL[name].family) for name in ("ThreeComponent", "Hyde"))
    assert wrong.chi_square > 10.0 * wrong.count
    assert right.chi_square < 1.5 * right.count
    assert right.deviance < wrong.deviance


def test_what_no_reading_tells_makes_predictions_vague_and_not_wrong() -> None:
    # Smooth glass shows its directional lobe within few degrees, which are left out together.
    data = measure(ALL["V-grooves, 1 bounce"], TABLE_I["glass"], np.arange(0.0, 61.0), noise_seed=3)
    own, without = (held_out(data, ALL[name].family) for name in ("V-grooves, 1 bounce", "Hyde"))
    assert own.chi_square < 1.5 * own.count
    assert own.deviance < without.deviance


def test_the_rms_is_that_of_the_dolp() -> None:
    data = measure(ALL["Hyde"], some_surface(ALL["Hyde"], 0), noise_seed=0)
    [found] = compare(data, [ALL["PriestGermer"]])
    assert found.fit is not None
    s0, s1, s2 = data.values.T
    fitted = found.fit.stokes
    deviation = np.sqrt(s1**2 + s2**2) / s0 - np.sqrt(fitted[:, 1] ** 2 + fitted[:, 2] ** 2) / fitted[:, 0]
    assert_allclose(found.dolp_rms, np.sqrt(np.sum(deviation**2) / len(data)), rtol=1e-12)


def test_the_objective_rms_makes_the_rms_as_small_as_it_can_be() -> None:
    data = measure(ALL["Hyde"], some_surface(ALL["Hyde"], 0), noise_seed=0, relative=1e-2)
    by_stokes, by_rms = (compare(data, [ALL["Hyde"]], objective=objective)[0] for objective in ("stokes", "rms"))
    assert by_rms.dolp_rms < by_stokes.dolp_rms
    assert_allclose(by_rms.dolp_rms, by_rms.fit.rms, rtol=1e-9)


def test_the_dolp_is_the_same_whatever_it_is_made_of() -> None:
    stokes = measure(ALL["Hyde"], some_surface(ALL["Hyde"], 0), noise_seed=0)
    s0, s1, s2 = stokes.values.T
    mueller = Elements((0, 4, 8), MUELLER)
    ratios = np.column_stack([s1, s2]) / s0[:, None]
    expected = np.hypot(s1, s2) / s0
    assert_allclose(measured_dolp(stokes).values, expected, rtol=1e-12)
    assert_allclose(measured_dolp(replace(stokes, observable=mueller)).values, expected, rtol=1e-12)
    for observable in (Ratios(), Ratios((4, 8), MUELLER)):
        divided = replace(stokes, values=ratios, covariance=None, observable=observable)
        assert_allclose(measured_dolp(divided).values, expected, rtol=1e-12)
        assert measured_dolp(divided).stderr is None
    assert_allclose(measured_dolp(stokes.compared_by("dolp")).values, expected, rtol=1e-12)
    s0_and_s1 = replace(stokes, values=stokes.values[:, :2], covariance=None, observable=Elements((0, 1)))
    assert measured_dolp(s0_and_s1) is None


def test_the_error_of_the_dolp_is_that_of_its_parts() -> None:
    stokes = measure(ALL["Hyde"], some_surface(ALL["Hyde"], 0), noise_seed=0)
    expected = np.sqrt(stokes.compared_by("dolp").covariance[:, 0, 0])
    assert_allclose(measured_dolp(stokes).stderr, expected, rtol=1e-12)
    assert_allclose(measured_dolp(stokes.compared_by("dolp")).stderr, expected, rtol=1e-12)
    divided = stokes.compared_by("normalised")
    assert_allclose(measured_dolp(divided).stderr, expected, rtol=1e-12)


def test_without_light_there_is_no_dolp() -> None:
    data = measure(ALL["Hyde"], some_surface(ALL["Hyde"], 0), noise_seed=0)
    values = data.values.copy()
    values[3, 0] = -1e-5
    dark = replace(data, values=values)
    assert_array_equal(np.flatnonzero(np.isnan(measured_dolp(dark).values)), [3])
    [found] = compare(dark, [ALL["Hyde"]])
    assert np.isfinite(found.dolp_rms)


@pytest.mark.parametrize("errors_known", [True, False])
def test_data_of_the_dolp_alone_rank_models(errors_known: bool) -> None:
    made = ONE_BOUNCE["Hyde"]
    data = measure(made, {"sigma": 0.3, "n": 1.6, "k": 0.0, "rho_s": 0.8, "rho_d": 0.2}, noise_seed=0)
    dolp = data.compared_by("dolp")
    if not errors_known:
        dolp = replace(dolp, covariance=None)
    models = compare(dolp, [ALL[name] for name in ("PriestGermer", "Baek2018", "Hyde")])
    assert names(models)[0] == "Hyde"
    assert above_best(models, "Hyde") == (0.0, 0.0)
    # Of facets alone ratios tell the index, and neither how rough nor how bright they are.
    facets = models[names(models).index("PriestGermer")]
    assert list(facets.fit.parameters) == ["n", "k"]


def test_what_ratios_do_not_tell_is_left_out() -> None:
    data = measure(ALL["Hyde"], {"sigma": 0.3, "n": 1.6, "k": 0.0, "rho_s": 0.8, "rho_d": 0.2}, noise_seed=0)
    known = lobe_family(
        ("specular",),
        {"sigma": (0.1, 0.5), "n": (1.0, 3.0), "gain": (0.9, 1.1)},
        {"k": 0.0},
        prior={"gain": (1.0, 0.01), "rho_s": (0.8, 0.01)},
    )
    tried = [candidate for candidate in candidates(known) if candidate.name == "Hyde"]
    [found] = compare(data, tried, objective="dolp")
    assert list(found.fit.parameters) == ["sigma", "n", "rho_d"]
    assert_allclose(found.fit.values["rho_d"], 0.25, rtol=0.05)


def test_exact_data_without_errors_prefer_the_simplest_true_model() -> None:
    data = measure(ALL["Hyde"], {"sigma": 0.3, "n": 2.0, "k": 3.0, "rho_s": 0.8, "rho_d": 0.2})
    # Of as many digits as a file may hold.
    exact = replace(data, values=np.round(data.values, 10), covariance=None)
    models = compare(exact, [ALL[name] for name in ("ThreeComponent", "Hyde", "PriestGermer")])
    assert names(models) == ["Hyde", "ThreeComponent", "PriestGermer"]
    assert models[1].aic - models[0].aic < 2.3
    assert models[2].aic - models[0].aic > 1000.0


def test_a_comparison_is_the_same_again_and_in_any_order() -> None:
    data = measure(ALL["Hyde"], some_surface(ALL["Hyde"], 0), noise_seed=0)
    tried = [ALL[name] for name in ("PriestGermer", "Hyde", "Baek2018")]
    once, again = compare(data, tried), compare(data, tried[::-1])
    assert names(once) == names(again)
    assert [model.aic for model in once] == [model.aic for model in again]
    assert [model.held_out for model in once] == [model.held_out for model in again]


def test_a_model_of_dielectrics_is_not_fitted_to_what_is_known_to_absorb() -> None:
    data = measure(ALL["Hyde"], {"sigma": 0.3, "n": 2.0, "k": 3.0, "rho_s": 0.8, "rho_d": 0.2}, noise_seed=0)
    known = lobe_family(("specular",), {"sigma": (0.02, 1.0), "n": (1.0, 6.0)}, {"k": 3.0})
    models = compare(data, candidates(known))
    assert names(models)[-1] == "Baek2018"
    assert models[-1].fit is None
    assert models[-1].refusals == ("It is of dielectrics, and k of this sample is known to be 3 or more.",)
    for model in models[:-1]:
        assert "k" not in model.fit.parameters
        assert 1.0 <= model.fit.values["n"] <= 6.0


def test_a_model_that_data_do_not_determine_says_so_and_comes_last() -> None:
    data = measure(ALL["Hyde"], some_surface(ALL["Hyde"], 0), np.array([20.0]), noise_seed=0)
    models = compare(data.some([0, 0]), [ALL["ThreeComponent"], ALL["Baek2018"]])
    assert all(model.fit is None and model.aic is None for model in models)
    assert all("do not determine" in model.refusals[0] for model in models)


def test_what_is_known_of_the_instrument_holds_for_every_model() -> None:
    known = lobe_family(
        ("specular",),
        {"sigma": (0.1, 0.5), "n": (1.0, 3.0), "gain": (0.9, 1.1)},
        {"k": 0.0, "exit_offset_rad": 0.01},
        prior={"gain": (1.0, 0.01), "n": (1.5, 0.1)},
    )
    for candidate in candidates(known, detector_half_angle_rad=HALF_ANGLE):
        family = candidate.family
        assert family.free["gain"] == (0.9, 1.1)
        assert family.prior == {"gain": (1.0, 0.01), "n": (1.5, 0.1)}
        assert family.fixed["exit_offset_rad"] == 0.01
        assert family.free.get("sigma", (0.1, 0.5)) == (0.1, 0.5)


def test_several_bounces_are_tried_only_if_the_acceptance_is_known() -> None:
    assert "V-grooves, 3 bounces" in ALL
    assert [candidate.name for candidate in candidates()] == list(ONE_BOUNCE)
