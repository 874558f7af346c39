"""The unit box that searches run in, and where they begin."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from model.fit import StokesData, SurfaceFamily
from model.search import sobol_starts
from model.varpro import Projection

FREE = {"sigma": (0.02, 1.0), "n": (1.0, 6.0), "k": (0.0, 8.0)}


def projection(free: dict[str, tuple[float, float]]) -> Projection:
    exits = np.linspace(0.0, 1.0, 20)
    family = SurfaceFamily(("specular", "diffuse"), free)
    truth = {"sigma": 0.2, "n": 2.0, "k": 1.0, "rho_s": 0.5, "rho_d": 0.1}
    stokes = family.surface(truth).stokes(1.0, exits, np.pi)[:, :3]
    covariance = 1e-8 * np.broadcast_to(np.eye(3), (20, 3, 3))
    return Projection(StokesData(np.full(20, 1.0), exits, np.full(20, np.pi), stokes, covariance), family)


def test_sigma_is_spaced_by_its_logarithm() -> None:
    middle = projection(FREE).shapes(np.full(3, 0.5))
    assert_allclose(list(middle.values()), [np.sqrt(0.02), 3.5, 4.0], rtol=1e-14)


def test_the_unit_box_maps_there_and_back() -> None:
    box = projection(FREE)
    point = np.array([0.2, 0.7, 0.4])
    assert_allclose(box.unit(box.shapes(point)), point, rtol=1e-13)


@pytest.mark.parametrize("seed", range(5))
def test_the_corners_of_the_box_are_within_the_bounds_to_the_last_digit(seed: int) -> None:
    low = np.random.default_rng(seed).uniform(0.1, 1.0, 3)
    free = dict(zip(FREE, zip(low.tolist(), (1.7 * low).tolist(), strict=True), strict=True))
    for corner in (np.zeros(3), np.ones(3)):
        for name, value in projection(free).shapes(corner).items():
            assert free[name][0] <= value <= free[name][1]


def test_sobol_starts_are_the_best_of_the_points_and_repeat_with_the_seed() -> None:
    box = projection(FREE)
    starts = sobol_starts(box, seed=3)
    chi_square = [box.chi_square(start) for start in starts]
    assert chi_square == sorted(chi_square)
    assert len(starts) == 4
    random_points = np.random.default_rng(0).random((64, 3))
    assert chi_square[-1] < np.quantile([box.chi_square(point) for point in random_points], 0.2)
    assert_allclose(sobol_starts(box, seed=3), starts)


def test_weights_are_never_negative() -> None:
    box = projection(FREE)
    columns = box.columns(box.unit({"sigma": 0.9, "n": 1.1, "k": 0.0}))
    assert (box.weights(columns) >= 0.0).all()
    assert_allclose(box.weights(0.0 * columns), 0.0)
