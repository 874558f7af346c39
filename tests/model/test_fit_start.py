"""Where a fit begins: the low-discrepancy set, and the weights that go with its points."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import nnls

from model.fit import Dataset, lobe_family
from model.fit.problem import Problem
from model.fit.start import genetic_start, sobol_starts
from model.fit.weights import non_negative, projected

FREE = {"sigma": (0.02, 1.0), "n": (1.0, 6.0), "k": (0.0, 8.0)}
TRUTH = {"sigma": 0.2, "n": 2.0, "k": 1.0, "rho_s": 0.5, "rho_d": 0.1}
FIRST = np.zeros(1, np.int64)


def problem(
    free: dict[str, tuple[float, float]] = FREE, objective: str = "stokes", held: dict[str, float] | None = None
) -> Problem:
    exits = np.linspace(0.0, 1.0, 20)
    family = lobe_family(("specular", "diffuse"), free)
    stokes = family.seen(TRUTH).stokes(1.0, exits, np.pi)[:, :3]
    covariance = 1e-8 * np.broadcast_to(np.eye(3), (20, 3, 3))
    data = Dataset(np.full(20, 1.0), exits, np.full(20, np.pi), stokes, covariance)
    return Problem.of(data.compared_by(objective), lobe_family(("specular", "diffuse"), free, held))


def test_starts_are_the_best_of_the_points_and_repeat_with_the_seed() -> None:
    box = problem()
    starts = sobol_starts(box, FIRST, 4, seed=3)[0]
    cost = box.difference(starts, np.zeros(4, np.int64)).cost
    assert (np.diff(cost) >= 0.0).all()
    low, high = np.transpose(list(FREE.values()))
    anywhere = np.ones((64, 5))
    anywhere[:, :3] = np.random.default_rng(0).uniform(low, high, (64, 3))
    assert cost[-1] < np.quantile(projected(box, anywhere, 0)[1], 0.2)
    assert_allclose(sobol_starts(box, FIRST, 4, seed=3)[0], starts)
    assert not np.allclose(sobol_starts(box, FIRST, 4, seed=4)[0], starts)


@pytest.mark.parametrize("seed", range(5))
def test_starts_are_within_narrow_bounds_to_the_last_digit(seed: int) -> None:
    low = np.random.default_rng(seed).uniform(0.1, 1.0, 3)
    free = dict(zip(FREE, zip(low.tolist(), (1.7 * low).tolist(), strict=True), strict=True))
    starts = sobol_starts(problem(free), FIRST, 8, seed)[0][:, :3]
    assert (starts >= low).all()
    assert (starts <= 1.7 * low).all()


@pytest.mark.parametrize("count", [1, 2, 3, 4, 5])
def test_weights_are_those_of_non_negative_least_squares(count: int) -> None:
    random = np.random.default_rng(count)
    columns = random.standard_normal((40, count, 30)) * 10.0 ** random.uniform(-6, 6, (1, count, 1))
    target = random.standard_normal((40, 30))
    gram, right = columns @ columns.swapaxes(1, 2), np.einsum("bpr,br->bp", columns, target)
    expected = [nnls(one.T, aim)[0] for one, aim in zip(columns, target, strict=True)]
    scale = 1.0 / np.sqrt(np.einsum("bpp->bp", gram))
    assert_allclose(non_negative(gram, right) / scale, np.array(expected) / scale, atol=1e-9)


def test_a_lobe_without_light_gets_no_weight() -> None:
    gram, right = np.diag([2.0, 0.0])[None], np.array([[4.0, 0.0]])
    assert_allclose(non_negative(gram, right), [[2.0, 0.0]])
    assert_allclose(non_negative(0.0 * gram, 0.0 * right), 0.0)


def test_at_the_true_shapes_the_weights_are_the_true_ones() -> None:
    x, cost = projected(problem(), np.array([list(TRUTH.values())]) * [1, 1, 1, 7, 9], 0)
    assert_allclose(x[0], list(TRUTH.values()), rtol=1e-9)
    assert cost[0] < 1e-12


@pytest.mark.parametrize("objective", ["normalised", "dolp"])
def test_at_the_true_shapes_the_weights_of_ratios_are_the_true_ones(objective: str) -> None:
    ratios = problem(objective=objective, held={"rho_s": 0.5})
    x, cost = projected(ratios, np.array([[0.2, 2.0, 1.0, 7.0], [0.2, 2.0, 1.0, 0.0]]), 0)
    assert_allclose(x, [[0.2, 2.0, 1.0, 0.1]] * 2, rtol=1e-6)
    assert (cost < 1e-12).all()


def test_the_genetic_search_ends_near_the_truth() -> None:
    found = genetic_start(problem(), 0, seed=1)
    assert_allclose(found, list(TRUTH.values()), rtol=0.3)


def test_ratios_search_for_weights_too() -> None:
    starts = sobol_starts(problem(objective="normalised"), FIRST, 4, seed=0)[0]
    assert len(np.unique(starts[:, 3])) == 4
