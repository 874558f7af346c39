"""Many pixels fitted at once: the same answers as one by one, whatever is dead, missing or out of the ordinary."""

from __future__ import annotations

import multiprocessing
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.optimize import least_squares

from goniometer.errors import FitError
from model.fit import Dataset, SurfaceFamily, fit, lobe_family
from model.fit.family import whole_family
from model.fit.observable import MUELLER, Dolp, Elements, Observable
from model.fit.problem import Problem
from model.fit.start import projected
from model.geometry import FloatArray, in_plane
from model.lobes import Diffuse, Specular
from model.many_fits import fit_many as image_fits
from model.many_fits import pixel_fits
from model.many_fits.compiled_problem import CompiledProblem
from model.many_fits.fit_many import ManyFits, Status, fit_many
from model.many_fits.pixels import inverse_root
from model.many_fits.shared_light import SharedLight
from model.surface import Surface

LOBES = ("specular", "diffuse", "directional")
FREE = {"sigma": (0.02, 1.0), "n": (1.0, 6.0), "k": (0.0, 8.0)}
METAL = lobe_family(LOBES, FREE)
WIDE = lobe_family(LOBES, {**FREE, "n": (0.1, 6.0)})
NARROW = lobe_family(LOBES, {**FREE, "n": (1.8, 2.9)})
IRON, GLASS = (0.1764, 2.95, 2.932, 0.7, 0.1, 0.05), (0.15, 1.525, 0.0, 0.7, 0.1, 0.05)
LOSSY = (0.2, 1.7, 0.8, 0.6, 0.1, 0.05)
INCIDENCE_RAD = np.full(31, np.radians(60.0))
DIRECTIONS = (INCIDENCE_RAD, *in_plane(np.radians(np.arange(0.0, 61.0, 2.0))))
NOISE = 1e-3


def image(
    count: int,
    *materials: tuple[float, ...],
    seed: int = 0,
    family: SurfaceFamily = METAL,
    directions: tuple[FloatArray, ...] = DIRECTIONS,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Pixels of some materials, each a little different: their parameters, values with noise, and standard errors."""
    random = np.random.default_rng(seed)
    x = np.array(materials)[np.arange(count) % len(materials)] * random.uniform(0.9, 1.1, (count, 6))
    values = light(x, family, directions)
    stderr = np.broadcast_to(np.hypot(1e-5, NOISE * values[..., :1]), values.shape)
    return x, values + stderr * random.standard_normal(values.shape), stderr


def unlike(count: int, noise: float, seed: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Pixels of iron, gold, glass and PVC of any roughness, as `image` gives them."""
    random = np.random.default_rng(seed)
    index = np.array([(2.95, 2.932), (0.18, 3.4), (1.525, 0.0), (1.54, 0.0)])[np.arange(count) % 4]
    weights = random.uniform([0.5, 0.02, 0.0], [0.9, 0.3, 0.1], (count, 3))
    sigma = random.uniform(0.05, 0.6, (count, 1))
    x = np.column_stack([sigma, index * random.uniform(0.95, 1.05, (count, 2)), weights])
    values = light(x, WIDE)
    stderr = np.broadcast_to(np.hypot(1e-5, noise * values[..., :1]), values.shape)
    return x, values + stderr * random.standard_normal(values.shape), stderr


def light(
    x: FloatArray,
    family: SurfaceFamily = METAL,
    directions: tuple[FloatArray, ...] = DIRECTIONS,
    observable: Observable = Elements(),  # noqa: B008
) -> FloatArray:
    size, width = directions[0].shape[-1], len(observable.columns)
    nothing = np.zeros((len(x), width, size)), np.zeros((1, width, width, size))
    return Problem(family, observable, directions, *nothing).light(x, np.arange(len(x)))[0].transpose(0, 2, 1)


def one_by_one(
    values: FloatArray, stderr: FloatArray | None, family: SurfaceFamily = METAL, **choices: object
) -> ManyFits:
    results = []
    for pixel, own in enumerate(values):
        covariance = None if stderr is None else stderr[pixel][..., None] ** 2 * np.eye(own.shape[1])
        results.append(fit(Dataset(*DIRECTIONS, own, covariance, **choices), family))
    estimates = [list(result.parameters.values()) for result in results]
    return ManyFits(
        family.names,
        np.array([[one.value for one in row] for row in estimates]),
        np.array([[np.nan if one.stderr is None else one.stderr for one in row] for row in estimates]),
        np.array([[one.at_bound for one in row] for row in estimates]),
        np.array([result.chi_square for result in results]),
        np.array([result.degrees_of_freedom for result in results]),
        np.zeros(len(values), np.int64),
    )


def assert_same(one: ManyFits, other: ManyFits) -> None:
    assert_array_equal(one.status, other.status)
    assert_array_equal(one.at_bound, other.at_bound)
    assert_array_equal(one.degrees_of_freedom, other.degrees_of_freedom)
    assert_allclose(one.parameters, other.parameters, rtol=1e-6, atol=1e-9)
    assert_allclose(one.stderr, other.stderr, rtol=1e-4)


@pytest.mark.parametrize("family", [METAL, NARROW], ids=["within", "at a bound"])
def test_many_are_the_same_as_one_by_one(family: SurfaceFamily) -> None:
    _, values, stderr = image(24, IRON, LOSSY)
    together, apart = fit_many(DIRECTIONS, values, family, stderr=stderr), one_by_one(values, stderr, family)
    assert together.at_bound.any() == (family is NARROW)
    assert together.settled.all()
    assert_same(together, apart)
    assert_allclose(together.chi_square, apart.chi_square, rtol=1e-9)


def test_at_k_0_many_are_as_good_as_one_by_one() -> None:
    # Two optima lie there closer together than their errors, and either may be found.
    _, values, stderr = image(40, GLASS)
    together, apart = fit_many(DIRECTIONS, values, METAL, stderr=stderr), one_by_one(values, stderr)
    assert together.at_bound[:, 2].any()
    assert (together.chi_square < apart.chi_square + 1e-2).all()
    assert (together.at_bound | (together.stderr < 8.0)).all()
    # No slope leads away from k = 0, but a start there is none to stay at.
    started = fit_many(DIRECTIONS, values, METAL, stderr=stderr, start=np.array(GLASS))
    assert (started.chi_square < together.chi_square + 1e-2).all()


def test_the_answers_are_those_of_scipys_least_squares() -> None:
    x, values, stderr = image(6, IRON)
    found = fit_many(DIRECTIONS, values, METAL, stderr=stderr).parameters
    low, high = np.transpose([METAL.free[name] for name in METAL.names])
    for pixel in range(6):
        expected = least_squares(
            lambda at, pixel=pixel: ((light(at[None])[0] - values[pixel]) / stderr[pixel]).ravel(),
            x[pixel],
            bounds=(low, high),
            x_scale=x[pixel],
            jac="3-point",
            ftol=1e-14,
            xtol=1e-14,
            gtol=1e-14,
        )
        assert_allclose(found[pixel], expected.x, rtol=1e-6)


def test_errors_cover_the_truth() -> None:
    x, values, stderr = image(400, IRON)
    result = fit_many(DIRECTIONS, values, METAL, stderr=stderr)
    covered = (np.abs(result.parameters - x) < 1.96 * result.stderr).mean(axis=0)
    assert ((covered > 0.92) & (covered < 0.98)).all(), covered
    assert_allclose(result.chi_square.mean(), result.degrees_of_freedom[0], rtol=0.02)


def test_without_errors_the_scatter_tells_them() -> None:
    _, values, _ = image(8, IRON)
    together, apart = fit_many(DIRECTIONS, values, METAL), one_by_one(values, None)
    assert_same(together, apart)
    left = (light(together.parameters) - values).reshape(8, -1)
    assert_allclose(together.chi_square, (left * left).sum(axis=1), rtol=1e-8)


@pytest.mark.parametrize("shared", [True, False])
def test_correlated_errors_count(shared: bool) -> None:
    _, values, stderr = image(5, IRON)
    correlation = np.array([[1.0, 0.5, 0.0], [0.5, 1.0, 0.2], [0.0, 0.2, 1.0]])
    covariance = (stderr[..., None] * stderr[..., None, :]) * correlation
    covariance = covariance[:1] if shared else covariance
    together = fit_many(DIRECTIONS, values, METAL, covariance=covariance[0] if shared else covariance)
    for pixel in range(5):
        alone = fit(Dataset(*DIRECTIONS, values[pixel], covariance[0 if shared else pixel]), METAL)
        assert_allclose(together.parameters[pixel], list(alone.values.values()), rtol=1e-6)
        assert_allclose(together.chi_square[pixel], alone.chi_square, rtol=1e-9)


def test_parts_do_not_change_the_result(monkeypatch: pytest.MonkeyPatch) -> None:
    _, values, stderr = image(40, IRON, LOSSY)
    whole = fit_many(DIRECTIONS, values, METAL, stderr=stderr)
    monkeypatch.setattr(pixel_fits, "_AT_ONCE", 7)
    assert_same(fit_many(DIRECTIONS, values, METAL, stderr=stderr), whole)


def test_neither_order_nor_parts_change_the_result(monkeypatch: pytest.MonkeyPatch) -> None:
    _, values, stderr = unlike(160, 3e-2, seed=4)
    stderr = stderr * np.random.default_rng(0).uniform(1.0, 30.0, (160, 1, 1))
    measured = np.ones((160, 31), bool)
    measured[::3, :5], measured[1::3, 20:] = False, False
    whole = fit_many(DIRECTIONS, values, WIDE, stderr=stderr, measured=measured)
    order = np.random.default_rng(1).permutation(160)
    monkeypatch.setattr(image_fits, "_PART", 16)
    monkeypatch.setattr(pixel_fits, "_AT_ONCE", 7)
    with ThreadPoolExecutor(1) as executor:
        shuffled = fit_many(
            DIRECTIONS,
            values[order],
            WIDE,
            stderr=stderr[order],
            measured=measured[order],
            executor=executor,
        )
    assert_array_equal(shuffled.status, whole.status[order])
    assert_allclose(shuffled.chi_square, whole.chi_square[order], rtol=1e-6)


def test_the_best_optimum_is_found_whatever_the_seed() -> None:
    _, values, stderr = unlike(240, 1e-2, seed=0)
    _, noisy, noisy_stderr = unlike(240, 3e-2, seed=1)
    values, stderr = np.concatenate([values, noisy]), np.concatenate([stderr, noisy_stderr])
    chi_square = np.array([fit_many(DIRECTIONS, values, WIDE, stderr=stderr, seed=s).chi_square for s in range(5)])
    assert (chi_square - chi_square.min(axis=0) < 0.01).mean() >= 0.993


def test_other_processes_give_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    _, values, stderr = image(20, IRON, LOSSY)
    values[3] = 0.0
    start = fit_many(DIRECTIONS, values, METAL, stderr=stderr).parameters
    own = tuple(np.broadcast_to(angle, (20, 31)) for angle in DIRECTIONS)
    measured = np.arange(31) + np.arange(20)[:, None] > 3
    monkeypatch.setattr(image_fits, "_PART", 8)
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as executor:
        for directions, given in (
            (DIRECTIONS, {"stderr": stderr}),
            (own, {"stderr": stderr, "measured": measured, "start": start}),
            (DIRECTIONS, {"covariance": stderr[..., None] ** 2 * np.eye(3), "start": np.array(IRON)}),
            (DIRECTIONS, {"stderr": stderr[0]}),
        ):
            apart = fit_many(directions, values, METAL, **given, executor=executor)
            assert_same(apart, fit_many(directions, values, METAL, **given))
            assert apart.status[3] == Status.ONE_VALUE


def test_a_part_counts_pixels_from_the_first_of_all(monkeypatch: pytest.MonkeyPatch) -> None:
    _, values, stderr = image(12, IRON)
    covariance = stderr[..., None] ** 2 * np.eye(3)
    covariance[10, 5] = -np.eye(3)
    monkeypatch.setattr(image_fits, "_PART", 4)
    with (
        ThreadPoolExecutor(1) as executor,
        pytest.raises(FitError, match="Row 5 of pixel 10: the covariance is not positive definite"),
    ):
        fit_many(DIRECTIONS, values, METAL, covariance=covariance, executor=executor)


def test_what_is_not_measured_does_not_count() -> None:
    _, values, stderr = image(6, IRON)
    values, stderr = values.copy(), stderr.copy()
    measured = np.ones((6, 31), bool)
    measured[0], measured[1, 28:], measured[2, ::3], measured[3, ::3] = True, False, False, False
    values[~measured], stderr[~measured] = np.nan, np.nan
    together = fit_many(DIRECTIONS, values, METAL, stderr=stderr, measured=measured)
    for pixel in range(6):
        rows = measured[pixel]
        some = tuple(angle[rows] for angle in DIRECTIONS)
        alone = fit(Dataset(*some, values[pixel, rows], stderr[pixel, rows, None] ** 2 * np.eye(3)), METAL)
        assert_allclose(together.parameters[pixel], list(alone.values.values()), rtol=1e-6)
        assert_allclose(together.stderr[pixel], [one.stderr for one in alone.parameters.values()], rtol=1e-5)
        assert together.degrees_of_freedom[pixel] == alone.degrees_of_freedom


def test_what_has_no_answer_gets_none_and_harms_no_other() -> None:
    _, values, stderr = image(8, IRON)
    values = values.copy()
    measured = np.ones((8, 31), bool)
    measured[1], measured[2, 1:] = False, False
    values[3], values[4], values[5, 1:], measured[5, 0] = 0.0, 65535.0, 0.25, False
    values[6, :, 1:] = 0.0
    result = fit_many(DIRECTIONS, values, METAL, stderr=stderr, measured=measured)
    expected = [Status.FITTED, Status.TOO_FEW, Status.TOO_FEW, *[Status.ONE_VALUE] * 3, Status.UNPOLARIZED]
    assert_array_equal(result.status, [*expected, Status.FITTED])
    assert_array_equal(result.settled, result.status == 0)
    lost = ~result.settled
    for array in (result.parameters, result.stderr, result.chi_square):
        assert np.isnan(array[lost]).all()
    assert not result.at_bound[lost].any()
    good = fit_many(DIRECTIONS, values[[0, 7]], METAL, stderr=stderr[[0, 7]])
    assert_allclose(result.parameters[[0, 7]], good.parameters, rtol=1e-6)


@pytest.mark.parametrize("observable", [Elements(), Elements((0, 1))])
def test_without_any_polarization_only_the_index_has_no_answer(observable: Elements) -> None:
    x, _, _ = image(4, IRON)
    values = light(x, observable=observable)
    values[1, :, 1:] = 0.0
    values[2, 3:, 1:], measured = 0.0, np.ones((4, 31), bool)
    measured[2, :3] = False
    result = fit_many(DIRECTIONS, values, METAL, measured=measured, observable=observable)
    assert_array_equal(result.status[1:3], Status.UNPOLARIZED)
    assert_array_equal(result.settled, [True, False, False, True])
    known = lobe_family(("specular", "diffuse"), {"sigma": FREE["sigma"]}, {"n": 2.0, "k": 1.0})
    assert fit_many(DIRECTIONS, values, known, measured=measured, observable=observable).settled.all()


def test_polarization_within_its_errors_meets_the_same_fate_as_one_by_one() -> None:
    values, stderr = np.zeros((12, 31, 3)), np.full((12, 31, 3), 1e-3)
    values[:6, :, 0], values[6:, :, 0] = 0.1 / np.pi, 0.3 * np.cos(DIRECTIONS[1])
    values += stderr * np.random.default_rng(0).standard_normal(values.shape)
    together = fit_many(DIRECTIONS, values, METAL, stderr=stderr)
    assert_array_equal(np.unique(together.status), [Status.FITTED, Status.UNDETERMINED])
    for pixel in range(12):
        data = Dataset(*DIRECTIONS, values[pixel], stderr[pixel, :, None] ** 2 * np.eye(3))
        if together.settled[pixel]:
            found = fit(data, METAL)
            assert together.chi_square[pixel] <= found.chi_square + 1e-2
            assert np.isnan(together.stderr[pixel, 1:3]).any()  # open, or at a bound
        else:
            with pytest.raises(FitError, match="do not determine"):
                fit(data, METAL)


def test_nothing_to_fit_is_no_error() -> None:
    result = fit_many(DIRECTIONS, np.zeros((3, 31, 3)), METAL)
    assert_array_equal(result.status, Status.ONE_VALUE)
    assert len(fit_many(DIRECTIONS, np.zeros((0, 31, 3)), METAL).status) == 0


def test_parameters_that_data_do_not_tell_apart_get_no_number() -> None:
    # One direction again and again: enough values, one piece of information.
    again = tuple(np.full(20, angle[15]) for angle in DIRECTIONS)
    _, values, stderr = image(5, IRON, directions=again)
    result = fit_many(again, values, METAL, stderr=stderr)
    assert set(result.status.tolist()) <= {Status.UNDETERMINED, Status.NOT_SETTLED}
    assert np.isnan(result.parameters).all()


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        ({"values": np.nan}, "Row 7 of 2 of 4 pixels, the first of them 1: a value is not a finite number.*measured"),
        ({"stderr": 0.0}, "Row 7 of 2 of 4 pixels, the first of them 1: stderr is not a finite number above 0"),
        ({"stderr": np.inf}, "stderr is not a finite number above 0"),
    ],
)
def test_a_bad_value_is_named(spoil: dict[str, float], message: str) -> None:
    _, values, stderr = image(4, IRON)
    given = {"values": values.copy(), "stderr": stderr.copy()}
    for name, value in spoil.items():
        given[name][[1, 3], 7] = value
    with pytest.raises(FitError, match=message):
        fit_many(DIRECTIONS, given["values"], METAL, stderr=given["stderr"])


def test_an_impossible_covariance_is_named() -> None:
    _, values, stderr = image(4, IRON)
    covariance = stderr[..., None] ** 2 * np.eye(3)
    values[:2] = 0.0  # pixels without an answer do not change the others' numbers
    covariance[2, 5] = -np.eye(3)
    with pytest.raises(FitError, match="Row 5 of pixel 2: the covariance is not positive definite"):
        fit_many(DIRECTIONS, values, METAL, covariance=covariance)
    covariance[2, 5] = np.nan
    with pytest.raises(FitError, match="Row 5 of 1 of 4 pixels, the first of them 2: the covariance is not finite"):
        fit_many(DIRECTIONS, values, METAL, covariance=covariance)


@pytest.mark.parametrize("entry", [(0, 1), (2, 0)])
def test_an_asymmetric_covariance_is_refused_as_by_the_fit_of_one(entry: tuple[int, int]) -> None:
    _, values, stderr = image(4, IRON)
    covariance = stderr[..., None] ** 2 * np.eye(3)
    covariance[2, 5][entry] = 0.1 * covariance[2, 5, 0, 0]
    with pytest.raises(FitError, match="the covariance is not symmetric"):
        Dataset(*DIRECTIONS, values[2], covariance[2])
    message = "Row 5 of 1 of 4 pixels, the first of them 2: the covariance is not symmetric"
    with pytest.raises(FitError, match=message):
        fit_many(DIRECTIONS, values, METAL, covariance=covariance)
    with pytest.raises(FitError, match="Row 5 of all pixels: the covariance is not symmetric"):
        fit_many(DIRECTIONS, values, METAL, covariance=covariance[2])
    measured = np.ones((4, 31), bool)
    measured[2, 5] = False
    assert fit_many(DIRECTIONS, values, METAL, covariance=covariance, measured=measured).settled.all()
    covariance[2, 5][entry] = 1e-12 * covariance[2, 5, 0, 0]  # of rounding
    assert fit_many(DIRECTIONS, values, METAL, covariance=covariance).settled.all()


def test_priors_without_errors_are_refused_as_by_the_fit_of_one() -> None:
    _, values, _ = image(4, IRON)
    family = lobe_family(LOBES, FREE, prior={"n": (3.0, 0.1)})
    with pytest.raises(FitError, match="cannot be weighed"):
        fit(Dataset(*DIRECTIONS, values[0]), family)
    with pytest.raises(FitError, match=r"What is known of n beforehand cannot be weighed .* Nothing was fitted"):
        fit_many(DIRECTIONS, values, family)


def test_wrong_shapes_and_choices_are_refused() -> None:
    _, values, stderr = image(4, IRON)
    for given, message in (
        ({"stderr": stderr[:2]}, r"stderr has shape \(2, 31, 3\); it needs \(31, 3\) or"),
        ({"measured": np.ones(5, bool)}, r"measured has shape \(5,\)"),
        ({"stderr": stderr, "covariance": np.ones((31, 3, 3))}, "both covariance and stderr are given"),
        ({"start": np.ones(5)}, r"start has shape \(1, 5\); it needs \(6,\) or \(4, 6\), for sigma, n, k"),
        ({"start": np.array([0.2, 9.0, 1.0, 1.0, 1.0, 1.0])}, "start has n = 9 for pixel 0; it needs .* from 1 to 6"),
        ({"observable": Dolp()}, r"values has shape \(4, 31, 3\); it needs \(4, 31, 1\)"),
    ):
        with pytest.raises(ValueError, match=message):
            fit_many(DIRECTIONS, values, METAL, **given)
    with pytest.raises(ValueError, match=r"incidence_rad holds 1\.6 rad"):
        fit_many((np.full(31, 1.6), *DIRECTIONS[1:]), values, METAL)
    with pytest.raises(ValueError, match=r"dolp do not say how much light .*holding\('rho_s', 1.0\)"):
        fit_many(DIRECTIONS, values[..., :1], METAL, observable=Dolp())


def test_the_mirror_direction_of_several_bounces_is_refused() -> None:
    family = lobe_family(LOBES, FREE, bounces=2)
    with pytest.raises(ValueError, match="is the mirror direction itself"):
        fit_many(DIRECTIONS, np.zeros((1, 31, 3)), family)


def test_a_start_takes_the_place_of_the_search() -> None:
    x, values, stderr = image(30, IRON, LOSSY)
    searched = fit_many(DIRECTIONS, values, METAL, stderr=stderr)
    start = np.clip(x * 1.05, *np.transpose([METAL.free[name] for name in METAL.names]))
    start[4] = np.nan
    assert_same(fit_many(DIRECTIONS, values, METAL, stderr=stderr, start=start), searched)
    assert_same(fit_many(DIRECTIONS, values, METAL, stderr=stderr, start=np.array(IRON)), searched)


def test_unrelated_pixels_are_found_too() -> None:
    random = np.random.default_rng(3)
    low, high = [0.05, 0.15, 0.0, 0.5, 0.05, 0.02], [0.6, 5.0, 6.0, 0.9, 0.2, 0.1]
    x = random.uniform(low, high, (400, 6))
    values = light(x, WIDE)
    stderr = np.hypot(1e-5, NOISE * values[..., :1]) * np.ones(3)
    values += stderr * random.standard_normal(values.shape)
    result = fit_many(DIRECTIONS, values, WIDE, stderr=stderr)
    at_truth = (((light(x, WIDE) - values) / stderr) ** 2).sum(axis=(1, 2))
    assert (result.chi_square <= at_truth + 1e-6).mean() >= 0.99


def test_pixels_may_have_directions_of_their_own() -> None:
    incidence, exits, azimuth = DIRECTIONS[0], DIRECTIONS[1] + np.radians([[0.0], [1.0], [2.0], [3.0]]), DIRECTIONS[2]
    own = tuple(np.broadcast_to(angle, (4, 31)) for angle in (incidence, exits, azimuth))
    _, values, stderr = image(4, IRON, directions=own)
    result = fit_many((incidence, exits, azimuth), values, METAL, stderr=stderr)
    for pixel in range(4):
        covariance = stderr[pixel, :, None] ** 2 * np.eye(3)
        alone = fit(Dataset(*(angle[pixel] for angle in own), values[pixel], covariance), METAL)
        assert_allclose(result.parameters[pixel], list(alone.values.values()), rtol=1e-6)


def test_an_instrument_that_errs_can_be_fitted_too() -> None:
    family = lobe_family(("specular", "diffuse"), {**FREE, "background_per_sr": (-0.1, 0.1)}, {"gain": 1.1})
    x = np.array([[0.2, 2.0, 1.5, 0.6, 0.1, 0.01], [0.25, 2.2, 1.2, 0.5, 0.12, 0.0]])
    values = light(x, family)
    result = fit_many(DIRECTIONS, values, family, stderr=np.full((31, 3), 1e-4))
    assert_allclose(result.parameters, x, rtol=1e-6, atol=1e-8)


def test_degrees_of_polarization_can_be_fitted_with_a_weight_held() -> None:
    family = lobe_family(("specular", "diffuse"), FREE).holding("rho_s", 1.0)
    x = np.array([[0.2, 2.0, 1.5, 0.1], [0.25, 2.2, 1.2, 0.15]])
    values = light(x, family, observable=Dolp())
    result = fit_many(DIRECTIONS, values, family, stderr=np.full((31, 1), 1e-4), observable=Dolp())
    assert_allclose(result.parameters, x, rtol=1e-5)


def test_a_cone_of_acceptance_is_averaged_over() -> None:
    family = lobe_family(("specular", "diffuse"), FREE, bounces=2, detector_half_angle_rad=np.radians(0.5))
    x = np.array([[0.25, 2.0, 1.5, 0.6, 0.1], [0.3, 2.2, 1.2, 0.5, 0.12]])
    values = light(x, family)
    result = fit_many(DIRECTIONS, values, family, stderr=np.full((31, 3), 1e-4))
    assert_allclose(result.parameters, x, rtol=1e-6)


@pytest.mark.parametrize("observable", [Elements(), Elements((2, 0)), Elements((0, 1, 4, 5, 10), MUELLER)])
@pytest.mark.parametrize("own", [True, False])
@pytest.mark.parametrize("prior", [{}, {"n": (3.0, 0.1), "rho_d": (0.1, 0.1)}])
def test_compiled_normal_equations_are_those_of_the_jacobian(
    observable: Elements, own: bool, prior: dict[str, tuple[float, float]]
) -> None:
    family = lobe_family(LOBES, FREE, prior=prior)
    random, width = np.random.default_rng(1), len(observable.columns)
    whitener = np.tril(random.uniform(0.5, 2.0, (4 if own else 1, 31, width, width))).transpose(0, 2, 3, 1)
    directions = DIRECTIONS
    if own:
        directions = tuple(np.abs(angle - random.uniform(0.0, 0.01, (4, 31))) for angle in DIRECTIONS)
    values = random.uniform(0.0, 1.0, (4, width, 31))
    arguments = (family, observable, directions, values, whitener)
    x, which = np.array(IRON) * random.uniform(0.8, 1.2, (300, 6)), random.integers(0, 4, 300)
    one, other = Problem(*arguments), CompiledProblem(*arguments)
    expected, found = one.normal_equations(x, which), other.normal_equations(x, which)
    assert_allclose(found.cost, expected.cost, rtol=1e-12)
    scale = np.sqrt(np.einsum("bpp->bp", expected.normal))
    assert_allclose(
        found.gradient / scale, expected.gradient / scale, rtol=0.0, atol=1e-12 * np.sqrt(expected.cost).max()
    )
    scales = scale[:, :, None] * scale[:, None, :]
    assert_allclose(found.normal / scales, expected.normal / scales, rtol=0.0, atol=1e-12)


def test_a_family_that_the_compiled_problem_does_not_know_is_told_apart() -> None:
    surface = Surface([Specular(0.5, 0.2, 2.0 + 1.0j), Diffuse(0.1, 0.2)])
    assert CompiledProblem.is_possible(whole_family(surface))
    for changed in (
        SurfaceFamily(surface, {"n": (1.0, 3.0)}, {"gain": 1.1}),
        SurfaceFamily(surface, {"n": (1.0, 3.0), "exit_offset_rad": (-0.01, 0.01)}),
        SurfaceFamily(surface, {"n": (1.0, 3.0)}, detector_half_angle_rad=0.01),
    ):
        assert not CompiledProblem.is_possible(changed)


@pytest.mark.parametrize("fixed", [{}, {"rho_d": 0.08}], ids=["all weights free", "one held"])
def test_starts_among_shared_points_are_those_of_each_pixel(fixed: dict[str, float]) -> None:
    family = lobe_family(LOBES, FREE, fixed)
    _, values, stderr = image(3, IRON, LOSSY, (0.2, 1.7, 0.8, 0.6, 0.0, 0.0))
    whitener = np.zeros((3, 3, 3, 31))
    whitener[:, range(3), range(3)] = 1.0 / stderr.transpose(0, 2, 1)
    problem = Problem(family, Elements(), DIRECTIONS, values.transpose(0, 2, 1), whitener)
    points = np.random.default_rng(0).uniform(0.1, 1.0, (200, len(family.names)))
    points[:, :3] *= [0.5, 4.0, 4.0]
    points[:, 1] = np.maximum(points[:, 1], 1.0)
    shared = SharedLight(problem, points)
    for pixel in range(3):
        x, cost = projected(problem, points, pixel)
        found = shared.best(values[[pixel]].transpose(0, 2, 1), whitener[pixel], 5)[0]
        assert_allclose(found, x[np.argsort(cost)[:5]], rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("width", [1, 2, 3, 5])
def test_the_inverse_root_whitens(width: int) -> None:
    roots = np.random.default_rng(width).standard_normal((7, width, width))
    covariance = roots @ roots.swapaxes(1, 2) + 0.1 * np.eye(width)
    whitener = np.moveaxis(inverse_root(np.moveaxis(covariance, 0, -1)), -1, 0)
    assert_allclose(whitener, np.linalg.inv(np.linalg.cholesky(covariance)), rtol=1e-9, atol=1e-12)
    assert np.isnan(inverse_root(-np.moveaxis(covariance, 0, -1))).any()
