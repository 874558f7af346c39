"""Fits of the four demonstration samples: recovery, honest errors, refusal of data that cannot answer."""

from __future__ import annotations

import json

import numpy as np
import pytest
from numpy.testing import assert_allclose

from goniometer.errors import FitError
from model import materials
from model.fit import Dataset, FitResult, fit, lobe_family
from model.geometry import in_plane

LOBES = ("specular", "diffuse", "directional")
BOUNDS = {"sigma": (0.02, 1.0), "n": (1.0, 6.0), "k": (0.0, 8.0)}
DIELECTRIC = lobe_family(LOBES, {"sigma": BOUNDS["sigma"], "n": BOUNDS["n"]}, {"k": 0.0})
METAL = lobe_family(LOBES, BOUNDS)
WEIGHTS = {"rho_s": 0.7, "rho_d": 0.1, "rho_dd": 0.05}
SAMPLES = {
    "iron": (METAL, {"sigma": 0.1764, "n": 2.95, "k": 2.932, **WEIGHTS}),
    "alumina": (DIELECTRIC, {"sigma": 0.2153, "n": 1.77, **WEIGHTS}),
    "glass": (DIELECTRIC, {"sigma": 0.12, "n": 1.525, **WEIGHTS}),
    "pvc": (DIELECTRIC, {"sigma": 0.3796, "n": 1.545, **WEIGHTS}),
}
EVERY_DEGREE = np.arange(61.0)


def measure(sample: str, noise_seed: int | None = None, exit_deg: np.ndarray = EVERY_DEGREE) -> Dataset:
    """A scan at 60° incidence with 1e-5/sr of read noise and 1e-4 of the signal, or none of it."""
    family, truth = SAMPLES[sample]
    exit_rad, azimuth_rad = in_plane(np.radians(exit_deg))
    incidence_rad = np.full(len(exit_deg), np.radians(60.0))
    stokes = family.seen(truth).stokes(incidence_rad, exit_rad, azimuth_rad)[:, :3]
    stddev = np.hypot(1e-5, 1e-4 * stokes[:, :1])
    # The analyzer's inversion leaves S0 and S1 correlated.
    correlation = np.array([[1.0, 0.3, 0.0], [0.3, 1.0, 0.0], [0.0, 0.0, 1.0]])
    if noise_seed is not None:
        noise = np.random.default_rng(noise_seed).standard_normal(stokes.shape)
        stokes = stokes + stddev * noise @ np.linalg.cholesky(correlation).T
    return Dataset(incidence_rad, exit_rad, azimuth_rad, stokes, stddev[..., None] ** 2 * correlation)


def values(result: FitResult) -> dict[str, float]:
    return {name: estimate.value for name, estimate in result.parameters.items()}


def deviations(result: FitResult, truth: dict[str, float]) -> np.ndarray:
    """How many standard errors each estimate lies from the truth."""
    return np.array([(e.value - truth[name]) / e.stderr for name, e in result.parameters.items()])


@pytest.mark.parametrize("sample", SAMPLES)
def test_noise_free_data_give_the_truth_back(sample: str) -> None:
    family, truth = SAMPLES[sample]
    data = measure(sample)
    result = fit(data, family)
    assert list(result.parameters) == list(truth)
    assert_allclose(list(values(result).values()), list(truth.values()), rtol=1e-8)
    assert_allclose(result.stokes, data.values, rtol=1e-9, atol=1e-12)
    assert result.degrees_of_freedom == 183 - len(truth)


@pytest.mark.parametrize("sample", SAMPLES)
def test_with_noise_the_truth_is_within_three_standard_errors(sample: str) -> None:
    family, truth = SAMPLES[sample]
    result = fit(measure(sample, noise_seed=1), family)
    assert np.abs(deviations(result, truth)).max() < 3.0
    assert 0.7 < result.chi_square / result.degrees_of_freedom < 1.3


def test_intervals_cover_the_truth() -> None:
    inside = [
        np.abs(deviations(fit(measure(sample, noise_seed=seed), family), truth)) < 1.96
        for sample, (family, truth) in SAMPLES.items()
        for seed in range(8)
    ]
    assert 0.88 < np.concatenate(inside).mean() < 1.0


@pytest.mark.long
@pytest.mark.parametrize("sample", SAMPLES)
def test_intervals_cover_the_truth_in_100_scans(sample: str) -> None:
    family, truth = SAMPLES[sample]
    results = [fit(measure(sample, noise_seed=1000 + seed), family) for seed in range(100)]
    covered = np.mean([np.abs(deviations(result, truth)) < 1.96 for result in results], axis=0)
    assert ((covered >= 0.90) & (covered <= 0.99)).all(), dict(zip(truth, covered, strict=True))
    chi_square = np.mean([result.chi_square for result in results])
    assert_allclose(chi_square, results[0].degrees_of_freedom, rtol=0.05)


@pytest.mark.parametrize("sample", SAMPLES)
def test_a_warm_start_and_the_genetic_search_end_where_sobol_does(sample: str) -> None:
    family, _ = SAMPLES[sample]
    data = measure(sample, noise_seed=2)
    cold = fit(data, family)
    scale = np.array([estimate.stderr for estimate in cold.parameters.values()])
    nearby = values(fit(measure(sample, noise_seed=3), family))
    for other in (fit(data, family, start=nearby), fit(data, family, search="genetic"), fit(data, family, seed=5)):
        distance = (np.array(list(values(other).values())) - list(values(cold).values())) / scale
        assert np.abs(distance).max() < 1e-3


@pytest.mark.parametrize("name", ["Fe", "Cr", "Cu", "Au", "Al"])
def test_finds_every_metal_in_wide_bounds(name: str) -> None:
    # n and k trade off along a curved valley: a search from one poor start ends in the wrong place.
    family = lobe_family(LOBES, {"sigma": (0.02, 1.0), "n": (0.1, 6.0), "k": (0.0, 8.0)})
    index = materials.index(name, 550)
    truth = {"sigma": 0.3, "n": index.real, "k": index.imag, **WEIGHTS}
    exit_rad, azimuth_rad = in_plane(np.radians(EVERY_DEGREE))
    incidence_rad = np.full(len(EVERY_DEGREE), np.radians(60.0))
    stokes = family.seen(truth).stokes(incidence_rad, exit_rad, azimuth_rad)[:, :3]
    covariance = 1e-10 * np.broadcast_to(np.eye(3), (len(EVERY_DEGREE), 3, 3))
    result = fit(Dataset(incidence_rad, exit_rad, azimuth_rad, stokes, covariance), family)
    assert_allclose(list(values(result).values()), list(truth.values()), rtol=1e-8)


def test_standard_errors_are_those_of_the_linearised_problem() -> None:
    # Independent route: chi-square over all parameters at once, differentiated numerically in physical units.
    family, truth = SAMPLES["glass"]
    data = measure("glass")
    result = fit(data, family)
    whitener = np.linalg.inv(np.linalg.cholesky(data.covariance))

    def model(parameters: np.ndarray) -> np.ndarray:
        surface = family.seen(dict(zip(truth, parameters, strict=True)))
        stokes = surface.stokes(data.incidence_rad, data.exit_rad, data.azimuth_rad)[:, :3]
        return (whitener @ stokes[..., None]).ravel()

    best = np.array(list(truth.values()))
    steps = np.diag(1e-5 * best)
    columns = [(model(best + step) - model(best - step)) / (2.0 * step.sum()) for step in steps]
    covariance = np.linalg.inv(np.array(columns) @ np.transpose(columns))
    stderr = np.sqrt(np.diag(covariance))
    assert_allclose([e.stderr for e in result.parameters.values()], stderr, rtol=1e-5)
    assert_allclose(result.correlation, covariance / np.outer(stderr, stderr), rtol=1e-4, atol=1e-4)


def test_a_lobe_that_the_data_do_not_see_stays_at_zero() -> None:
    # Beyond 20° the directional lobe of smooth glass is far below the smallest number that matters.
    family, truth = SAMPLES["glass"]
    result = fit(measure("glass", noise_seed=1, exit_deg=np.arange(20.0, 61.0)), family)
    assert result.parameters["rho_dd"].value == 0.0
    assert result.parameters["rho_dd"].at_bound
    assert result.parameters["rho_dd"].stderr is None
    assert "rho_dd" not in result.names
    assert_allclose(result.parameters["sigma"].value, truth["sigma"], rtol=1e-3)


def test_a_parameter_at_its_bound_has_no_standard_error() -> None:
    family = lobe_family(LOBES, {"sigma": BOUNDS["sigma"], "n": (1.6, 3.0)}, {"k": 0.0})
    result = fit(measure("glass"), family)
    assert_allclose(result.parameters["n"].value, 1.6, rtol=1e-5)
    assert result.parameters["n"].at_bound
    assert result.correlation.shape == (len(result.names), len(result.names))
    # A live fit starts from where the last one ended, be it at a bound.
    again = fit(measure("glass"), family, start=values(result))
    assert_allclose(again.chi_square, result.chi_square, rtol=1e-6)


def test_fits_weights_alone_when_the_rest_is_known() -> None:
    _, truth = SAMPLES["pvc"]
    family = lobe_family(LOBES, {}, {"sigma": truth["sigma"], "n": truth["n"], "k": 0.0})
    assert_allclose(list(values(fit(measure("pvc"), family)).values()), list(WEIGHTS.values()), rtol=1e-10)


def test_the_result_is_plain_and_describes_itself() -> None:
    result = fit(measure("iron", noise_seed=1), METAL)
    plain = json.loads(json.dumps(result.to_dict()))
    assert set(plain["parameters"]["n"]) == {"value", "stderr", "at_bound"}
    assert "Specular lobe" in plain["description"]
    assert "One reflection" in plain["description"]
    assert_allclose(np.diag(plain["correlation"]), 1.0)


def test_too_few_values_are_refused() -> None:
    with pytest.raises(FitError, match=r"3 values \(1 directions\) cannot determine 6 parameters"):
        fit(measure("iron", exit_deg=np.array([30.0])), METAL)


def test_parameters_that_data_do_not_tell_apart_are_refused() -> None:
    # One direction measured again and again: enough values, one piece of information.
    with pytest.raises(FitError, match=r"data do not determine|hardly tell"):
        fit(measure("glass", noise_seed=1, exit_deg=np.full(10, 30.0)), DIELECTRIC)


def test_darkness_is_refused() -> None:
    data = measure("glass")
    dark = Dataset(data.incidence_rad, data.exit_rad, data.azimuth_rad, 0.0 * data.values, data.covariance)
    with pytest.raises(FitError, match=r"All 61 rows .* hold the same values"):
        fit(dark, DIELECTRIC)


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        ({"values": np.nan}, r"Row 7 .*exit 7°.*s0 is not a finite number"),
        ({"covariance": np.inf}, "Row 7 .*covariance is not a finite number"),
        ({"exit_rad": np.pi / 2.0}, "Row 7 .*the exit angle is not from 0 to below 90°"),
        ({"covariance": 0.0}, "Row 7 .*covariance is not positive definite"),
    ],
)
def test_a_bad_row_is_named(spoil: dict[str, float], message: str) -> None:
    data = measure("glass")
    fields = {
        name: np.array(getattr(data, name))
        for name in ("incidence_rad", "exit_rad", "azimuth_rad", "values", "covariance")
    }
    for name, value in spoil.items():
        fields[name][7] = value
    with pytest.raises(FitError, match=message):
        Dataset(**fields)


def test_wrong_shapes_are_refused() -> None:
    with pytest.raises(FitError, match=r"exit_rad has shape \(1,\); 2 rows of data need \(2,\)"):
        Dataset(np.zeros(2), np.zeros(1), np.zeros(2), np.ones((2, 3)), np.stack([np.eye(3)] * 2))
    with pytest.raises(FitError, match="no row"):
        Dataset(np.zeros(0), np.zeros(0), np.zeros(0), np.zeros((0, 3)), np.zeros((0, 3, 3)))


@pytest.mark.parametrize(
    ("lobes", "free", "fixed", "message"),
    [
        (("mirror",), {}, {}, "name one or more of"),
        (("diffuse", "diffuse"), {"sigma": (0.1, 1.0)}, {}, "each once"),
        (("specular",), {"sigma": (0.1, 1.0), "n": (1.0, 2.0)}, {}, "exactly once"),
        (("diffuse",), {"sigma": (0.1, 1.0), "n": (1.0, 2.0)}, {}, "and no other"),
        (("diffuse",), {"sigma": (0.1, 1.0)}, {"sigma": 0.2}, "must stand in one of them"),
        (("diffuse",), {"sigma": (0.0, 1.0)}, {}, "lies from 1e-05 to 100000"),
        (("diffuse",), {"sigma": (1.0, 0.1)}, {}, "must increase"),
        (("diffuse",), {}, {"sigma": -1.0}, "fixed sigma is -1"),
    ],
)
def test_impossible_families_are_refused(lobes, free, fixed, message) -> None:
    with pytest.raises(ValueError, match=message):
        lobe_family(lobes, free, fixed)


def test_a_start_outside_the_bounds_and_an_unknown_search_are_refused() -> None:
    data = measure("glass")
    with pytest.raises(ValueError, match="start has n = 7"):
        fit(data, DIELECTRIC, start={"sigma": 0.1, "n": 7.0})
    with pytest.raises(ValueError, match="start has n = None"):
        fit(data, DIELECTRIC, start={"sigma": 0.1})
    with pytest.raises(ValueError, match="search is 'luck'"):
        fit(data, DIELECTRIC, search="luck")
    with pytest.raises(ValueError, match="needs a value for rho_dd"):
        DIELECTRIC.surface_of({"sigma": 0.1, "n": 1.5, "rho_s": 1.0, "rho_d": 0.0})
