"""What must hold at any direction, roughness and index."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from model.geometry import angles, facet
from model.groove_reflectance import facet_mueller
from model.lobes import Diffuse, Directional, Specular
from model.surface import Surface
from model.vgroove import bounce_mueller, single_bounce_fraction

polar = st.floats(0.0, np.radians(89.9999))
azimuth = st.floats(-2.0 * np.pi, 2.0 * np.pi)
roughness = st.floats(0.02, 3.0)
index = st.builds(complex, st.floats(0.05, 8.0), st.one_of(st.just(0.0), st.floats(0.0, 10.0)))
# Stokes = STATES · (E ⊗ E*).
STATES = np.array([[1, 0, 0, 1], [1, 0, 0, -1], [0, 1, 1, 0], [0, -1j, 1j, 0]])
REVERSAL, MIRROR = np.diag([1.0, 1.0, 1.0, -1.0]), np.diag([1.0, 1.0, -1.0, -1.0])


def coherency_eigenvalues(mueller: np.ndarray) -> np.ndarray:
    """Eigenvalues of the Hermitian matrix that must not be negative for a physical Mueller matrix (Cloude 1986)."""
    transfer = np.linalg.inv(STATES) @ mueller @ STATES
    return np.linalg.eigvalsh(transfer.reshape(2, 2, 2, 2).transpose(0, 2, 1, 3).reshape(4, 4))


def reciprocal_surface(sigma: float, n: complex) -> Surface:
    return Surface([Specular(0.7, sigma, n), Diffuse(0.2, sigma)])


@settings(max_examples=300, deadline=None)
@given(polar, polar, azimuth, roughness, index)
def test_reciprocity(ti: float, tr: float, phi: float, sigma: float, n: complex) -> None:
    surface = reciprocal_surface(sigma, n)
    there, back = surface.mueller(ti, tr, phi), surface.mueller(tr, ti, phi)
    # The diffuse lobe's bracket is a difference of numbers of the order of 1.
    assert_allclose(REVERSAL @ back.T @ REVERSAL, there, rtol=0.0, atol=1e-14 * there[0, 0] + 1e-15)


@settings(max_examples=200, deadline=None)
@given(polar, polar, azimuth, roughness, index)
def test_mirror_symmetry(ti: float, tr: float, phi: float, sigma: float, n: complex) -> None:
    surface = reciprocal_surface(sigma, n)
    one_side, other_side = surface.mueller(ti, tr, phi), surface.mueller(ti, tr, -phi)
    assert_allclose(MIRROR @ other_side @ MIRROR, one_side, rtol=0.0, atol=1e-14 * one_side[0, 0])


@settings(max_examples=200, deadline=None)
@given(polar, polar, azimuth, index)
def test_a_facet_never_amplifies(ti: float, tr: float, phi: float, n: complex) -> None:
    matrix = np.array(facet_mueller(facet(angles(ti, tr, phi)), n.real, n.imag))
    largest_gain = matrix[0, 0] + np.linalg.norm(matrix[0, 1:])
    assert largest_gain <= 1.0 + 1e-14


@settings(max_examples=200, deadline=None)
@given(polar, polar, azimuth, roughness, index)
@example(0.0, 5e-324, 1.0, 0.25, 2.0 + 0j)  # i × r is a denormal number
@example(0.7, 0.7, 0.0, 0.25, 2.0 + 3.0j)  # i × r is zero
def test_mueller_matrices_are_physical(ti: float, tr: float, phi: float, sigma: float, n: complex) -> None:
    surface = Surface([Specular(0.7, sigma, n), Diffuse(0.2, sigma), Directional(0.05, sigma, n)])
    matrix = surface.mueller(ti, tr, phi)
    assert coherency_eigenvalues(matrix).min() >= -1e-14 * matrix[0, 0]


@settings(max_examples=100, deadline=None)
@given(polar, polar, azimuth, index, st.lists(st.floats(-1.0, 1.0), min_size=3, max_size=3))
def test_stokes_is_mueller_times_the_incoming_state(
    ti: float, tr: float, phi: float, n: complex, polarized: list[float]
) -> None:
    surface = Surface([Specular(0.7, 0.3, n), Diffuse(0.2, 0.3), Directional(0.05, 0.3, n)])
    matrix = surface.mueller(ti, tr, phi)
    for state in ([2.0, 0.0, 0.0, 0.0], [2.0, *polarized]):
        assert_allclose(surface.stokes(ti, tr, phi, state), matrix @ state, rtol=0.0, atol=1e-14 * matrix[0, 0])


def test_unpolarized_light_takes_the_short_way_to_the_same_result() -> None:
    at = 0.9, np.linspace(0.0, 1.5, 7), np.linspace(-3.0, 3.0, 7)
    surface = Surface([Specular(0.7, 0.3, 2.0 + 3.0j, 0.2, bounces=3), Diffuse(0.2, 0.3)])
    assert_allclose(surface.stokes(*at), surface.stokes(*at, [1.0, 1e-200, 0.0, 0.0]), rtol=0.0, atol=1e-199)


def test_the_directional_lobe_is_not_reciprocal() -> None:
    surface = Surface([Directional(1.0, 0.4, 1.5 + 0j)])
    assert surface.mueller(0.1, 0.8, 2.0)[0, 0] < 0.1 * surface.mueller(0.8, 0.1, 2.0)[0, 0]


# sigma, incidence in degrees, fraction of 10^7 rays on a perfect reflector that leave after one bounce, standard error
TRACED_FRACTIONS = [
    (0.1, 60.0, 0.9907023, 3.0e-5),
    (0.1, 89.0, 0.9882717, 3.4e-5),
    (0.3, 0.0, 0.9494642, 6.9e-5),
    (0.3, 60.0, 0.8973468, 9.6e-5),
    (0.3, 89.0, 0.9950762, 2.2e-5),
    (0.5, 0.0, 0.6908919, 1.5e-4),
    (0.5, 60.0, 0.8567798, 1.1e-4),
    (1.0, 0.0, 0.2638822, 1.4e-4),
    (1.0, 60.0, 0.6696117, 1.5e-4),
    (1.0, 89.0, 0.9910634, 3.0e-5),
]


@pytest.mark.parametrize(("sigma", "incidence_deg", "fraction", "stderr"), TRACED_FRACTIONS)
def test_energy_of_one_bounce_agrees_with_a_ray_tracer(
    sigma: float, incidence_deg: float, fraction: float, stderr: float
) -> None:
    computed = single_bounce_fraction(np.radians(incidence_deg), sigma)
    assert_allclose(computed, fraction, rtol=0.0, atol=4.0 * stderr + 2e-4)


@pytest.mark.parametrize(("sigma", "incidence_deg"), [(0.2, 0.0), (0.2, 60.0), (0.6, 30.0), (0.6, 80.0), (2.0, 45.0)])
def test_a_perfect_mirror_reflects_what_the_facets_send_and_never_more(sigma: float, incidence_deg: float) -> None:
    # Midpoint rule over the hemisphere of exit directions, in equal steps of cos² and azimuth.
    nodes = (np.arange(500) + 0.5) / 500.0
    exit_rad, azimuth_rad = np.arccos(np.sqrt(nodes))[:, None], 2.0 * np.pi * nodes
    incidence = np.radians(incidence_deg)
    mirror = 1e-6 + 1e6j
    f00 = bounce_mueller(1, incidence, exit_rad, azimuth_rad, sigma=sigma, asymmetry=0.0, index=mirror)[..., 0, 0]
    reflected = np.pi * f00.mean()
    assert reflected <= 1.0 + 1e-4
    assert_allclose(reflected, single_bounce_fraction(incidence, sigma), rtol=0.0, atol=5e-4)
