"""Degrees become radians, and signed angles directions."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acquisition.fit_points import dataset
from acquisition.readings import StokesPoint


def point(incidence_deg, exit_deg):
    return StokesPoint(0, incidence_deg, exit_deg, 0.0, np.ones(3), np.eye(3), 0.5, 0.5, 0.1, 0.0, 1.0)


@pytest.mark.parametrize(
    ("incidence_deg", "exit_deg", "azimuth_deg"),
    [(60.0, 30.0, 180.0), (60.0, -30.0, 0.0), (-0.0005, 30.0, 0.0), (-0.0005, -30.0, 180.0)],
)
def test_a_direction_keeps_its_side(incidence_deg, exit_deg, azimuth_deg):
    data = dataset([point(incidence_deg, exit_deg)])
    assert_allclose(np.degrees(data.incidence_rad), abs(incidence_deg))
    assert_allclose(np.degrees(data.exit_rad), abs(exit_deg))
    assert_allclose(np.degrees(data.azimuth_rad), azimuth_deg, atol=1e-9)
