"""Readings until something is reached: when they end, what is told, and that their errors keep their word."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pydantic import ValidationError

from acquisition.averaged import Averaged
from acquisition.averaging import Averaging
from acquisition.expand import HOME, Slots, expand
from acquisition.expected_noise import Detection, expected_readings
from acquisition.lamp_level import LampLevel
from acquisition.polarization import stokes_point
from acquisition.recipe import Recipe
from acquisition.reduce import NoiseModel, Radiometry, Reduction
from acquisition.rounds import Rounds
from acquisition.signal_to_noise import SignalToNoise, as_planned, ratio
from acquisition.steps import Step
from acquisition.timing import AxisTiming, BenchTiming, WheelTiming

SLOTS = Slots(polarizers={0.0: 2, 45.0: 3, 90.0: 4, 135.0: 5}, offset_deg=0.0, blocked=6, open=1)
ARM = AxisTiming(velocity_deg_s=20, acceleration_deg_s2=80, settle_s=0.05)
TIMING = BenchTiming(ARM, ARM, ARM, WheelTiming(slots=6, slot_s=0.5, settle_s=0.05))
NOISE = NoiseModel(2e-11, 0.003, True, 550.0)
EXPOSURE_S = 0.03
ONE_W = math.sqrt(float(NOISE.variance(np.zeros(1), np.array([EXPOSURE_S]))[0]))
"""Standard deviation of a reading in the dark."""
DETECTION = Detection(Radiometry(1e-4, 1e-4), NOISE)
REDUCTION = Reduction(DETECTION.radiometry, NOISE, has_dark=True)


def recipe(readings, **changes):
    return Recipe.model_validate(
        {
            "recipe": "x",
            "rig": "rig.yaml",
            "wavelength_nm": 550.0,
            "incidence_deg": 60.0,
            "exit_deg": [0.0, 20.0, 40.0],
            "analyzer_deg": [0.0, 45.0, 90.0, 135.0],
            "readings": readings,
            "exposure_s": EXPOSURE_S,
            "fit": {"lobes": ["diffuse"], "free": {"sigma": [0.1, 1.0]}, "fixed": {}},
            **changes,
        }
    )


def step(kind="signal", readings=1000, slot=2, point=0):
    return Step(point, kind, HOME._replace(slot=slot), 0.0, readings, EXPOSURE_S, 0.0)


def noisy(rng, power_w, scatter=1.0):
    variance = NOISE.variance(np.array([power_w]), np.array([EXPOSURE_S]))
    return power_w + scatter * math.sqrt(float(variance[0])) * rng.standard_normal()


# What a recipe may ask


def test_a_recipe_may_ask_for_a_ratio_or_an_error_of_the_dolp():
    to_ratio = recipe({"at_least": 2, "at_most": 60, "signal_to_noise": 200.0})
    assert to_ratio.readings_of_angles() == (60, 60, 60)
    assert to_ratio.is_steered
    assert not to_ratio.follows_fit
    assert str(to_ratio.averaging) == "2 to 60 readings in every slot until signal-to-noise 200"
    to_error = recipe({"at_least": 2, "at_most": 60, "dolp_error": 0.005})
    assert str(to_error.averaging) == "2 to 60 readings in every slot until the DoLP is known to ± 0.005"
    assert recipe(3).averaging is None
    assert not recipe(3).is_steered


@pytest.mark.parametrize(
    ("readings", "what"),
    [
        ({"at_least": 2, "at_most": 60}, "found neither"),
        ({"at_least": 2, "at_most": 60, "signal_to_noise": 9.0, "dolp_error": 0.1}, "found both"),
        ({"at_least": 9, "at_most": 9, "signal_to_noise": 9.0}, "more than at_least, which is 9"),
        ({"at_least": 2, "at_most": 9, "signal_to_noise": 4.9}, "greater than or equal to 5"),
    ],
)
def test_what_cannot_be_reached_or_is_not_said_is_refused(readings, what):
    with pytest.raises(ValidationError, match=what):
        recipe(readings)


@pytest.mark.parametrize("steering", [{"until": {"sigma": 0.1}}, {"adaptive": True}])
def test_a_scan_that_follows_its_fit_does_not_average_besides(steering):
    with pytest.raises(ValidationError, match="decides by its fit how often"):
        recipe({"at_least": 2, "at_most": 60, "dolp_error": 0.005}, time_limit_s=60.0, **steering)


# When a slot has been read often enough


def test_a_step_with_a_number_takes_that_number():
    assert [as_planned(step(readings=2), [1.0] * count) for count in range(4)] == [False, False, True, True]


def test_a_slot_is_read_until_its_mean_is_so_many_standard_errors():
    enough = SignalToNoise(20.0, 2, NOISE)
    powers_w = [4.0 * ONE_W] * 30  # 4 standard errors by one reading, 20 by 25; photon noise adds a little
    needed = next(count for count in range(30) if enough(step(), powers_w[:count]))
    assert needed == 26
    assert ratio(powers_w[:needed], EXPOSURE_S, NOISE) >= 20.0 > ratio(powers_w[: needed - 1], EXPOSURE_S, NOISE)


def test_a_slot_is_read_at_least_and_at_most_so_often():
    enough = SignalToNoise(20.0, 3, NOISE)
    assert [enough(step(), [1000 * ONE_W] * count) for count in range(4)] == [False, False, False, True]
    assert [enough(step(readings=5), [0.0] * count) for count in (3, 4, 5)] == [False, False, True]


def test_readings_that_lie_close_together_by_chance_do_not_end_it():
    assert not SignalToNoise(20.0, 2, NOISE)(step(), [4.0 * ONE_W] * 5)


def test_the_dark_slot_is_read_as_often_as_the_slot_of_its_direction_that_was_read_most():
    enough = SignalToNoise(20.0, 2, NOISE)
    assert enough(step(slot=2), [8.0 * ONE_W] * 7)
    assert enough(step(slot=3), [30.0 * ONE_W] * 2)
    assert enough(step(slot=2, point=1), [30.0 * ONE_W] * 3)
    dark = step("dark", slot=6)
    assert [enough(dark, [0.0] * count) for count in (0, 2, 6, 7)] == [False, False, False, True]
    assert [enough(replace(dark, point=1), [0.0] * count) for count in (2, 3)] == [False, True]


@pytest.mark.parametrize("within_s", [0.0, 60.0])
def test_the_dark_slot_comes_behind_the_others_of_its_direction(within_s):
    averaging = {"at_least": 2, "at_most": 10, "signal_to_noise": 200.0}
    exits = [float(angle) for angle in range(30)]
    steps = expand(recipe(averaging, exit_deg=exits, direction_within_s=within_s), SLOTS, TIMING)
    for point in range(30):
        of_point = [one.kind for one in steps if one.point == point]
        assert of_point == ["signal"] * 4 + ["dark"]
    assert {one.readings for one in steps} == {10}
    is_swept = any(one.point != other.point for one, other in itertools.pairwise(steps[:5]))
    assert is_swept == (within_s > 0.0)


# Errors of means that were ended by a rule


def coverage(rng, end, power_w, seeds):
    """Parts of the means within 1 and 1.96 of their standard errors, and how far off they are on average, in these."""
    off = []
    for _ in range(seeds):
        powers_w = []
        while not end(powers_w):
            powers_w.append(noisy(rng, power_w))
        off.append((np.mean(powers_w) - power_w) / end.stderr_w(powers_w))
    off = np.array(off)
    return np.mean(np.abs(off) < 1.0), np.mean(np.abs(off) < 1.96), np.mean(off)


class ByModel:
    """The rule of the program."""

    def __init__(self, wanted):
        self._enough = SignalToNoise(wanted, 2, NOISE)

    def __call__(self, powers_w):
        return self._enough(step(), powers_w)

    @staticmethod
    def stderr_w(powers_w):
        return np.mean(powers_w) / ratio(powers_w, EXPOSURE_S, NOISE)


class ByScatter:
    """The rule that ends when the readings happen to lie close together."""

    def __init__(self, wanted):
        self._wanted = wanted

    def __call__(self, powers_w):
        return len(powers_w) > 1 and np.mean(powers_w) / self.stderr_w(powers_w) >= self._wanted

    @staticmethod
    def stderr_w(powers_w):
        return np.std(powers_w, ddof=1) / math.sqrt(len(powers_w))


def within_chance(part, expected, seeds):
    """Whether a part of the seeds differs from the expected by less than 3.5 standard deviations."""
    return abs(part - expected) < 3.5 * math.sqrt(expected * (1.0 - expected) / seeds)


@pytest.mark.parametrize(("of_one", "wanted"), [(2.0, 10.0), (2.0, 20.0), (6.0, 20.0), (6.0, 60.0)])
def test_stated_errors_cover_68_and_95_percent_whenever_the_rule_ends(of_one, wanted):
    one, two, off = coverage(np.random.default_rng(3), ByModel(wanted), of_one * ONE_W, 500)
    assert within_chance(one, 0.6827, 500)
    assert within_chance(two, 0.95, 500)
    assert abs(off) < 1.0 / wanted + 3.5 / math.sqrt(500)


def test_a_rule_by_the_observed_scatter_would_not():
    one, two, _ = coverage(np.random.default_rng(3), ByScatter(20.0), 6.0 * ONE_W, 500)
    assert one < 0.55
    assert two < 0.80


def light(s0, dolp, angle_deg=30.0):
    turn = 2.0 * math.radians(angle_deg)
    return np.array([s0, s0 * dolp * math.cos(turn), s0 * dolp * math.sin(turn), 0.0])


def measured(rng, steps, stokes, enough=as_planned, before=()):
    """Readings with noise of steps at one direction."""
    readings = list(before)
    for one in steps:
        (sure,) = expected_readings([replace(one, readings=1)], lambda *_: stokes[None], DETECTION)
        powers_w = []
        while not enough(one, powers_w):
            powers_w.append(noisy(rng, sure.power_w))
        readings += [replace(sure, power_w=power_w, repeat=k) for k, power_w in enumerate(powers_w, one.first_repeat)]
    return readings


def to_ratio(rng, stokes, wanted):
    averaging = {"at_least": 2, "at_most": 2000, "signal_to_noise": wanted}
    steps = expand(recipe(averaging, exit_deg=[20.0]), SLOTS, TIMING)
    return REDUCTION.point(measured(rng, steps, stokes, SignalToNoise(wanted, 2, NOISE)), LampLevel())


def to_error(rng, stokes, wanted, at_most=5000):
    averaging = recipe({"at_least": 2, "at_most": at_most, "dolp_error": wanted}, exit_deg=[20.0])
    rounds = Rounds(expand(averaging, SLOTS, TIMING), averaging.averaging, TIMING, lambda saved_s: None)
    readings = []
    while steps := rounds.next(()):
        readings = measured(rng, steps, stokes, before=readings)
        rounds.has_measured(lambda taken=readings: REDUCTION.point(taken, LampLevel()))
    return REDUCTION.point(readings, LampLevel())


@pytest.mark.parametrize(
    ("average", "wanted"), [(to_ratio, 20.0), (to_ratio, 60.0), (to_error, 0.02), (to_error, 0.01)]
)
def test_errors_of_reduced_directions_keep_their_word(average, wanted):
    stokes, seeds = light(0.02, 0.4), 300
    points = [average(np.random.default_rng(seed), stokes, wanted) for seed in range(seeds)]
    dolp = np.array([(point.dolp - 0.4) / point.dolp_stderr for point in points])
    for off in (
        dolp,
        *(np.array([(p.stokes[k] - stokes[k]) / p.covariance[k, k] ** 0.5 for p in points]) for k in range(3)),
    ):
        assert within_chance(np.mean(np.abs(off) < 1.0), 0.6827, seeds)
        assert within_chance(np.mean(np.abs(off) < 1.96), 0.95, seeds)


# Rounds


def rounds_of(averaging, saved=None, **changes):
    scan = recipe(averaging, direction_within_s=0.0, **changes)
    return Rounds(expand(scan, SLOTS, TIMING), scan.averaging, TIMING, [].append if saved is None else saved.append)


def known_to(stderr):
    sure = REDUCTION.point(measured(np.random.default_rng(1), STEPS, light(0.1, 0.3)), LampLevel())
    return lambda: replace(sure, dolp_stderr=stderr)


STEPS = expand(recipe(3, exit_deg=[20.0]), SLOTS, TIMING)
TO_ERROR = {"at_least": 2, "at_most": 60, "dolp_error": 0.01}


def test_a_direction_that_is_known_well_enough_has_one_round():
    rounds, visited = rounds_of(TO_ERROR), []
    while steps := rounds.next(()):
        assert {one.readings for one in steps} == {2}
        visited.append([(one.point, one.target.exit_deg) for one in steps])
        assert rounds.has_measured(known_to(0.01))
    assert visited == [[(0, 0.0)] * 5, [(1, 20.0)] * 5, [(2, 40.0)] * 5]


def test_a_further_round_takes_what_is_wanting_in_the_opposite_order_without_another_reference():
    reference = {"exit_deg": 10.0, "every_points": 1}
    rounds = rounds_of(TO_ERROR, reference=reference, exit_deg=[20.0])
    first = rounds.next(())
    assert [one.kind for one in first] == ["reference"] + ["signal"] * 4 + ["dark"]
    assert not rounds.has_measured(known_to(0.015))  # 2 readings times 1.5 squared are 4.5
    second = rounds.next(())
    assert [one.target.slot for one in second] == [one.target.slot for one in first[:0:-1]]
    assert {(one.readings, one.first_repeat) for one in second} == {(3, 2)}
    assert rounds.has_measured(known_to(0.009))


def test_the_reference_that_closes_a_scan_is_read_once():
    rounds = rounds_of(TO_ERROR, reference={"exit_deg": 10.0, "every_points": 5}, exit_deg=[20.0, 30.0])
    kinds = []
    while steps := rounds.next(()):
        kinds.append([steps[0].kind])
        assert rounds.has_measured(known_to(0.001))
    assert [kind for (kind,) in kinds] == ["reference", "dark", "reference"]


def test_rounds_grow_and_end_at_the_most_readings():
    for stderr in (0.0101, 0.1, math.nan):
        rounds, sizes = rounds_of(TO_ERROR, exit_deg=[20.0]), []
        while steps := rounds.next(()):
            sizes.append(steps[0].readings)
            rounds.has_measured(known_to(stderr))
        assert sum(sizes) == 60
        assert all(0.5 * sum(sizes[:k]) <= sizes[k] <= 3 * sum(sizes[:k]) for k in range(1, len(sizes) - 1))


def test_the_time_of_a_scan_lies_between_the_least_and_the_longest():
    saved = []
    shortest_s, longest_s = rounds_of(TO_ERROR).shortest_s(), rounds_of(TO_ERROR).longest_s()
    for stderr, expected_s in ((0.005, shortest_s), (0.0101, longest_s)):
        rounds, took_s = rounds_of(TO_ERROR, saved), 0.0
        while steps := rounds.next(()):
            took_s += sum(one.duration_s for one in steps)
            rounds.has_measured(known_to(stderr))
        assert_allclose(took_s, expected_s, rtol=0.01)
        assert_allclose(took_s + sum(saved), longest_s, rtol=0.01)
        saved.clear()


# What is told


def averaged(**wanted):
    return Averaged(Averaging(at_least=2, at_most=60, **wanted), NOISE)


def point_of(readings, **changes):
    sure = stokes_point(readings[0], np.array([0.1, 0.03, 0.0]), np.eye(3) * 1e-6)
    return replace(sure, point=readings[0].point, **changes)


def taken(rng, power_w, count, kind="signal", point=0, scatter=1.0):
    (sure,) = expected_readings([step(kind, readings=1, point=point)], lambda *_: light(1.0, 0.0)[None], DETECTION)
    return [replace(sure, power_w=noisy(rng, power_w, scatter), repeat=k) for k in range(count)]


def test_what_is_short_of_the_wanted_ratio_is_told_slot_by_slot():
    rng = np.random.default_rng(5)
    readings = taken(rng, 100 * ONE_W, 60) + taken(rng, 0.0, 60, "dark")
    assert averaged(signal_to_noise=200.0).shortfall(readings, point_of(readings)) == ""
    told = averaged(signal_to_noise=2000.0).shortfall(readings, point_of(readings))
    assert told.startswith("slot 2 signal-to-noise 7")
    assert told.endswith("after 60")


def test_what_is_short_of_the_wanted_error_of_the_dolp_is_told():
    readings = taken(np.random.default_rng(5), 100 * ONE_W, 60)
    short = averaged(dolp_error=0.01)
    assert short.shortfall(readings, point_of(readings, dolp_stderr=0.01)) == ""
    told = short.shortfall(readings, point_of(readings, dolp_stderr=0.02))
    assert told == "DoLP ± 0.02 after 60 readings in every slot, ± 0.01 wanted"
    assert "S0 is not positive" in short.shortfall(readings, point_of(readings, dolp_stderr=math.nan))


def test_the_directions_that_fall_short_are_named_at_the_end():
    readings = [one for point in range(4) for one in taken(np.random.default_rng(point), ONE_W, 9, point=point)]
    points = [
        point_of([one for one in readings if one.point == point], dolp_stderr=stderr)
        for point, stderr in enumerate((0.02, 0.005, 0.02, 0.02))
    ]
    (told,) = averaged(dolp_error=0.01).doubts(readings, points)
    assert "was not reached at points 0, 2 to 3 (3 of 4)" in told
    assert averaged(dolp_error=0.1).doubts(readings, points) == ()


@pytest.mark.parametrize(("scatter", "is_told"), [(1.0, False), (1.05, False), (1.5, True)])
def test_readings_that_scatter_by_more_than_the_rig_file_says_are_told(scatter, is_told):
    rng = np.random.default_rng(5)
    readings = [one for point in range(200) for one in taken(rng, 50 * ONE_W, 4, point=point, scatter=scatter)]
    told = averaged(signal_to_noise=5.0).doubts(readings, ())
    assert bool(told) == is_told
    if told:
        assert "scatter 1.5 times as much as the noise in the rig file says (600 degrees of freedom)" in told[0]
