"""What an analyzer passes that turns, how its turns are planned, and what is made of where it said it was."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from acquisition.analyzer_matrix import AnalyzerState, check_states
from acquisition.even_turn import EvenTurn
from acquisition.rotation import BACKWARDS, FORWARDS, Rotation
from acquisition.timing import AxisTiming
from goniometer.errors import ReductionError
from model.mueller import polarizer, retarder

ANGLE, SWEEP = st.floats(-180, 180), st.floats(-300, 300)


def mean_row(polarizer_deg, polarizer_sweep_deg, retarder_deg, retarder_sweep_deg, retardance_deg):
    """Of Mueller matrices of elements that stand, one beside the other."""
    nodes, weights = np.polynomial.legendre.leggauss(60)
    rows = [
        (
            polarizer(math.radians(polarizer_deg + node / 2 * polarizer_sweep_deg))
            @ retarder(math.radians(retardance_deg), math.radians(retarder_deg + node / 2 * retarder_sweep_deg))
        )[0]
        for node in nodes
    ]
    return weights / 2 @ np.array(rows)


@given(ANGLE, SWEEP, ANGLE, SWEEP, st.floats(1, 359))
def test_the_row_is_the_mean_of_the_rows_on_the_way(psi, psi_sweep, beta, beta_sweep, delta):
    row = AnalyzerState(psi, beta, delta, psi_sweep, beta_sweep).row()
    assert_allclose(row, mean_row(psi, psi_sweep, beta, beta_sweep, delta), atol=1e-9)


@given(ANGLE, SWEEP)
def test_a_polarizer_alone_keeps_a_sinc_of_its_contrast(psi, sweep):
    row = AnalyzerState(psi, polarizer_sweep_deg=sweep).row()
    assert_allclose(row, mean_row(psi, sweep, 0.0, 0.0, 0.0), atol=1e-9)
    assert row[3] == 0.0


def test_a_sweep_of_nothing_is_an_element_that_stands():
    for state in (AnalyzerState(33.0), AnalyzerState(20.0, 71.0, 88.0)):
        swept = AnalyzerState(state.polarizer_deg, state.retarder_deg, state.retardance_deg, 1e-9)
        assert_allclose(swept.row(), state.row(), atol=1e-15)


def test_half_a_turn_in_an_exposure_tells_nothing_of_linear_polarization():
    swept = [AnalyzerState(angle, polarizer_sweep_deg=180.0) for angle in range(0, 360, 15)]
    with pytest.raises(ReductionError, match=r"tell nothing of|so close together|amount to"):
        check_states(swept)


AXIS = AxisTiming(velocity_deg_s=90.0, acceleration_deg_s2=450.0, settle_s=0.1)


def test_a_turn_is_read_between_gathering_speed_and_losing_it():
    rotation = Rotation("polarizer", AXIS, AnalyzerState(0.0), offset_deg=2.0)
    assert_allclose(rotation.end_deg, 180.0 + 9.0 + 9.0)
    assert rotation.ends_deg == {FORWARDS: -rotation.end_deg, BACKWARDS: rotation.end_deg}
    gathered_deg = 0.5 * 450.0 * 0.2**2 + 90.0 * (rotation.begin_s - 0.2)
    assert_allclose(-rotation.end_deg + gathered_deg, -180.0)
    states = rotation.states(readings=40, exposure_s=0.05)
    angles_deg = np.array([state.polarizer_deg for state in states])
    assert_allclose(np.diff(angles_deg), 9.0)
    assert_allclose(angles_deg[0], -180.0 + 0.5 * 90.0 * 0.05 + 2.0)
    assert {state.polarizer_sweep_deg for state in states} == {4.5}
    assert_allclose(rotation.angle_deg(BACKWARDS, 1.0), 90.0)


def test_a_retarder_turns_before_a_polarizer_that_stands():
    rotation = Rotation("retarder", AXIS, AnalyzerState(30.0, 0.0, 90.0), offset_deg=2.0)
    assert rotation.state(10.0, -4.0) == AnalyzerState(32.0, 12.0, 90.0, 0.0, -4.0)


def asked(angle_deg, times_s, lasts_s=0.004):
    way = EvenTurn()
    for time_s in times_s:
        way.add(time_s - lasts_s / 2, angle_deg(time_s), time_s + lasts_s / 2)
    return way


TIMES_S = 100.0 + np.linspace(0.0, 4.0, 33)


def test_where_it_was_follows_from_what_it_said_not_from_its_nominal_speed():
    way = asked(lambda time_s: 7.0 - 89.5 * (time_s - 101.0), TIMES_S)
    assert_allclose([way.speed_deg_s, way.angle_deg(102.0)], [-89.5, -82.5], rtol=1e-9)
    assert way.fault(0.05, 90.0) == ""


def test_a_turn_that_gathers_speed_still_is_refused():
    way = asked(lambda time_s: 90.0 * (time_s - 100.0) - 9.0 * math.exp(-(time_s - 100.0) / 0.2), TIMES_S)
    assert "did not turn evenly" in way.fault(0.05, 90.0)


def test_a_position_is_known_no_better_than_when_it_was_asked_for():
    one_late = {TIMES_S[20]: 0.9}
    way = asked(lambda time_s: 90.0 * (time_s - 100.0) + one_late.get(time_s, 0.0), TIMES_S)
    assert "did not turn evenly" in way.fault(0.05, 90.0)
    slow = asked(lambda time_s: 90.0 * (time_s - 100.0) + one_late.get(time_s, 0.0), TIMES_S, lasts_s=0.02)
    assert slow.fault(0.05, 90.0) == ""


def test_another_speed_than_the_rig_files_is_refused():
    way = asked(lambda time_s: 80.0 * (time_s - 100.0), TIMES_S)
    assert "turned at 80 degrees/s, and velocity_deg_s in the rig file says 90" in way.fault(0.05, 90.0)
