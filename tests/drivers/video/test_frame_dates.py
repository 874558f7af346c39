from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.camera.frame_dates import TOLD_AFTER, FrameDates


def test_picture_that_waited_in_a_buffer_is_dated_by_the_stream():
    dates = FrameDates(0.1, 0.02)
    begun = [dates.date(arrived, position)[0] for arrived, position in [(50.0, 7.0), (50.1, 7.1), (50.9, 7.2)]]
    assert begun == pytest.approx([49.88, 49.98, 50.08])


def test_a_stream_without_dates_keeps_the_pace_of_its_camera():
    dates = FrameDates(0.1, 0.02)
    begun = [dates.date(arrived, math.nan)[0] for arrived in (1.0, 1.1, 1.25, 1.31)]
    assert begun == pytest.approx([0.88, 0.98, 1.08, 1.18])


def arrivals(made_s, stalls):
    """When pictures arrive at a program that stands still meanwhile: never before one that was made earlier."""
    for made in made_s:
        for start, end in stalls:
            made = end if start < made < end else made
        yield made


@settings(max_examples=300)
@given(
    period_s=st.floats(0.0996, 0.1004),
    stalls=st.lists(st.tuples(st.floats(1.0, 20.0), st.floats(0.0, 3.0)), max_size=3),
    jitter_s=st.floats(0.0, 0.01),
    seed=st.integers(0, 2**32 - 1),
)
def test_a_computer_that_stands_still_loses_no_picture_and_makes_none_younger(period_s, stalls, jitter_s, seed):
    made_s = 5.0 + period_s * np.arange(250)
    waits = np.random.default_rng(seed).uniform(0.0, jitter_s, made_s.size)
    dates = FrameDates(0.1, 0.0)
    ends = sorted((5.0 + start, 5.0 + start + duration) for start, duration in stalls)
    off_s = abs(0.1 / period_s - 1.0) * sum(0.1 * (TOLD_AFTER + 1) + duration for _, duration in stalls) + 0.002
    for made, arrived in zip(made_s, np.maximum.accumulate(list(arrivals(made_s + waits, ends))), strict=True):
        begun, missing = dates.date(arrived, math.nan)
        assert missing == 0
        assert -off_s < begun - (made - 0.1) < off_s + jitter_s


def test_dates_that_stand_still_are_not_used():
    dates = FrameDates(0.1, 0.0)
    assert [dates.date(1.0 + 0.1 * k, 0.0)[0] for k in range(4)] == pytest.approx([0.9, 1.0, 1.1, 1.2])


def test_a_slow_clock_of_the_camera_does_not_make_pictures_old():
    dates = FrameDates(0.1, 0.0)
    for k in range(36_000):  # an hour, 100 ppm slow
        arrived = 0.1 * k
        begun, missing = dates.date(arrived, arrived * (1 - 1e-4))
        assert arrived - 0.1 - 0.004 < begun <= arrived - 0.1 + 1e-9
        assert missing == 0


GAPS = pytest.mark.parametrize(("gap", "missing"), [(1.0, 0), (1.45, 0), (1.6, 1), (2.0, 1), (3.1, 2)])


@GAPS
def test_gaps_are_counted_in_pictures(gap, missing):
    dates = FrameDates(0.1, 0.0)
    found = [dates.date(time, time)[1] for time in (1.0, 1.1, 1.1 + 0.1 * gap)]
    assert found == [0, 0, missing]


@GAPS
def test_gaps_in_a_stream_without_dates_are_told_once_the_pictures_behind_them_come_no_faster(gap, missing):
    dates = FrameDates(0.1, 0.0)
    behind = [1.1 + 0.1 * (gap + k) for k in range(TOLD_AFTER + 1)]
    begun, found = zip(*(dates.date(time, math.nan) for time in (1.0, 1.1, *behind)), strict=True)
    assert found == (*[0] * (TOLD_AFTER + 1), missing, 0)
    assert begun[-2:] == pytest.approx([time - 0.1 for time in behind[-2:]])
    assert begun[:-2] == pytest.approx([0.9 + 0.1 * k for k in range(TOLD_AFTER + 1)]), "too early at the worst"


def test_a_burst_after_a_pause_of_the_computer_is_no_gap_where_the_stream_has_dates():
    dates = FrameDates(0.1, 0.0)
    found = [dates.date(arrived, position)[1] for arrived, position in [(1.0, 1.0), (1.9, 1.1), (1.9, 1.2), (1.9, 1.3)]]
    assert found == [0, 0, 0, 0]
