"""A fit that follows data as they grow: as good as a search while nothing jumps, and quick where the valley is long."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from model.fit import Dataset, fit, follow, lobe_family
from model.geometry import in_plane

METAL = lobe_family(("specular", "diffuse", "directional"), {"sigma": (0.02, 1.0), "n": (1.0, 6.0), "k": (0.0, 8.0)})
IRON = {"sigma": 0.1764, "n": 2.95, "k": 2.932, "rho_s": 0.7, "rho_d": 0.1, "rho_dd": 0.05}


def scan(seed: int) -> Dataset:
    exit_rad, azimuth_rad = in_plane(np.radians(np.arange(61.0)))
    at = np.full(61, np.radians(60.0)), exit_rad, azimuth_rad
    stokes = METAL.seen(IRON).stokes(*at)[:, :3]
    stddev = np.hypot(1e-4, 1e-3 * stokes[:, :1]) * np.ones(3)
    noisy = stokes + stddev * np.random.default_rng(seed).standard_normal(stokes.shape)
    return Dataset(*at, noisy, stddev[:, :, None] ** 2 * np.eye(3))


@pytest.mark.parametrize("seed", range(6))
def test_following_a_scan_point_by_point_ends_at_the_optimum(seed: int) -> None:
    data = scan(seed)
    last = fit(data.some(np.arange(8)), METAL)
    for count in range(9, 62):
        last = follow(data.some(np.arange(count)), METAL, last)
    whole = fit(data, METAL)
    for name, estimate in whole.parameters.items():
        assert abs(last.values[name] - estimate.value) < 0.05 * estimate.stderr
        assert_allclose(last.parameters[name].stderr, estimate.stderr, rtol=0.05)
    assert_allclose(last.chi_square, whole.chi_square, rtol=1e-4)


def test_it_never_gets_worse_and_says_what_it_left_open() -> None:
    data = scan(1)
    # Among the first angles n and k follow from nearly one number, and the optimum is far along their valley.
    last = fit(data.some(np.arange(8)), METAL)
    some = data.some(np.arange(30))
    before = fit(some, METAL).chi_square
    chi_squares = []
    for _ in range(60):
        last = follow(some, METAL, last)
        chi_squares.append(last.chi_square)
    assert (np.diff(chi_squares) <= 1e-9).all()
    assert_allclose(chi_squares[-1], before, rtol=1e-3)
    assert last.weakness is None
