"""What a fit can be told: what is compared, what is known, how the instrument errs, how outliers count."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import least_squares
from scipy.stats import chi2

from goniometer.errors import FitError
from model.fit import Dataset, FitResult, SurfaceFamily, fit, lobe_family
from model.fit.bootstrap import bootstrap
from model.fit.observable import MUELLER, Dolp, Elements, Ratios
from model.fit.profile import profile
from model.geometry import in_plane
from model.lobes import Diffuse, Specular
from model.surface import Surface

LOBES = ("specular", "diffuse", "directional")
SHAPES = {"sigma": (0.02, 1.0), "n": (0.5, 6.0), "k": (0.0, 8.0)}
IRON = {"sigma": 0.1764, "n": 2.95, "k": 2.932, "rho_s": 0.7, "rho_d": 0.1, "rho_dd": 0.05}
GLASS = {"sigma": 0.12, "n": 1.525, "rho_s": 0.7, "rho_d": 0.1, "rho_dd": 0.05}
METAL = lobe_family(LOBES, SHAPES)
DIELECTRIC = lobe_family(LOBES, {"sigma": (0.02, 1.0), "n": (1.05, 4.0)}, {"k": 0.0})
EVERY_DEGREE = np.arange(61.0)


def scan(
    truth: dict[str, float], seed: int | None = 1, *, exit_deg=EVERY_DEGREE, relative=1e-3, turned=None, family=METAL
) -> Dataset:
    """A scan at 60°: light of a surface, with `relative` noise, as arms `turned` by (incidence, exit) have it."""
    reported = np.full(len(exit_deg), np.radians(60.0)), np.radians(exit_deg)
    true = [angle + offset for angle, offset in zip(reported, turned or (0.0, 0.0), strict=True)]
    known = {name: value for name, value in truth.items() if name in family.free}
    exit_rad, azimuth_rad = in_plane(true[1])
    stokes = family.surface_of(known).stokes(true[0], exit_rad, azimuth_rad)[:, :3]
    stddev = np.hypot(1e-5, relative * stokes[:, :1]) * np.ones(3)
    if seed is not None:
        stokes = stokes + stddev * np.random.default_rng(seed).standard_normal(stokes.shape)
    exit_rad, azimuth_rad = in_plane(reported[1])
    return Dataset(reported[0], exit_rad, azimuth_rad, stokes, stddev[:, :, None] ** 2 * np.eye(3))


def deviations(result: FitResult, truth: dict[str, float]) -> np.ndarray:
    return np.array([(e.value - truth[name]) / e.stderr for name, e in result.parameters.items() if e.stderr])


@pytest.mark.parametrize("objective", ["stokes", "normalised", "dolp"])
def test_every_objective_finds_the_truth_and_knows_its_error(objective: str) -> None:
    family, truth = DIELECTRIC, GLASS
    scale = 1.0 if objective == "stokes" else truth["rho_s"]
    truth = truth | {name: truth[name] / scale for name in ("rho_s", "rho_d", "rho_dd")}
    off, chi_squares = [], []
    for seed in range(12):
        result = fit(scan(GLASS, seed, family=family), family, objective=objective)
        off.append(deviations(result, truth))
        chi_squares.append(result.chi_square / result.degrees_of_freedom)
        assert ("rho_s" in result.held) == (objective != "stokes")
    assert 0.7 < np.std(off) < 1.3
    assert_allclose(np.mean(chi_squares), 1.0, atol=0.12)


def test_the_rms_objective_is_equation_14() -> None:
    data = scan(GLASS, family=DIELECTRIC)
    result = fit(data, DIELECTRIC, objective="rms")
    light = result.surface.stokes(*data.directions)
    measured = np.hypot(data.values[:, 1], data.values[:, 2]) / data.values[:, 0]
    by_hand = np.sqrt(np.mean((np.hypot(light[:, 1], light[:, 2]) / light[:, 0] - measured) ** 2))
    assert_allclose(result.rms, by_hand, rtol=1e-9)
    assert result.p_value is None
    assert result.columns == ("dolp",)
    # No other surface of the family comes closer.
    for name in ("sigma", "n", "rho_d", "rho_dd"):
        for factor in (0.999, 1.001):
            values = {**result.values, "rho_s": 1.0, name: factor * result.values[name]}
            other = DIELECTRIC.seen(values).stokes(*data.directions)
            assert np.sqrt(np.mean((np.hypot(other[:, 1], other[:, 2]) / other[:, 0] - measured) ** 2)) >= result.rms


def test_mueller_matrices_are_fitted_too() -> None:
    rng = np.random.default_rng(5)
    at = np.full(30, 1.0), rng.uniform(0.1, 1.2, 30), rng.uniform(1.0, 5.0, 30)
    matrices = METAL.seen(IRON).mueller(*at).reshape(-1, 16)
    stddev = 1e-4 * np.abs(matrices).max()
    noisy = matrices + stddev * rng.standard_normal(matrices.shape)
    covariance = np.broadcast_to(stddev**2 * np.eye(16), (30, 16, 16))
    result = fit(Dataset(*at, noisy, covariance, Elements(tuple(range(16)), MUELLER)), METAL)
    assert np.abs(deviations(result, IRON)).max() < 3.5
    assert_allclose(result.stokes, result.surface.stokes(*at)[:, :3], rtol=1e-12, atol=1e-15)
    ratios = noisy[:, 1:] / noisy[:, :1]
    normalised = Dataset(*at, ratios, None, Ratios(tuple(range(1, 16)), MUELLER))
    again = fit(normalised, METAL)
    assert_allclose([again.values[name] for name in ("sigma", "n", "k")], [0.1764, 2.95, 2.932], rtol=0.05)


def test_arms_off_their_zero_bend_the_index_unless_they_are_fitted() -> None:
    turned = np.radians(0.2), np.radians(-0.35)
    data = scan(IRON, turned=turned, relative=1e-4)
    assert np.abs(deviations(fit(data, METAL), IRON)).max() > 20.0
    offsets = dict.fromkeys(("incidence_offset_rad", "exit_offset_rad"), (-0.05, 0.05))
    result = fit(data, lobe_family(LOBES, SHAPES | offsets))
    truth = IRON | dict(zip(offsets, turned, strict=True))
    assert np.abs(deviations(result, truth)).max() < 3.5
    assert result.p_value > 1e-3


def test_analyzer_gain_and_stray_light_are_found() -> None:
    data = scan(IRON, relative=1e-4)
    angle, gain, stray = 0.03, 0.9, 0.004
    turn = np.array([[1, 0, 0], [0, np.cos(2 * angle), np.sin(2 * angle)], [0, -np.sin(2 * angle), np.cos(2 * angle)]])
    values = gain * (data.values + np.array([stray, 0.0, 0.0])) @ turn.T
    data = replace(data, values=values, covariance=gain**2 * turn @ data.covariance @ turn.T)
    nuisances = {"analyzer_offset_rad": (-0.2, 0.2), "gain": (0.5, 2.0), "background_per_sr": (-0.1, 0.1)}
    # The gain is told from the weights by one of them that is known.
    family = lobe_family(LOBES, SHAPES | nuisances, {"rho_s": 0.7})
    result = fit(data, family)
    truth = IRON | {"analyzer_offset_rad": angle, "gain": gain, "background_per_sr": stray}
    assert np.abs(deviations(result, truth)).max() < 3.5
    with pytest.raises(FitError, match=r"do not determine .*gain"):
        fit(data, lobe_family(LOBES, SHAPES | nuisances))


def test_a_prior_is_one_more_reading() -> None:
    few = scan(IRON, exit_deg=np.array([10.0, 30.0, 50.0]), relative=3e-3)
    free = fit(few, METAL)
    known = fit(few, lobe_family(LOBES, SHAPES, prior={"n": (2.95, 0.02)}))
    assert known.degrees_of_freedom == free.degrees_of_freedom + 1
    assert known.parameters["n"].stderr < 0.02 < free.parameters["n"].stderr
    # By hand: information adds.
    place = free.names.index("n")
    told = np.linalg.inv(free.covariance)
    told[place, place] += 1.0 / 0.02**2
    assert_allclose(known.parameters["n"].stderr, np.sqrt(np.linalg.inv(told)[place, place]), rtol=0.3)
    pinned = fit(few, lobe_family(LOBES, SHAPES, prior={"n": (3.1, 1e-6)}))
    assert_allclose(pinned.values["n"], 3.1, rtol=1e-5)


def test_a_tie_holds() -> None:
    family = lobe_family(LOBES, {"sigma": (0.02, 1.0), "n": (0.5, 6.0)}, tied={"k": ("n", 2.932 / 2.95)})
    result = fit(scan(IRON), family)
    assert np.abs(deviations(result, IRON)).max() < 3.5
    assert result.parameters["n"].stderr < fit(scan(IRON), METAL).parameters["n"].stderr


def test_a_bare_surface_stands_for_all_like_it() -> None:
    result = fit(scan(IRON), Surface([Specular(1.0, 0.5, 2.0 + 1.0j), Diffuse(1.0, 0.5)]))
    assert set(result.parameters) == {"sigma", "n", "k", "rho_s", "rho_d"}
    assert result.chi_square > 10.0 * result.degrees_of_freedom  # the directional lobe is missing, and that shows
    assert result.p_value < 1e-9


def test_without_errors_the_scatter_tells_them() -> None:
    data = scan(GLASS, family=DIELECTRIC)
    even = np.full_like(data.covariance, 0.0) + 1e-6 * np.eye(3)
    noise = 1e-3 * np.random.default_rng(3).standard_normal(data.values.shape)
    data = replace(scan(GLASS, None, family=DIELECTRIC), covariance=even)
    noisy = replace(data, values=data.values + noise)
    known, unknown = fit(noisy, DIELECTRIC), fit(replace(noisy, covariance=None), DIELECTRIC)
    scatter = np.sqrt(known.chi_square / known.degrees_of_freedom)
    for name, estimate in unknown.parameters.items():
        assert_allclose(estimate.value, known.values[name], rtol=1e-5)
        assert_allclose(estimate.stderr, known.parameters[name].stderr * scatter, rtol=1e-4)
    assert unknown.p_value is None


def test_outliers_are_listed_and_bend_a_robust_fit_less() -> None:
    clean = scan(IRON)
    values = clean.values.copy()
    values[[20, 41]] *= 1.5
    data = replace(clean, values=values)
    plain, robust, undisturbed = fit(data, METAL), fit(data, METAL, robust=True), fit(clean, METAL)
    assert [outlier.row for outlier in robust.outliers] in ([20, 41], [41, 20])
    assert {20, 41} <= {outlier.row for outlier in plain.outliers}
    assert robust.degrees_of_freedom == plain.degrees_of_freedom  # none is left out
    assert undisturbed.outliers == ()
    off = {name: abs(robust.values[name] - undisturbed.values[name]) for name in IRON}
    assert all(off[name] < 3.0 * undisturbed.parameters[name].stderr for name in IRON)
    assert any(abs(plain.values[n] - undisturbed.values[n]) > 10.0 * undisturbed.parameters[n].stderr for n in IRON)


def test_the_best_fit_is_that_of_scipy_from_the_same_start() -> None:
    for seed in range(5):
        data = scan(IRON, seed, relative=1e-2)
        found = fit(data, METAL)
        names = METAL.names

        def residuals(x: np.ndarray, data=data, names=names) -> np.ndarray:
            stokes = METAL.seen(dict(zip(names, x, strict=True))).stokes(*data.directions)[:, :3]
            return ((stokes - data.values) / np.sqrt(data.covariance.diagonal(axis1=1, axis2=2))).ravel()

        low = [METAL.free[name][0] for name in names]
        high = [min(METAL.free[name][1], 1e3) for name in names]
        start = np.clip([found.values[name] * 1.02 for name in names], np.array(low) + 1e-9, high)
        peer = least_squares(residuals, start, bounds=(low, high), xtol=1e-12, ftol=1e-14, gtol=1e-12)
        assert_allclose(found.chi_square, 2.0 * peer.cost, rtol=1e-9)
        scale = np.array([found.parameters[name].stderr or 1.0 for name in names])
        assert (np.abs([found.values[name] for name in names] - peer.x) / scale).max() < 1e-3


def test_two_optima_are_both_reported() -> None:
    # Without the roughness' help, one exit angle's S0 and S1 leave two indices that fit alike.
    family = SurfaceFamily(
        Surface([Specular(1.0, 0.2, 1.5)]), {"n": (0.2, 6.0)}, {"sigma": 0.2, "rho_s": 1.0, "k": 0.0}
    )
    at = np.array([1.0]), np.array([0.5]), np.array([np.pi])
    stokes = family.seen({"n": 2.0}).stokes(*at)[:, :1]
    data = Dataset(*at, stokes, np.array([[[1e-8]]]), Elements((0,)))
    result = fit(data, family)
    assert_allclose(sorted([result.values["n"], *(other.parameters["n"] for other in result.alternatives)])[-1], 2.0)
    assert len(result.alternatives) == 1
    assert result.alternatives[0].excess < 1e-3


def test_weakness_names_the_combination_and_where_to_measure() -> None:
    few = scan(IRON, exit_deg=np.array([20.0, 40.0]), relative=1e-3, seed=None)
    family = lobe_family(LOBES, SHAPES, {"rho_d": 0.1, "rho_dd": 0.05})
    result = fit(few, family)
    change = np.array([result.weakness.changes[name] for name in result.names])
    # One standard deviation long, and no direction of that length is noticed less.
    told = np.linalg.inv(result.covariance)
    assert_allclose(change @ told @ change, 1.0, rtol=1e-6)
    exit_deg = np.degrees(result.weakness.best_exit_rad)
    more = scan(IRON, exit_deg=np.array([20.0, 40.0, exit_deg]), seed=None)
    elsewhere = scan(IRON, exit_deg=np.array([20.0, 40.0, 30.0]), seed=None)
    assert fit(more, family).condition < fit(elsewhere, family).condition


def test_dolp_zero_everywhere_is_refused() -> None:
    data = scan(GLASS, None, family=DIELECTRIC)
    unpolarized = replace(data, values=data.values * [1.0, 0.0, 0.0])
    with pytest.raises(FitError, match=r"same values|do not determine"):
        fit(unpolarized, DIELECTRIC, objective="dolp")
    with pytest.raises(FitError, match="shows any polarization"):
        fit(unpolarized, DIELECTRIC)
    # With noise in them it is a measurement that no such surface explains, and that is said.
    noise = np.array([0.0, 1e-6, 1e-6]) * np.random.default_rng(0).standard_normal(unpolarized.values.shape)
    assert fit(replace(unpolarized, values=unpolarized.values + noise), DIELECTRIC).p_value < 1e-9


def test_a_dark_row_has_no_ratio() -> None:
    data = scan(GLASS, None, family=DIELECTRIC)
    values = data.values.copy()
    values[7, 0] = 0.0
    with pytest.raises(FitError, match=r"Row 7 .*s0 is not above 0.*Fit with the objective stokes"):
        fit(replace(data, values=values), DIELECTRIC, objective="dolp")
    with pytest.raises(FitError, match="cannot be had"):
        fit(Dataset(*data.directions, data.values[:, :1], None, Elements((0,))), DIELECTRIC, objective="dolp")
    with pytest.raises(ValueError, match="gain is free"):
        fit(data, replace(DIELECTRIC, free={**DIELECTRIC.free, "gain": (0.5, 2.0)}), objective="dolp")


def test_dolp_and_ratios_follow_from_stokes_with_their_errors() -> None:
    data = scan(GLASS, family=DIELECTRIC)
    rng = np.random.default_rng(0)
    root = np.linalg.cholesky(data.covariance)
    many = data.values + np.einsum("nij,bnj->bni", root, rng.standard_normal((20000, 61, 3)))
    bright = data.values[:, 1] > 0.05 * data.values[:, 0]
    dolp = np.hypot(many[..., 1], many[..., 2]) / many[..., 0]
    as_dolp = data.compared_by("dolp")
    assert isinstance(as_dolp.observable, Dolp)
    assert_allclose(np.sqrt(as_dolp.covariance[bright, 0, 0]), dolp.std(axis=0)[bright], rtol=0.03)
    ratios = data.compared_by("normalised")
    samples = many[..., 1:] / many[..., :1]
    assert_allclose(ratios.covariance[:, 0, 0], samples[..., 0].var(axis=0), rtol=0.06)


def test_a_profile_is_the_parabola_of_the_standard_error_where_all_is_well() -> None:
    data = scan(IRON, relative=1e-4)
    result = fit(data, METAL)
    found = profile(data, METAL, result, "n")
    estimate = result.parameters["n"]
    steps = (found.values - estimate.value) / estimate.stderr
    assert_allclose(found.excess, steps**2, rtol=0.1, atol=0.01)
    assert_allclose(found.interval(0.6827), estimate.value + np.array([-1.0, 1.0]) * estimate.stderr, rtol=1e-3)
    with pytest.raises(ValueError, match="no parameter 'alpha'"):
        profile(data, METAL, result, "alpha")


def test_a_profile_ends_at_a_bound() -> None:
    data = scan(GLASS | {"k": 0.0}, relative=1e-3)
    family = lobe_family(LOBES, {"sigma": (0.02, 1.0), "n": (1.05, 4.0), "k": (0.0, 4.0)})
    result = fit(data, family)
    found = profile(data, family, result, "k")
    low, high = found.interval()
    assert low == 0.0
    assert 0.0 < high < 0.5
    assert (found.excess >= -1e-6).all()


def test_the_bootstrap_scatters_by_the_standard_error() -> None:
    data = scan(IRON, relative=1e-4)
    result = fit(data, METAL)
    found = bootstrap(data, METAL, result, count=400, seed=2)
    for name, stderr in found.stderr.items():
        assert_allclose(stderr, result.parameters[name].stderr, rtol=0.15)
        low, high = found.interval(name)
        assert low < result.values[name] < high
    assert_allclose(found.samples, bootstrap(data, METAL, result, count=400, seed=2).samples)


def test_chi_square_and_its_p_value_agree() -> None:
    result = fit(scan(IRON), METAL)
    assert_allclose(result.p_value, chi2.sf(result.chi_square, result.degrees_of_freedom), rtol=1e-9)


def test_profile_and_bootstrap_know_priors_and_data_without_errors() -> None:
    few = scan(IRON, exit_deg=np.array([10.0, 30.0, 50.0]), relative=3e-3)
    family = lobe_family(LOBES, SHAPES, prior={"n": (2.95, 0.02)})
    result = fit(few, family)
    estimate = result.parameters["n"]
    interval = profile(few, family, result, "n").interval(0.6827)
    assert_allclose(interval, estimate.value + np.array([-1.0, 1.0]) * estimate.stderr, atol=0.1 * estimate.stderr)
    even = replace(scan(IRON, None), covariance=None)
    noise = 1e-4 * np.random.default_rng(3).standard_normal(even.values.shape)
    # Five rows and six parameters: of fifteen values nine tell the errors.
    even = replace(even, values=even.values + noise).some(np.arange(0, 61, 13))
    result = fit(even, METAL)
    assert result.degrees_of_freedom == 9
    estimate = result.parameters["sigma"]
    interval = profile(even, METAL, result, "sigma").interval(0.6827)
    assert_allclose(interval, estimate.value + np.array([-1.0, 1.0]) * estimate.stderr, atol=0.1 * estimate.stderr)
    scatter = bootstrap(even, METAL, result, count=600).stderr["sigma"]
    assert_allclose(scatter, estimate.stderr, rtol=0.12)


def test_what_makes_no_sense_is_refused() -> None:
    data = scan(IRON)
    with pytest.raises(FitError, match="no errors"):
        fit(replace(data, covariance=None), METAL, robust=True)
    with pytest.raises(ValueError, match="only in units of another"):
        fit(data, lobe_family(LOBES, SHAPES, prior={"rho_s": (0.7, 0.01)}), objective="dolp")
    with pytest.raises(ValueError, match="only parameters of the surface can be tied"):
        lobe_family(LOBES, SHAPES | {"exit_offset_rad": (-0.1, 0.1)}, tied={"gain": ("n", 1.0)})
    with pytest.raises(ValueError, match="leaves its range"):
        lobe_family(LOBES, SHAPES, tied={"asymmetry": ("n", 0.5)})
    with pytest.raises(FitError, match="shows any polarization"):
        fit(replace(data, values=data.values * [1.0, 0.0, 0.0], covariance=None), METAL)
    unpolarized = scan(IRON)
    diffuse = lobe_family(("diffuse",), {"sigma": (0.02, 1.0)})
    assert fit(replace(unpolarized, values=data.values * [1.0, 0.0, 0.0]), diffuse).values["rho_d"] > 0.0


def test_random_numbers_are_no_surface_and_say_so_without_a_warning() -> None:
    data = scan(IRON)
    random = np.random.default_rng(4)
    for objective in ("stokes", "normalised", "dolp", "rms"):
        values = np.abs(random.standard_normal(data.values.shape)) * [1.0, 0.3, 0.3]
        noise = replace(data, values=values, covariance=np.broadcast_to(1e-4 * np.eye(3), (61, 3, 3)))
        try:
            result = fit(noise, METAL, objective=objective)
        except FitError:
            continue
        assert objective == "rms" or result.p_value < 1e-9
        widths = {name: high - low for name, (low, high) in METAL.free.items() if high < 1e9}
        vague = [
            name for name, e in result.parameters.items() if e.stderr and e.stderr > 1e3 * widths.get(name, np.inf)
        ]
        assert not vague


def test_ratios_of_noise_are_counted_because_they_are_biased() -> None:
    bright, faint = scan(GLASS, family=DIELECTRIC), scan(GLASS, family=DIELECTRIC, relative=0.3)
    family = lobe_family(("specular", "diffuse"), {"n": (1.05, 4.0)}, {"sigma": 0.12, "k": 0.0})
    dolp = fit(faint, family, objective="dolp")
    errors = np.sqrt(np.diagonal(faint.covariance, axis1=1, axis2=2))
    weak = np.hypot(faint.values[:, 1], faint.values[:, 2]) < 4.0 * errors[:, 1]
    assert dolp.biased >= weak.sum() > 10
    ratios = fit(faint, family, objective="normalised")
    assert ratios.biased == (faint.values[:, 0] < 5.0 * errors[:, 0]).sum() > 0
    assert fit(faint, family).biased == 0
    assert fit(bright, family, objective="normalised").biased == 0
    measured = faint.compared_by("dolp")
    assert 0 < fit(measured, family).biased <= dolp.biased
    assert fit(replace(faint, covariance=None), family, objective="dolp").biased == 0


def test_the_degree_of_polarization_of_noise_is_as_biased_as_said() -> None:
    # Where a DoLP is five standard errors its mean is a tenth of one too large (Rice 1945).
    random = np.random.default_rng(0)
    s1, s2 = random.standard_normal((2, 400_000))
    assert_allclose(np.hypot(5.0 + s1, s2).mean() - 5.0, 0.1, rtol=0.05)
