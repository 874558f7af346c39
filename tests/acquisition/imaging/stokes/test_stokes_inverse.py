"""The inverse of an analyzer: of ideal elements, of calibrated ones, and of none that suffice."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acquisition.analyzer_matrix import AnalyzerState, analyzer_matrix
from acquisition.calibrated_slots import slot_row
from acquisition.imaging.stokes.stokes_inverse import inverse_of
from goniometer.errors import ReductionError

POLARIZERS = [AnalyzerState(angle_deg) for angle_deg in (0.0, 45.0, 90.0, 135.0)]
RETARDERS = [AnalyzerState(0.0, angle_deg, 90.0) for angle_deg in (-51.7, -15.1, 15.1, 51.7)]
CALIBRATED = [slot_row(angle_deg + 0.7, 0.02, 0.9) for angle_deg in (0.0, 45.0, 90.0, 135.0)]


@pytest.mark.parametrize(
    ("states", "light"),
    [
        (POLARIZERS, [2.0, 0.3, -0.7]),
        (POLARIZERS[:3], [2.0, 0.3, -0.7]),
        ([*POLARIZERS, AnalyzerState()], [2.0, 0.3, -0.7]),
        (RETARDERS, [2.0, 0.3, -0.7, 0.9]),
    ],
    ids=["four", "three", "open", "retarder"],
)
def test_light_comes_back(states, light):
    assert_allclose(inverse_of(states) @ analyzer_matrix(states) @ light, light, atol=1e-12)


def test_calibrated_rows_stand_for_what_the_elements_really_do():
    light = np.array([2.0, 0.3, -0.7])
    inverse = inverse_of(POLARIZERS, CALIBRATED)
    assert inverse.shape == (3, 4)
    assert_allclose(inverse @ (np.array(CALIBRATED) @ light), light, atol=1e-12)
    assert np.abs(inverse_of(POLARIZERS) @ (np.array(CALIBRATED) @ light) - light).max() > 0.01


def test_calibrated_rows_with_s3_give_four_stokes_parameters():
    rows = [row * 0.9 for row in analyzer_matrix(RETARDERS)]
    assert_allclose(inverse_of(RETARDERS, rows) @ rows, np.eye(4), atol=1e-12)
    of_linear = [np.append(row, 0.0) for row in CALIBRATED]
    assert_allclose(inverse_of(POLARIZERS, of_linear), inverse_of(POLARIZERS, CALIBRATED))


@pytest.mark.parametrize(
    ("states", "rows", "what"),
    [
        (POLARIZERS[:2], None, "S0, S1 and S2 need at least 3 different settings"),
        (RETARDERS[:3], None, "need at least 4 different settings"),
        (POLARIZERS, CALIBRATED[:3], "3 calibrated rows for 4 analyzer states"),
        (POLARIZERS, [CALIBRATED[0]] * 4, "0, 45, 90, 135 do not tell the 3 Stokes parameters .* Calibrate .* anew"),
        (RETARDERS, CALIBRATED, "do not tell the 4 Stokes parameters"),
    ],
)
def test_states_that_do_not_tell_the_light_are_refused(states, rows, what):
    with pytest.raises(ReductionError, match=what):
        inverse_of(states, rows)
