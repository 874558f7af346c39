from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from acquisition.analyzer_matrix import CONDITION_LIMIT, analyzer_row, check_analyzer_set
from goniometer.errors import ReductionError


def test_a_polarizer_passes_all_of_its_own_and_none_of_the_crossed_polarization() -> None:
    for psi_deg in (0.0, 30.0, 45.0, 90.0, 100.0):
        psi_rad = np.radians(psi_deg)
        linear = np.array([1.0, np.cos(2 * psi_rad), np.sin(2 * psi_rad)])
        assert_allclose(analyzer_row(psi_deg) @ linear, 1.0)
        assert_allclose(analyzer_row(psi_deg + 90.0) @ linear, 0.0, atol=1e-15)


def test_zero_degrees_is_s_and_45_degrees_is_positive_s2() -> None:
    assert_allclose(analyzer_row(0.0), [0.5, 0.5, 0.0])
    assert_allclose(analyzer_row(45.0), [0.5, 0.0, 0.5], atol=1e-16)
    assert_allclose(analyzer_row(None), [1.0, 0.0, 0.0])


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
    matrix = np.array([analyzer_row(angle) for angle in angles])
    values = np.linalg.svd(matrix, compute_uv=False)
    is_good = len(angles) >= 3 and values[2] * CONDITION_LIMIT >= values[0]
    try:
        check_analyzer_set(angles)
    except ReductionError:
        assert not is_good
    else:
        assert is_good
