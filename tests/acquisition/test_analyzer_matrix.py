from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from acquisition.analyzer_matrix import (
    CONDITION_LIMIT,
    AnalyzerState,
    analyzer_matrix,
    check_analyzer_set,
    check_states,
)
from goniometer.errors import ReductionError


def passed(field: tuple[complex, complex], state: AnalyzerState) -> float:
    """Power of a field (Ex, Ey) behind a retarder and a polarizer, by what these do to waves exp(-i omega t).

    The field farther along the way has the larger phase, and so has the component that a retarder holds back.
    """
    assert state.polarizer_deg is not None
    assert state.retarder_deg is not None
    assert state.retardance_deg is not None
    fast = np.array([np.cos(np.radians(state.retarder_deg)), np.sin(np.radians(state.retarder_deg))])
    slow = np.array([-fast[1], fast[0]])
    e = np.array(field)
    behind = fast * (fast @ e) + slow * (slow @ e) * np.exp(1j * np.radians(state.retardance_deg))
    axis = np.array([np.cos(np.radians(state.polarizer_deg)), np.sin(np.radians(state.polarizer_deg))])
    return float(abs(axis @ behind) ** 2)


ANGLE = st.floats(-180, 180)


@given(ANGLE, ANGLE, st.floats(1, 359), st.floats(-3, 3), st.floats(-3, 3))
def test_a_row_is_what_waves_do(psi: float, fast: float, delta: float, real: float, imaginary: float) -> None:
    ex, ey = 1.0, complex(real, imaginary)
    cross = ex * np.conj(ey)
    stokes = [abs(ex) ** 2 + abs(ey) ** 2, abs(ex) ** 2 - abs(ey) ** 2, 2 * cross.real, 2 * cross.imag]
    state = AnalyzerState(psi, fast, delta)
    assert_allclose(state.row() @ stokes, passed((ex, ey), state), rtol=1e-9, atol=1e-12)


def test_light_that_turns_clockwise_is_positive_s3_and_passes_45_degrees_behind_a_plate_at_0() -> None:
    """Mueller matrices written out: a quarter-wave plate with its fast axis along s, then a polarizer at +45 degrees.

    The field of a clockwise wave stands along x at t = 0 and along -y a quarter of a period later: for a receiver who
    looks at the source x to y turns counterclockwise. It is (1, -i), for Re(-i exp(-i pi/2)) = -1; so S3 = +2.
    """
    plate = np.array([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1], [0, 0, -1, 0]])
    polarizer = 0.5 * np.array([[1, 0, 1, 0], [0, 0, 0, 0], [1, 0, 1, 0], [0, 0, 0, 0]])
    clockwise = np.array([1.0, 0.0, 0.0, 1.0])
    assert_allclose(2 * np.imag(1.0 * np.conj(-1j)), 2.0)
    assert_allclose(AnalyzerState(45.0, 0.0, 90.0).row(), (polarizer @ plate)[0], atol=1e-15)
    assert_allclose(AnalyzerState(45.0, 0.0, 90.0).row() @ clockwise, 1.0)
    assert_allclose(AnalyzerState(-45.0, 0.0, 90.0).row() @ clockwise, 0.0, atol=1e-15)


PLATE_DEG = (-51.7, -15.1, 15.1, 51.7)


def test_s3_is_among_the_unknowns_as_soon_as_one_state_depends_on_it() -> None:
    linear = [AnalyzerState(angle) for angle in (0.0, 45.0, 90.0)]
    assert analyzer_matrix(linear).shape == (3, 3)
    assert analyzer_matrix([*linear, AnalyzerState(45.0, 0.0, 90.0)]).shape == (4, 4)
    assert analyzer_matrix([AnalyzerState(0.0, angle, 180.0) for angle in (0.0, 20.0, 60.0)]).shape == (3, 3)


@pytest.mark.parametrize("retardance_deg", [60.0, 90.0, 132.0])
def test_a_retarder_that_turns_tells_all_four_apart(retardance_deg: float) -> None:
    states = [AnalyzerState(0.0, angle, retardance_deg) for angle in PLATE_DEG]
    check_states(states)
    assert np.linalg.cond(analyzer_matrix(states)) < 10


@pytest.mark.parametrize(
    ("states", "reason"),
    [
        ([(0, a, 90) for a in (0, 45, 90, 135)], r"0/0, 45/0, .* amount to 3 different ones; .* at least 4"),
        ([(0, a, 90) for a in (-45, 0, 45)], "at least 4 different"),
        ([(a, 0, 90) for a in (0, 30, 60, 90, 120)], r"tell nothing of S2; .*stands still.*turn it too"),
        ([(a, 22.5, 90) for a in (0, 30, 60, 90, 120)], r"tell nothing of 0.71 S1 - 0.71 S2"),
        ([(0, a, 90) for a in (30, 30.5, 31, 31.5)], r"reach S1, S2 and S3 enlarged up to \d+ times"),
    ],
)
def test_retarder_sets_that_leave_something_open_are_refused_with_what_it_is(
    states: list[tuple[float, float, float]], reason: str
) -> None:
    with pytest.raises(ReductionError, match=reason):
        check_states([AnalyzerState(*state) for state in states])


def test_a_polarizer_passes_all_of_its_own_and_none_of_the_crossed_polarization() -> None:
    for psi_deg in (0.0, 30.0, 45.0, 90.0, 100.0):
        psi_rad = np.radians(psi_deg)
        linear = np.array([1.0, np.cos(2 * psi_rad), np.sin(2 * psi_rad), 0.0])
        assert_allclose(AnalyzerState(psi_deg).row() @ linear, 1.0)
        assert_allclose(AnalyzerState(psi_deg + 90.0).row() @ linear, 0.0, atol=1e-15)


def test_zero_degrees_is_s_and_45_degrees_is_positive_s2() -> None:
    assert_allclose(AnalyzerState(0.0).row(), [0.5, 0.5, 0.0, 0.0])
    assert_allclose(AnalyzerState(45.0).row(), [0.5, 0.0, 0.5, 0.0], atol=1e-16)
    assert_allclose(AnalyzerState().row(), [1.0, 0.0, 0.0, 0.0])


@pytest.mark.parametrize("angles", [[0, 45, 90, 135], [0, 60, 120], [0, 45, 90], [10, 20, 40], [None, 0, 45]])
def test_sets_that_tell_the_stokes_parameters_apart_are_accepted(angles: list[float | None]) -> None:
    check_analyzer_set(angles)


@pytest.mark.parametrize(
    ("angles", "reason"),
    [
        ([], "0 different ones"),
        ([0, 180, 360], "1 different one,"),
        ([0, 90, 180, 270], "2 different ones"),
        ([None, 0, None], "open, 0, open amount to 2 different ones"),
        ([45, 45 + 1e-9, 90], "2 different ones"),
        ([179.9999999, 0, 90], "2 different ones"),
        ([0, 1, 2], "so close together .* times"),
    ],
)
def test_sets_that_cannot_are_refused_with_the_reason(angles: list[float | None], reason: str) -> None:
    with pytest.raises(ReductionError, match=reason):
        check_analyzer_set(angles)


@given(st.lists(st.floats(-360, 360), min_size=1, max_size=8))
def test_a_set_is_accepted_exactly_when_its_matrix_is_well_conditioned(angles: list[float]) -> None:
    matrix = np.array([AnalyzerState(angle).row()[:3] for angle in angles])
    values = np.linalg.svd(matrix, compute_uv=False)
    is_good = len(angles) >= 3 and values[2] * CONDITION_LIMIT >= values[0]
    try:
        check_analyzer_set(angles)
    except ReductionError:
        assert not is_good
    else:
        assert is_good
