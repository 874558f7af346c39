"""What looks wrong in a table though it can be fitted: radians, copies of rows, light below 0."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from goniometer.fitting.doubts import doubts
from model.fit import Dataset
from model.geometry import in_plane


def scan(exit_deg: np.ndarray, incidence_deg: float = 60.0) -> Dataset:
    exit_rad, azimuth_rad = in_plane(np.radians(exit_deg))
    values = np.random.default_rng(0).uniform(0.1, 1.0, (len(exit_deg), 3))
    lines = np.arange(len(exit_deg)) + 5
    at = np.full(len(exit_deg), np.radians(incidence_deg)), exit_rad, azimuth_rad
    return Dataset(*at, values, name="scan.csv", lines=lines)


def test_nothing_is_said_of_a_scan_as_it_should_be() -> None:
    assert doubts(scan(np.arange(-30.0, 61.0, 5.0))) == ()


@pytest.mark.parametrize(
    ("incidence_deg", "exit_deg", "is_doubted"),
    [
        (1.047, np.linspace(-0.5, 1.05, 9), True),
        (0.0, np.array([-1.0, 0.0, 1.0]), False),
        (1.047, np.linspace(-0.5, 2.0, 9), False),
        (60.0, np.linspace(-0.5, 1.05, 9), False),
    ],
)
def test_angles_that_may_be_radians_are_doubted(incidence_deg: float, exit_deg: np.ndarray, is_doubted: bool) -> None:
    assert any("If these are radians" in doubt for doubt in doubts(scan(exit_deg, incidence_deg))) == is_doubted


def test_copies_of_rows_are_named_by_their_lines() -> None:
    data = scan(np.array([0.0, 10.0, 20.0, 10.0, 0.0, 0.0]))
    # The same direction measured again is no copy.
    assert doubts(data) == ()
    values = data.values.copy()
    values[[4, 5]] = values[0]
    (doubt,) = doubts(replace(data, values=values))
    assert doubt.startswith(
        "scan.csv: line 5 and line 9 are the same to the last digit, and so 2 of 6 rows repeat another"
    )


def test_light_below_zero_is_doubted() -> None:
    data = scan(np.arange(5.0, 10.0))
    values = data.values.copy()
    values[[2, 3], 0] = -1e-3
    (doubt,) = doubts(replace(data, values=values))
    assert "s0 is below 0 in 2 of 5 rows, the first of them line 7" in doubt
