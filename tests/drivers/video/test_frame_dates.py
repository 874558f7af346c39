from __future__ import annotations

import math

import pytest

from drivers.camera.frame_dates import FrameDates


def test_picture_that_waited_in_a_buffer_is_dated_by_the_stream():
    dates = FrameDates(0.1, 0.02)
    begun = [dates.date(arrived, position)[0] for arrived, position in [(50.0, 7.0), (50.1, 7.1), (50.9, 7.2)]]
    assert begun == pytest.approx([49.88, 49.98, 50.08])


def test_stream_without_dates_is_dated_by_arrival():
    dates = FrameDates(0.1, 0.02)
    assert [dates.date(arrived, math.nan)[0] for arrived in (1.0, 1.1, 1.25)] == pytest.approx([0.88, 0.98, 1.13])


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


@pytest.mark.parametrize("has_dates", [True, False])
@pytest.mark.parametrize(("gap", "missing"), [(1.0, 0), (1.45, 0), (1.6, 1), (2.0, 1), (3.1, 2)])
def test_gaps_are_counted_in_pictures(gap, missing, has_dates):
    dates = FrameDates(0.1, 0.0)
    times = (1.0, 1.1, 1.1 + 0.1 * gap)
    found = [dates.date(time, time if has_dates else math.nan)[1] for time in times]
    assert found == [0, 0, missing]


def test_a_burst_after_a_pause_of_the_computer_is_no_gap_where_the_stream_has_dates():
    dates = FrameDates(0.1, 0.0)
    found = [dates.date(arrived, position)[1] for arrived, position in [(1.0, 1.0), (1.9, 1.1), (1.9, 1.2), (1.9, 1.3)]]
    assert found == [0, 0, 0, 0]
