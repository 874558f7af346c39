"""The row of a polarizer that is not ideal, derived from its amplitudes; and what a stored calibration must be."""

import math
from datetime import UTC, datetime

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pydantic import ValidationError

from acquisition.calibrated_slots import SlotCalibration, slot_row, slot_row_slopes

CASES = [(0.0, 0.0, 1.0), (44.0, 0.005, 0.93), (-51.3, 0.2, 0.4), (135.9, -0.01, 1.02)]


def passed(stokes, angle_deg, leak, transmission):
    """Power behind an element of amplitudes √t along its axis and √(t e) across: tr(J C J†) with the coherency C."""
    s0, s1, s2, s3 = stokes
    coherency = 0.5 * np.array([[s0 + s1, s2 + 1j * s3], [s2 - 1j * s3, s0 - s1]])
    cos, sin = math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))
    turn = np.array([[cos, sin], [-sin, cos]])
    amplitudes = np.sqrt(np.array([transmission, transmission * leak], dtype=complex))
    jones = turn.T @ np.diag(amplitudes) @ turn
    return (jones @ coherency @ jones.conj().T).trace().real


@pytest.mark.parametrize("case", CASES[:3])
@pytest.mark.parametrize("stokes", [(1.0, 0.0, 0.0, 0.0), (0.7, 0.5, 0.0, 0.2), (0.9, -0.3, 0.6, -0.1)])
def test_a_row_passes_what_its_amplitudes_pass(case, stokes):
    assert_allclose(slot_row(*case) @ stokes[:3], passed(stokes, *case), rtol=1e-12)


def test_signs():
    s, p, up, down = (1, 1, 0), (1, -1, 0), (1, 0, 1), (1, 0, -1)
    assert slot_row(0.0, 0.01, 1.0) @ s > 0.9 > 0.02 > slot_row(0.0, 0.01, 1.0) @ p > 0.005
    assert slot_row(45.0, 0.01, 1.0) @ up > slot_row(45.0, 0.01, 1.0) @ down
    assert slot_row(50.0, 0.0, 1.0) @ p > slot_row(50.0, 0.0, 1.0) @ s, "a larger angle is nearer to p"


@pytest.mark.parametrize("case", CASES)
def test_slopes_are_those_of_the_row(case):
    for which, step in enumerate(1e-6 * np.eye(3)):
        there, back = slot_row(*(np.array(case) + step)), slot_row(*(np.array(case) - step))
        assert_allclose(slot_row_slopes(*case)[which], (there - back) / 2e-6, rtol=1e-6, atol=1e-9)


def content(**changes):
    slot = {"angle_stderr_deg": 0.1, "leak_stderr": 0.001, "transmission_stderr": 0.01}
    given = {
        "calibration": "test",
        "measured": "2026-01-31T12:00:00+00:00",
        "rig": "bench",
        "devices": {"wheel": "thorlabs_fw102c"},
        "analyzer": "wheel",
        "offset_deg": 0.0,
        "layout": {1: "open", 2: 0.0, 3: 60.0},
        "wavelength_nm": 550.0,
        "reference": "polarizer",
        "scans": ["one"],
        "chi_square": 10.0,
        "degrees_of_freedom": 9,
        "relative_to_slot": 1,
        "slots": {
            2: slot | {"holds": 0.0, "angle_deg": 1.0, "leak": 0.005, "transmission": 0.9},
            3: slot | {"holds": 60.0, "angle_deg": 59.0, "leak": 0.002, "transmission": 1.0},
        },
        "correlation": np.eye(6).tolist(),
    }
    return given | changes


def test_covariance_and_slopes_are_in_the_order_of_the_slots():
    correlation = np.eye(6)
    correlation[0, 3] = correlation[3, 0] = 0.5
    calibration = SlotCalibration.model_validate(content(correlation=correlation.tolist()))
    assert_allclose(calibration.covariance[0, 3], 0.5 * 0.1 * 0.1)
    assert_allclose(np.diag(calibration.covariance), [0.01, 1e-6, 1e-4] * 2)
    assert_allclose(calibration.rows()[3], slot_row(59.0, 0.002, 1.0))
    assert_allclose(calibration.row_slopes()[3][3:], slot_row_slopes(59.0, 0.002, 1.0))
    assert not calibration.row_slopes()[3][:3].any()
    assert calibration.measured_at == datetime(2026, 1, 31, 12, tzinfo=UTC)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"measured": "2026-01-31T12:00:00"}, "a time with its zone"),
        ({"measured": "yesterday"}, "a time such as"),
        ({"layout": {1: "open", 2: 0.0, 3: 60.0, 4: 120.0}}, "are not the slots of layout"),
        ({"correlation": np.eye(5).tolist()}, "is not 6 rows of 6 numbers"),
        ({"correlation": (2.0 * np.eye(6)).tolist()}, "no matrix of correlations"),
        ({"correlation": (1.5 * np.ones((6, 6)) - 0.5 * np.eye(6)).tolist()}, "no matrix of correlations"),
        ({"correlation": (np.eye(6) + np.triu(np.full((6, 6), 0.3), 1)).tolist()}, "no matrix of correlations"),
    ],
)
def test_a_file_that_is_no_calibration_is_refused(changes, message):
    with pytest.raises(ValidationError, match=message):
        SlotCalibration.model_validate(content(**changes))
