"""Elements, Jones matrices, coherency, Lu-Chipman factors and ratios of Stokes vectors."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from model.coherency import coherency, coherency_eigenvalues, is_physical
from model.geometry import Rotation
from model.lu_chipman import LuChipman, lu_chipman
from model.mueller import (
    depolarizer,
    homogeneous_element,
    jones_to_mueller,
    poincare_axis,
    polarizer,
    polarizer_row,
    retarder,
    rotator,
)
from model.stokes import aolp, docp, dolp, dop, ellipticity
from model.vgroove import bounce_mueller

RANDOM = np.random.default_rng(2023)


def stokes_of(field: np.ndarray) -> np.ndarray:
    """S0 = |Ex|² + |Ey|², S1 = |Ex|² - |Ey|², S2 = 2 Re(Ex Ey*), S3 = 2 Im(Ex Ey*)."""
    ex, ey = field[..., 0], field[..., 1]
    cross = ex * ey.conj()
    parts = [abs(ex) ** 2 + abs(ey) ** 2, abs(ex) ** 2 - abs(ey) ** 2, 2.0 * cross.real, 2.0 * cross.imag]
    return np.stack(parts, axis=-1)


def random_jones(*shape: int) -> np.ndarray:
    parts = RANDOM.normal(size=(2, *shape, 2, 2))
    return parts[0] + 1j * parts[1]


def random_axes(count: int) -> np.ndarray:
    vectors = RANDOM.normal(size=(count, 3))
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def turned(jones: np.ndarray, angle_rad: float) -> np.ndarray:
    cos, sin = np.cos(angle_rad), np.sin(angle_rad)
    frame = np.array([[cos, sin], [-sin, cos]])
    return frame.T @ jones @ frame


def product(factors: LuChipman) -> np.ndarray:
    return factors.depolarizer @ factors.retarder @ factors.diattenuator


def test_a_mueller_matrix_does_to_stokes_vectors_what_jones_does_to_fields() -> None:
    jones = random_jones(5, 1)
    field = RANDOM.normal(size=(7, 2)) + 1j * RANDOM.normal(size=(7, 2))
    after = np.einsum("...ij,...j->...i", jones, field)
    expected = np.einsum("...ij,...j->...i", jones_to_mueller(jones), stokes_of(field))
    assert_allclose(stokes_of(after), expected, rtol=1e-12, atol=1e-12)


def test_a_rotator_is_a_turn_of_the_fields_axes() -> None:
    angle = 0.4
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    double = Rotation(np.asarray(np.cos(2 * angle)), np.asarray(np.sin(2 * angle)))
    assert_allclose(jones_to_mueller(turn), rotator(double), atol=1e-15)


@pytest.mark.parametrize("leakage", [0.0, 1e-4, 0.3, 1.0])
def test_a_polarizer_is_the_one_of_jones(leakage: float) -> None:
    jones = turned(np.diag([1.0, np.sqrt(leakage)]), 0.7)
    assert_allclose(polarizer(0.7, leakage=leakage), jones_to_mueller(jones), atol=1e-15)


def test_a_polarizers_first_row_is_what_an_analyzer_measures() -> None:
    angles = np.linspace(-2.0, 2.0, 9)
    assert_allclose(polarizer(angles)[:, 0], polarizer_row(angles), atol=1e-16)


def test_a_polarizer_passes_its_state_and_leaks_the_opposite_one() -> None:
    axis = poincare_axis(0.3, 0.2)
    matrix = polarizer(0.3, ellipticity_rad=0.2, leakage=0.01)
    assert_allclose(matrix @ [1.0, *axis], [1.0, *axis], atol=1e-15)
    assert_allclose(matrix @ [1.0, *-axis], 0.01 * np.array([1.0, *-axis]), atol=1e-15)


def test_a_clockwise_polarizer_passes_clockwise_light() -> None:
    assert_allclose(polarizer(0.0, ellipticity_rad=np.pi / 4.0) @ [1.0, 0, 0, 1.0], [1.0, 0, 0, 1.0], atol=1e-15)


@pytest.mark.parametrize("retardance", [0.0, 0.3, np.pi / 2.0, np.pi, 5.0])
def test_a_retarder_is_the_one_of_jones(retardance: float) -> None:
    # exp(-i omega t): a longer path multiplies the slow field by exp(+i retardance).
    jones = turned(np.diag([1.0, np.exp(1j * retardance)]), -0.4)
    assert_allclose(retarder(retardance, -0.4), jones_to_mueller(jones), atol=1e-15)


def test_a_quarter_wave_with_fast_s_makes_45_degrees_counterclockwise() -> None:
    assert_allclose(retarder(np.pi / 2.0, 0.0) @ [1.0, 0, 1.0, 0], [1.0, 0, 0, -1.0], atol=1e-15)


def test_a_leaky_retarder_is_the_one_of_jones() -> None:
    jones = turned(np.diag([1.0, 0.9 * np.exp(0.5j)]), 1.1)
    assert_allclose(retarder(0.5, 1.1, slow_transmittance=0.81), jones_to_mueller(jones), atol=1e-15)


def test_elements_broadcast() -> None:
    assert polarizer(np.zeros((3, 1)), leakage=np.zeros(2)).shape == (3, 2, 4, 4)
    assert retarder(np.zeros((3, 1)), np.zeros(2)).shape == (3, 2, 4, 4)


@pytest.mark.parametrize("value", [-0.1, 1.1, np.nan])
def test_a_transmittance_out_of_range_is_refused(value: float) -> None:
    with pytest.raises(ValueError, match=r"leakage is .*; allowed is 0 to 1"):
        polarizer(0.0, leakage=value)
    with pytest.raises(ValueError, match=r"slow_transmittance is .*; allowed is 0 to 1"):
        retarder(0.1, 0.0, slow_transmittance=value)


def test_a_jones_matrix_has_one_eigenvalue_and_a_sum_of_two_has_two() -> None:
    pure = jones_to_mueller(random_jones(2, 50))
    m00 = pure[..., 0, 0]
    one = coherency_eigenvalues(pure)
    assert_allclose(one[..., 0], m00, rtol=1e-12)
    assert_allclose(one[..., 1:] / m00[..., None], 0.0, atol=1e-14)
    two = coherency_eigenvalues(pure[0] + pure[1])
    assert_allclose(two.sum(axis=-1), m00.sum(axis=0), rtol=1e-12)
    assert_allclose(two[..., 2:] / m00.sum(axis=0)[..., None], 0.0, atol=1e-14)
    assert (two[..., 1] > 1e-6).all()


def test_the_coherency_matrix_is_that_of_the_jones_matrix_in_the_pauli_basis() -> None:
    jones = np.array([[1.0 + 0.2j, 0.3], [-0.1j, 0.5]])
    c = np.array([jones[0, 0] + jones[1, 1], jones[0, 0] - jones[1, 1], jones[0, 1] + jones[1, 0], 0.0]) / 2.0
    c[3] = (jones[0, 1] - jones[1, 0]) / 2.0j
    assert_allclose(coherency(jones_to_mueller(jones)), np.outer(c, c.conj()), atol=1e-15)


def test_the_ideal_depolarizer_has_four_equal_eigenvalues() -> None:
    assert_allclose(coherency_eigenvalues(depolarizer()), 0.25, rtol=1e-15)


def test_sums_of_jones_matrices_are_physical_and_others_are_not() -> None:
    assert is_physical(jones_to_mueller(random_jones(3, 100)).sum(axis=0)).all()
    # A mirrored Poincaré sphere has no degree of polarization above 1, and is still no sum of Jones matrices.
    assert not is_physical(np.diag([1.0, 1.0, 1.0, -1.0]))
    assert not is_physical(np.diag([1.0, 1.1, 0.0, 0.0]))
    assert not is_physical(-np.eye(4))
    assert is_physical(np.zeros((4, 4)))


def test_a_metal_groove_is_physical_and_reflects_with_its_retardance() -> None:
    index, angle = 2.95 + 2.932j, np.radians(60.0)
    matrix = bounce_mueller(1, angle, angle, np.pi, sigma=0.2, asymmetry=0.0, index=index)
    c = np.cos(angle)
    w = np.sqrt(index**2 - 1.0 + c**2)
    r_s, r_p = (c - w) / (c + w), (index**2 * c - w) / (index**2 * c + w)
    factors = lu_chipman(matrix)
    s, p = abs(r_s) ** 2, abs(r_p) ** 2
    assert is_physical(matrix)
    assert_allclose(factors.diattenuation, [(s - p) / (s + p), 0.0, 0.0], atol=1e-13)
    assert_allclose(factors.retardance_vector, [np.angle(r_p / r_s), 0.0, 0.0], atol=1e-12)
    assert_allclose(factors.depolarization, 0.0, atol=1e-13)


def test_factors_are_found_again() -> None:
    count = 200
    strength, transmittance = RANDOM.uniform(0.0, 0.95, count), RANDOM.uniform(0.1, 1.0, count)
    axes, retardance = random_axes(count), RANDOM.uniform(0.0, np.pi, count)
    d = homogeneous_element(random_axes(count), transmittance * (1 + strength), transmittance * (1 - strength), 0.0)
    r = homogeneous_element(axes, 1.0, 1.0, retardance)
    shrinking = np.zeros((count, 4, 4))
    u = np.linalg.qr(RANDOM.normal(size=(count, 3, 3)))[0]
    shrinking[:, 1:, 1:] = (u * RANDOM.uniform(0.2, 0.9, (count, 1, 3))) @ u.swapaxes(-1, -2)
    shrinking[:, 1:, 0] = RANDOM.uniform(-0.05, 0.05, (count, 3))
    shrinking[:, 0, 0] = 1.0
    factors = lu_chipman(shrinking @ r @ d)
    assert_allclose(factors.diattenuator, d, atol=1e-12)
    assert_allclose(factors.retarder, r, atol=1e-11)
    assert_allclose(factors.depolarizer, shrinking, atol=1e-11)
    assert_allclose(factors.retardance_vector, retardance[:, None] * axes, atol=1e-7)
    assert_allclose(factors.retardance_rad, retardance, atol=1e-7)


def test_the_factors_of_random_physical_matrices_multiply_back() -> None:
    for terms in (1, 2, 3, 5):
        matrix = jones_to_mueller(random_jones(terms, 200)).sum(axis=0)
        factors = lu_chipman(matrix)
        assert_allclose(product(factors), matrix, atol=1e-11 * matrix.max())
        assert_allclose(np.linalg.det(factors.retarder), 1.0, rtol=1e-12)
        assert_allclose(
            factors.retarder @ factors.retarder.swapaxes(-1, -2), np.tile(np.eye(4), (200, 1, 1)), atol=1e-12
        )
        assert is_physical(factors.diattenuator).all()
        if terms == 1:
            assert_allclose(factors.depolarizer, np.tile(np.eye(4), (200, 1, 1)), atol=1e-8)


@pytest.mark.parametrize("axis", [(0.0, 0.0), (0.3, 0.0), (np.pi / 2.0, 0.0), (0.2, 0.4)])
def test_a_perfect_polarizer_is_all_diattenuator(axis: tuple[float, float]) -> None:
    matrix = polarizer(axis[0], ellipticity_rad=axis[1])
    factors = lu_chipman(matrix)
    assert_allclose(factors.diattenuator, matrix, atol=1e-12)
    assert_allclose(factors.retarder, np.eye(4), atol=1e-7)
    assert_allclose(factors.depolarizer, np.eye(4), atol=1e-12)


@pytest.mark.parametrize("angle", [0.0, 0.4, np.pi / 2.0])
@pytest.mark.parametrize("left", [0.0, 0.6, 1.0])
def test_behind_a_perfect_polarizer_the_least_retarder_turns_its_state(angle: float, left: float) -> None:
    matrix = np.diag([1.0, left, left, left]) @ retarder(np.pi, angle / 2.0) @ polarizer(0.0)
    factors = lu_chipman(matrix)
    assert_allclose(product(factors), matrix, atol=1e-7)
    assert_allclose(factors.depolarization, 1.0 - left, atol=1e-12)
    if left > 0.0:
        # The half-wave plate turns the state by 2 angle about the poles of the sphere; no retarder does so with less.
        assert_allclose(factors.retardance_rad, min(2.0 * angle, np.pi), atol=1e-7)


def test_the_zero_matrix_is_a_zero_diattenuator() -> None:
    factors = lu_chipman(np.stack([np.zeros((4, 4)), np.eye(4)]))
    assert_allclose(factors.diattenuator[0], 0.0)
    for factor in (factors.retarder, factors.depolarizer):
        assert_allclose(factor, np.tile(np.eye(4), (2, 1, 1)), atol=1e-15)
    assert_allclose(factors.diattenuation, 0.0)
    assert_allclose(factors.retardance_vector, 0.0, atol=1e-15)


@pytest.mark.parametrize(
    "kept", [(0.0, 0.0, 0.0), (0.7, 0.0, 0.0), (0.7, 0.4, 0.0), (0.0, 0.5, 0.0), (0.0, 0.0, 1.0), (0.3, -0.2, 0.0)]
)
def test_depolarizers_that_lose_a_direction_keep_the_least_retardance(kept: tuple[float, ...]) -> None:
    matrix = np.diag([1.0, *kept]) @ retarder(0.3, 0.2)
    factors = lu_chipman(matrix)
    assert_allclose(product(factors), matrix, atol=1e-12)
    assert_allclose(np.linalg.det(factors.retarder), 1.0, rtol=1e-12)
    if np.count_nonzero(kept) < 2:
        assert factors.retardance_rad <= 0.3 + 1e-12


def test_the_ideal_depolarizer_has_no_retardance_whatever_the_rounding() -> None:
    matrix = np.tile(depolarizer(), (20, 1, 1))
    matrix[:, 1:, 1:] = 1e-14 * RANDOM.normal(size=(20, 3, 3))
    factors = lu_chipman(matrix)
    assert_allclose(factors.retardance_rad, 0.0, atol=1e-15)
    assert_allclose(factors.depolarization, 1.0, rtol=1e-12)


def test_a_negative_determinant_is_in_the_depolarizer() -> None:
    factors = lu_chipman(np.diag([1.0, -0.3, -0.2, -0.1]))
    assert_allclose(factors.depolarizer, np.diag([1.0, -0.3, -0.2, -0.1]), atol=1e-15)
    assert_allclose(factors.retarder, np.eye(4), atol=1e-15)
    assert_allclose(factors.depolarization, 0.8, rtol=1e-12)


def test_a_half_wave_plate_keeps_its_axis() -> None:
    vector = lu_chipman(retarder(np.pi, 0.3, ellipticity_rad=0.1)).retardance_vector
    axis = poincare_axis(0.3, 0.1)
    assert_allclose(np.linalg.norm(vector), np.pi, rtol=1e-12)
    assert_allclose(abs(vector @ axis), np.pi, rtol=1e-12)


def test_a_small_retardance_keeps_its_digits() -> None:
    assert_allclose(lu_chipman(retarder(1e-9, 0.0)).retardance_vector, [1e-9, 0.0, 0.0], rtol=1e-6, atol=1e-16)


@pytest.mark.parametrize(
    "matrix",
    [-np.eye(4), np.eye(4) + 1.1 * np.eye(4, k=1), np.diag([0.0, 1.0, 0.0, 0.0]), np.full((4, 4), np.nan)],
)
def test_matrices_of_no_element_are_refused(matrix: np.ndarray) -> None:
    with pytest.raises(ValueError, match="no element has another matrix"):
        lu_chipman(matrix)


def test_ratios_of_elliptic_light() -> None:
    psi, chi = np.array([0.3, -1.2, 1.5]), np.array([0.1, -0.4, np.pi / 4.0 - 1e-3])
    polarized = poincare_axis(psi, chi)
    stokes = np.concatenate([np.full((3, 1), 2.0), polarized], axis=-1)
    assert_allclose(dop(stokes), 0.5, rtol=1e-15)
    assert_allclose(dolp(stokes), 0.5 * np.cos(2 * chi), rtol=1e-12)
    assert_allclose(docp(stokes), 0.5 * np.sin(2 * chi), rtol=1e-12)
    assert_allclose(aolp(stokes), psi, rtol=1e-12)
    assert_allclose(ellipticity(stokes), chi, rtol=1e-12)


def test_the_tangent_of_the_ellipticity_is_the_ratio_of_the_ellipses_axes() -> None:
    # Ex = cos(omega t), Ey = 0.2 sin(omega t + 0): semi-axes 1 and 0.2; it turns from x to y, against the clock.
    stokes = stokes_of(np.array([1.0, 0.2j]))
    assert_allclose(np.tan(ellipticity(stokes)), -0.2, rtol=1e-14)
    assert_allclose(aolp(stokes), 0.0, atol=1e-15)


def test_unpolarized_and_absent_light() -> None:
    assert_allclose([f([1.0, 0, 0, 0]) for f in (dop, dolp, docp, aolp, ellipticity)], 0.0)
    assert np.isnan([f([0.0, 0, 0, 0]) for f in (dop, dolp, docp)]).all()
