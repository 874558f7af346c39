"""Single precision: what float32 arrays are answered with, and how far it is from double precision."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from numpy.typing import NDArray

from model.lobes import Diffuse, Directional, Lobe, Specular
from model.surface import Surface
from model.vgroove import bounce_mueller, bounce_stokes

HORIZON = np.float32(np.pi / 2.0)
COUNT = 20_000


def rounded(value: float) -> float:
    """The number that single precision makes of it, so that both precisions compute with the same."""
    return float(np.float32(value))


GLASS, IRON, RARE = complex(1.5), complex(rounded(2.95), rounded(2.932)), complex(rounded(0.6))
SIGMA = rounded(0.3)


def directions(highest_rad: float = np.pi / 2.0) -> list[NDArray[np.float32]]:
    random = np.random.default_rng(32)
    angles = [random.uniform(low, high, COUNT) for low, high in ((0.0, highest_rad), (0.0, highest_rad), (-3.2, 3.2))]
    return [angle.astype(np.float32) for angle in angles]


def excess(lobe: Lobe, at: list[NDArray[np.float32]], floor: float = 0.0) -> NDArray:
    """Differences between the precisions over M00, where that can be told in single precision."""
    surface = Surface([lobe])
    single, double = surface.mueller(*at), surface.mueller(*(angle.astype(np.float64) for angle in at))
    assert single.dtype == np.float32
    assert double.dtype == np.float64
    lit = double[:, 0, 0] > 1e-30
    assert lit.mean() > 0.2
    largest: NDArray = np.abs(single - double).max(axis=(-1, -2))[lit] / (double[lit, 0, 0] + floor)
    return largest


@pytest.mark.parametrize("index", [GLASS, IRON])
@pytest.mark.parametrize(("asymmetry", "bounces"), [(0.0, 1), (0.25, 1), (0.0, 3), (0.25, 2), (0.25, 4)])
@pytest.mark.parametrize("sigma", [rounded(0.1), SIGMA, 1.0])
def test_grooves(sigma: float, asymmetry: float, bounces: int, index: complex) -> None:
    differences = excess(Specular(1.0, sigma, index, asymmetry, bounces), directions())
    assert differences.max() < 1e-4
    assert np.median(differences) < 2e-6


def test_total_reflection() -> None:
    # At the critical angle the reflectance turns with a vertical tangent, and the last bit of an angle is magnified.
    differences = excess(Specular(1.0, SIGMA, RARE, 0.25, 2), directions())
    assert differences.max() < 2e-3
    assert np.quantile(differences, 0.999) < 1e-4


@pytest.mark.parametrize("bounces", [1, 2, 3])
def test_the_printed_reading_short_of_the_horizon(bounces: int) -> None:
    # Its masking is 1 less what is lost: at the horizon, a difference of nearly equal numbers.
    lobe = Specular(1.0, SIGMA, IRON, bounces=bounces, reading="single-fresnel")
    assert excess(lobe, directions(np.radians(85.0))).max() < 1e-4


@pytest.mark.parametrize("averages", ["printed", "exact"])
@pytest.mark.parametrize("sigma", [0.125, 0.5])
def test_diffuse_lobes(averages: str, sigma: float) -> None:
    # The bracket is a difference: where it nearly vanishes its error is that of the numbers of order 1 in it.
    lobe = Diffuse(0.25, sigma, averages)  # type: ignore[arg-type]
    assert excess(lobe, directions(), floor=0.01).max() < 1e-4


@pytest.mark.parametrize("exponent", [1, 2])
def test_directional_lobes(exponent: int) -> None:
    assert excess(Directional(0.25, 0.5, IRON, exponent), directions()).max() < 1e-4


def test_derivatives() -> None:
    surface = Surface([Specular(1.0, SIGMA, IRON, 0.25, 2), Diffuse(0.25, SIGMA)])
    at = directions(1.5)
    single = surface.jacobian(["sigma", "n", "k", "asymmetry"], *at)
    double = surface.jacobian(["sigma", "n", "k", "asymmetry"], *(angle.astype(np.float64) for angle in at))
    assert single.dtype == np.float32
    assert_allclose(single, double, rtol=0.0, atol=1e-4 * np.abs(double).max())


def test_the_horizon_in_single_precision_is_accepted_and_dark() -> None:
    # The float32 next to pi/2 lies above it.
    assert float(HORIZON) > np.pi / 2.0
    at = np.array([0.0, 0.4, HORIZON], np.float32)
    surface = Surface([Specular(0.7, SIGMA, IRON, 0.25, 3), Diffuse(0.25, SIGMA), Directional(0.25, SIGMA, GLASS)])
    light = surface.mueller(at[1:, None], at[None, :], np.float32(2.0))
    assert np.isfinite(light).all()
    assert not light[1].any()
    assert not light[:, 2].any()
    assert light[0, 0, 0, 0] > 0.0
    assert not surface.jacobian(["sigma", "n"], HORIZON, at, np.float32(2.0)).any()
    assert not surface.stokes(HORIZON, at, np.float32(2.0)).any()
    with pytest.raises(ValueError, match="exit_rad holds"):
        surface.stokes(0.3, np.nextafter(HORIZON, np.float32(2.0)), 2.0)


@pytest.mark.parametrize("sigma", [1e-5, 0.3, 1e5])
def test_nothing_overflows_at_the_edges(sigma: float) -> None:
    angles = np.array([1e-30, 1e-9, 0.4, 1.57, np.nextafter(HORIZON, np.float32(0.0)), HORIZON], np.float32)
    azimuths = np.array([0.0, 1e-9, 2.0, np.pi, -np.pi, 1e4, 1e30], np.float32)
    at = np.meshgrid(angles, angles, azimuths, indexing="ij")
    for index in (1.0 + 0j, GLASS, RARE, 1e-3 + 100.0j):
        for asymmetry in (0.0, 0.9):
            for bounces in (1, 2, 3):
                light = bounce_mueller(bounces, *at, sigma=sigma, asymmetry=asymmetry, index=index)
                assert not np.isnan(light).any()
                assert (light[..., 0, 0] >= 0.0).all()
        lobes = [Diffuse(1.0, sigma), Directional(1.0, sigma, index), Diffuse(1.0, sigma, "exact")]
        assert np.isfinite(Surface(lobes).mueller(*at)).all()


def test_precision_is_that_of_the_arrays_and_numbers_follow() -> None:
    single, double = np.linspace(0.1, 1.0, 3, dtype=np.float32), np.linspace(0.1, 1.0, 3)
    surface = Surface([Specular(0.7, SIGMA, IRON)])
    states = np.tile([1.0, 0.5, 0.0, 0.0], (3, 1))
    assert surface.stokes(0.3, single, 1.0).dtype == np.float32
    assert surface.stokes(0.3, single, 1.0, states).dtype == np.float32
    assert surface.stokes(0.3, single, 1.0, [2.0, 0.0, 0.0, 0.0]).dtype == np.float32
    assert surface.stokes(0.3, single, double).dtype == np.float64
    assert surface.stokes(0.3, 0.4, 1.0).dtype == np.float64
    assert surface.stokes(0.3, [0.4], 1.0).dtype == np.float64
    assert surface.stokes(0.3, np.array([1]), np.float32(1.0)).dtype == np.float64
    assert bounce_stokes(2, 0.3, single, 1.0, sigma=0.3, asymmetry=0.0, index=GLASS).dtype == np.float32
