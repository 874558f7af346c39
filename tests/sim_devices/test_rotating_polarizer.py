"""A polarizer behind a retarder passes what Mueller matrices say, where the axes truly stand."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from model.mueller import polarizer, retarder
from sim_devices.analyzer import RotatingPolarizer, behind_retarder

ANGLE = st.floats(-180, 180)


@given(ANGLE, ANGLE, st.floats(1, 359))
def test_a_row_behind_a_retarder_is_the_first_row_of_both_matrices(polarizer_deg, retarder_deg, retardance_deg):
    analyzer = RotatingPolarizer(lambda _: polarizer_deg, lambda _: retarder_deg, retardance_deg)
    both = polarizer(math.radians(polarizer_deg)) @ retarder(math.radians(retardance_deg), math.radians(retarder_deg))
    assert_allclose(analyzer.row(0.0), both[0], atol=1e-12)


def test_clockwise_light_passes_a_polarizer_at_45_degrees_behind_a_plate_at_0():
    """A wave (1, -i) turns clockwise for the receiver, S3 > 0; the plate holds y back by a quarter: (1, 1)."""
    row = RotatingPolarizer(lambda _: 45.0, lambda _: 0.0).row(0.0)
    assert_allclose(row @ [1, 0, 0, 1], 1.0)
    assert_allclose(row @ [1, 0, 0, -1], 0.0, atol=1e-15)


def test_both_elements_are_where_they_are_at_the_time():
    analyzer = RotatingPolarizer(lambda time_s: 10.0 * time_s, lambda time_s: -5.0 * time_s, 80.0)
    assert_allclose(
        analyzer.row(3.0), behind_retarder(RotatingPolarizer(lambda _: 30.0).row(0.0), -15.0, 80.0), atol=1e-15
    )
    assert np.abs(analyzer.row(3.0) - analyzer.row(4.0)).max() > 0.05


@pytest.mark.parametrize("retardance_deg", [0.0, 360.0])
def test_a_retarder_of_whole_waves_does_nothing(retardance_deg):
    row = RotatingPolarizer(lambda _: 30.0).row(0.0)
    assert_allclose(behind_retarder(row, 17.0, retardance_deg), row, atol=1e-15)
