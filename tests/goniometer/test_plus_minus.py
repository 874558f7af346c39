"""Numbers as a person reads them: as many digits as their error allows."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from goniometer.plus_minus import number_and_error, plus_minus


@pytest.mark.parametrize(
    ("value", "stderr", "text"),
    [
        (2.95, 0.012, "2.950 ± 0.012"),
        (2.95, 0.0997, "2.95 ± 0.10"),
        (12345.0, 123.0, "12340 ± 120"),
        (0.0, 2.4, "0.0 ± 2.4"),
        (-0.00012, 0.2, "0.00 ± 0.20"),
        (1.234e-9, 1.2e-11, "1.234e-09 ± 0.012e-09"),
        (2.95, 1e-11, "2.9500000 ± 1.0e-11"),
        (2.95, 0.0, "2.95 ± 0"),
        (2.95, None, "2.95"),
        (2.95, math.nan, "2.95"),
        (math.nan, 0.1, "nan"),
    ],
)
def test_examples(value: float, stderr: float | None, text: str) -> None:
    assert plus_minus(value, stderr) == text


@given(value=st.floats(-1e12, 1e12), stderr=st.floats(1e-15, 1e12))
def test_what_is_written_is_what_was_measured(value: float, stderr: float) -> None:
    number, error = number_and_error(value, stderr)
    assert float(error) == pytest.approx(stderr, rel=0.051)
    assert abs(float(number) - value) <= max(0.051 * stderr, 1e-7 * abs(value), 1e-7)
