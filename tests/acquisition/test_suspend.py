"""When a reading is in doubt."""

from __future__ import annotations

import pytest

from acquisition.readings import Reading
from acquisition.suspend import Judge, Suspend


def reading(kind, power_w, time_s=0.0):
    return Reading(0, kind, 0, time_s, 60.0, 10.0, 0.0, 1, None, 0.03, power_w)


@pytest.mark.parametrize(("level", "is_doubted"), [(0.81, False), (0.79, True), (0.0, True), (1.2, False)])
def test_a_lamp_is_too_weak_below_its_part_of_the_first_reference_above_dark(level, is_doubted):
    judge = Judge(Suspend(lamp_below=0.8))
    judge.saw(reading("dark", 1e-9))
    judge.saw(reading("reference", 11e-9, time_s=2.0))
    doubt = judge.doubt(reading("reference", 1e-9 + level * 10e-9, time_s=9.0))
    assert (doubt is not None) == is_doubted
    if doubt is not None:
        assert doubt.since_s == 2.0  # nobody knows when it failed after the last one that was well


def test_other_readings_say_nothing_of_the_lamp():
    judge = Judge(Suspend(lamp_below=0.8))
    judge.saw(reading("reference", 10e-9))
    assert judge.doubt(reading("signal", 1e-9)) is None
