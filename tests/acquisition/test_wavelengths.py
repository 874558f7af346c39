"""The order of several wavelengths, and what is done to bring a filter into the beam and to see that it stays."""

import itertools
from dataclasses import dataclass, field

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acquisition.calibration_recipe import CalibrationRecipe, calibration_steps
from acquisition.expand import HOME, Slots, expand
from acquisition.filters import Filters, ToldWavelength
from acquisition.moving import Moving
from acquisition.recipe import Recipe
from acquisition.timing import AxisTiming, BenchTiming, WheelTiming
from acquisition.wavelengths import expand_wavelengths
from goniometer.errors import PositionError

AXIS = AxisTiming(20.0, 80.0, 0.05)
WHEEL = WheelTiming(6, 0.5, 0.05)
TIMING = BenchTiming(AXIS, AXIS, AXIS, WHEEL, filter=WheelTiming(6, 2.0, 0.25))
SLOT_OF = {450.0: 1, 500.0: 2, 550.0: 4, 600.0: 5, 650.0: 6}


def recipe(wavelength_nm, **changes):
    return Recipe.model_validate(
        {
            "recipe": "iron",
            "rig": "rig.yaml",
            "wavelength_nm": wavelength_nm,
            "incidence_deg": 60.0,
            "exit_deg": [0, 10, 20, 40],
            "analyzer_deg": [0, 45, 90],
            "readings": 2,
            "exposure_s": 0.03,
            "fit": {"lobes": ["specular"], "free": {"sigma": [0.02, 1.0]}, "fixed": {"n": 3.0, "k": 3.0}},
        }
        | changes
    )


def slots(filter_slot):
    return Slots({0.0: 2, 45.0: 3, 90.0: 4}, offset_deg=0.0, blocked=6, open=1, filter_slot=filter_slot)


def steps_of(wavelengths_nm, timing=TIMING, **changes):
    at = {wavelength_nm: slots(SLOT_OF[wavelength_nm]) for wavelength_nm in wavelengths_nm}
    return expand_wavelengths(recipe(list(wavelengths_nm), **changes), at, timing)


def test_a_calibration_is_measured_behind_the_filter_of_its_wavelength_and_in_the_plane_of_incidence():
    known = {"reference": "polarizer", "angles_deg": [0, 45, 90], "zero_stderr_deg": 0.05, "setting_stderr_deg": 0.02}
    known |= {"extinction_ratio": 1e6, "incidence_deg": 60, "exit_deg": 60}
    content = {"recipe": "known light", "rig": "rig.yaml", "wavelength_nm": 550, "readings": 2, "exposure_s": 0.03}
    steps = calibration_steps(CalibrationRecipe.model_validate(content | {"calibrate": known}), slots(4), TIMING)
    assert {step.target.filter_slot for step in steps} == {4}
    assert {step.target.exit_azimuth_deg for step in steps} == {0.0}


def test_the_filter_is_outermost_and_every_direction_is_measured_at_each():
    listed = (550.0, 450.0, 650.0)
    steps = steps_of(listed, repeats=2, reference={"exit_deg": 20, "every_points": 3})
    runs = [wavelength_nm for wavelength_nm, _ in itertools.groupby(step.wavelength_nm for step in steps)]
    assert len(runs) == len(set(runs)) == 3, "each filter comes into the beam once"
    alone = len(expand(recipe(450.0, repeats=2, reference={"exit_deg": 20, "every_points": 3}), slots(1), TIMING))
    assert len(steps) == 3 * alone
    for number, wavelength_nm in enumerate(listed):
        of_one = [step for step in steps if step.wavelength_nm == wavelength_nm]
        assert {step.target.filter_slot for step in of_one} == {SLOT_OF[wavelength_nm]}
        assert {step.point for step in of_one} == set(range(4 * number, 4 * number + 4))
        assert of_one[0].kind == of_one[-1].kind == "reference"
        places = {(step.point - 4 * number, step.target.exit_deg) for step in of_one if step.kind == "signal"}
        assert places == {(0, 0.0), (1, 10.0), (2, 20.0), (3, 40.0)}


@settings(deadline=None, max_examples=60)
@given(st.permutations(list(SLOT_OF)), st.integers(2, 5))
def test_no_order_of_the_filters_takes_less_time_round_the_wheel(listed, count):
    """Against all permutations, from the first slot; it depends on the filters, not on how they are listed."""
    listed = listed[:count]
    order = list(dict.fromkeys(step.target.filter_slot for step in steps_of(tuple(listed))))

    def turns_s(visited):
        return sum(TIMING.filter.move_s(one, other) for one, other in itertools.pairwise((1, *visited)))

    best_s = min(map(turns_s, itertools.permutations(SLOT_OF[one] for one in listed)))
    assert turns_s(order) == pytest.approx(best_s)


def test_the_next_wavelength_begins_where_the_last_has_ended_and_the_change_is_in_its_time():
    steps = steps_of((450.0, 500.0))
    first = [step for step in steps if step.wavelength_nm == 450.0]
    second = [step for step in steps if step.wavelength_nm == 500.0]
    assert second[0].target.exit_deg == first[-1].target.exit_deg, "no way back"
    moving_s = Moving(TIMING)(first[-1].target, second[0].target)
    assert moving_s >= 2.0 + 0.25
    assert second[0].duration_s == pytest.approx(moving_s + TIMING.readings_s(2, 0.03))
    at_one = sum(step.duration_s for step in expand(recipe(450.0), slots(1), TIMING, first[-1].target))
    assert sum(step.duration_s for step in second) == pytest.approx(at_one + 2.0 + 0.25, abs=0.6)


def test_from_home_the_first_filter_takes_no_time_and_another_one_does():
    near, far = (expand(recipe(450.0), slots(slot), TIMING)[0].duration_s for slot in (1, 4))
    assert Moving(TIMING)(HOME, HOME) == 0.0
    assert far > 3 * 2.0
    assert near < 3.5


@dataclass
class Wheel:
    """A wheel that is at once where it is sent, unless somebody turns it."""

    name: str = "filters"
    at: int | None = 1
    sent: list = field(default_factory=list)

    def start_select(self, slot):
        self.sent.append(slot)
        self.at = slot

    def slot(self):
        return self.at


class Meter:
    def __init__(self):
        self.told_nm = []

    def set_wavelength_nm(self, wavelength_nm):
        self.told_nm.append(wavelength_nm)


FILTERS = {1: 450.0, 2: 500.0}


def test_the_meter_is_told_only_when_the_filter_changes():
    meter = Meter()
    told = ToldWavelength(Filters(Wheel(), FILTERS), meter)
    for slot in (1, 1, 2):
        told.tell(slot)
    assert meter.told_nm == [450.0, 500.0]
    told.forget()
    told.tell(2)
    assert meter.told_nm == [450.0, 500.0, 500.0], "a meter may have forgotten it"


def test_a_detector_that_does_not_depend_on_the_wavelength_is_told_nothing():
    ToldWavelength(Filters(Wheel(), {2: 500.0}), object()).tell(2)


@pytest.mark.parametrize(
    ("turned_to", "what"), [(1, r"slot 1 \(450 nm\)"), (5, r"slot 5 \(nothing\)"), (None, "no slot")]
)
def test_a_wheel_that_was_turned_by_hand_is_refused_and_sent_back_the_next_time(turned_to, what):
    wheel = Wheel()
    filters = Filters(wheel, FILTERS).selector()
    assert filters.begin(2)
    filters.arrived()
    assert not filters.begin(2)
    wheel.at = turned_to
    with pytest.raises(PositionError, match=rf"{what} is in the beam instead of slot 2 \(500 nm\)"):
        filters.require(2)
    assert filters.begin(2)
    filters.require(2)
