"""Standard errors from a Jacobian, against the textbook's formula."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from goniometer.errors import FitError
from model.fit.uncertainty import uncertainty

NAMES = ("sigma", "n", "k")


@pytest.mark.parametrize("count", [3, 40, 1024, 1025, 7000, 300_000])
def test_covariance_is_the_inverse_of_the_normal_matrix(count: int) -> None:
    jacobian = np.random.default_rng(count).standard_normal((3, count)) * [[1e-3], [1.0], [1e4]]
    jacobian[1] += 1e-3 * jacobian[2]
    found = uncertainty(jacobian, NAMES)
    covariance = np.linalg.inv(jacobian @ jacobian.T)
    stderr = np.sqrt(np.diag(covariance))
    assert_allclose(found.stderr, stderr, rtol=1e-8)
    assert_allclose(found.correlation, covariance / np.outer(stderr, stderr), rtol=1e-7, atol=1e-9)
    assert_allclose(found.covariance / np.outer(stderr, stderr), found.correlation, rtol=1e-6, atol=1e-9)
    unit = jacobian / np.linalg.norm(jacobian, axis=1, keepdims=True)
    assert_allclose(found.condition, np.linalg.cond(unit.T), rtol=1e-9)
    # The weakest combination: one standard deviation long, and seen the least of all of unit length in own columns.
    assert_allclose(np.linalg.norm(found.weakest @ jacobian), 1.0, rtol=1e-9)
    lengths = np.linalg.norm(jacobian, axis=1)
    least = np.linalg.eigh(unit @ unit.T)[1][:, 0]
    assert_allclose(np.abs(found.weakest * lengths @ least) / np.linalg.norm(found.weakest * lengths), 1.0, rtol=1e-9)


def test_a_thousandfold_condition_is_told_to_many_digits() -> None:
    # Errors of 1e-10 in the normal matrix would drown what tells n from k here.
    random = np.random.default_rng(0)
    jacobian = random.standard_normal((3, 5000))
    jacobian[2] = jacobian[1] + 1e-6 * random.standard_normal(5000)
    _, singular, directions = np.linalg.svd(jacobian.T, full_matrices=False)
    covariance = (directions.T / singular**2) @ directions
    assert_allclose(uncertainty(jacobian, NAMES).stderr, np.sqrt(np.diag(covariance)), rtol=1e-7)


def test_what_cannot_be_told_apart_is_named() -> None:
    jacobian = np.random.default_rng(1).standard_normal((3, 50))
    jacobian[2] = 0.3 * jacobian[1]
    with pytest.raises(FitError, match="do not determine n and k"):
        uncertainty(jacobian, NAMES)
    jacobian[2] = 0.0
    with pytest.raises(FitError, match="do not determine k"):
        uncertainty(jacobian, NAMES)
    with pytest.raises(FitError, match="do not determine"):
        uncertainty(np.ones((3, 2)), NAMES)
