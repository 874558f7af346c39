"""Scans that decide as they go, on light and noise alone: when they end, and where they look."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acquisition import steering
from acquisition.adaptive import Adaptive, first_exits_deg
from acquisition.course import Passes, Situation
from acquisition.events import DirectionChosen, FitRefused, FitUpdated
from acquisition.expand import HOME, Slots, Visits
from acquisition.expected_noise import Detection, expected_points, light_of
from acquisition.fit_points import dataset, surface_family
from acquisition.recipe import Recipe
from acquisition.reduce import NoiseModel, Radiometry
from acquisition.stays import Prospect, plan, time_needed_s
from acquisition.steering import Steering
from acquisition.timing import READING_S, AxisTiming, BenchTiming, WheelTiming
from acquisition.wanted import judge
from model.design.design import Criterion
from model.design.information import information, standard_errors
from model.design.timed_design import timed_design
from model.fit import follow
from model.fit.result import Alternative
from model.lobes import Diffuse, Directional, Specular
from model.surface import Surface

SLOTS = Slots(polarizers={0.0: 2, 45.0: 3, 90.0: 4, 135.0: 5}, offset_deg=0.0, blocked=6, open=1)
ARM = AxisTiming(velocity_deg_s=20, acceleration_deg_s2=80, settle_s=0.05)
DETECTION = Detection(Radiometry(1e-4, 1e-4), NoiseModel(2e-11, 0.003, True, 550.0))
IRON = {"sigma": 0.1764, "n": 2.95, "k": 2.932, "rho_s": 0.7, "rho_d": 0.1, "rho_dd": 0.05}
GLASS = {"sigma": 0.12, "n": 1.523, "rho_s": 0.7, "rho_d": 0.1, "rho_dd": 0.05}
METAL = {"lobes": ["specular", "diffuse", "directional"], "free": {"sigma": [0.02, 1], "n": [1, 6], "k": [0, 8]}}
DIELECTRIC = METAL | {"free": {"sigma": [0.02, 1], "n": [1.1, 4]}, "fixed": {"k": 0.0}}


def recipe(**changes):
    return Recipe.model_validate(
        {
            "recipe": "x",
            "rig": "rig.yaml",
            "wavelength_nm": 550.0,
            "incidence_deg": 60.0,
            "exit": {"start_deg": 0.0, "stop_deg": 60.0, "step_deg": 1.0},
            "analyzer_deg": [0.0, 45.0, 90.0, 135.0],
            "readings": 3,
            "exposure_s": 0.03,
            "fit": METAL,
            "time_limit_s": 600.0,
            **changes,
        }
    )


def surface_of(values):
    index = complex(values["n"], values.get("k", 0.0))
    return Surface(
        [
            Specular(values["rho_s"], values["sigma"], index),
            Diffuse(values["rho_d"], values["sigma"]),
            Directional(values["rho_dd"], values["sigma"], index),
        ]
    )


class Bench:
    """Measures a surface with noise, on a clock that goes by the plan; remembers what it was told and where it was."""

    def __init__(self, scan, surface, seed=1, arm=ARM):
        self.surface, self.now_s, self.events, self.points, self.visits = surface, 0.0, [], [], []
        self._random = np.random.default_rng(seed)
        self.family = surface_family(scan.fit, 1e-4)
        timing = BenchTiming(ARM, arm, ARM, WheelTiming(slots=6, slot_s=0.5, settle_s=0.05))
        self.maker = Visits(scan, SLOTS, timing)
        choose = Adaptive(scan, self.maker, self.family, DETECTION) if scan.adaptive else Passes(scan)
        self.begun_s = []
        self.closing = ()
        self.steering = Steering(scan, self.maker, self.family, choose, self, self.events.append)

    def now(self):
        return self.now_s

    def sleep(self, duration_s):
        self.now_s += duration_s

    def run(self):
        while steps := self.steering.next(tuple(self.points)):
            self.begun_s.append(self.now_s)
            self.sleep(sum(step.duration_s for step in steps))
            if {step.kind for step in steps} == {"reference"}:
                self.closing = steps
                continue
            (point,) = expected_points(steps, light_of(self.surface), DETECTION)
            noise = np.linalg.cholesky(point.covariance) @ self._random.standard_normal(3)
            self.points.append(replace(point, stokes=point.stokes + noise))
            self.visits.append((point.exit_deg, steps[-1].readings))
        return self

    @property
    def result(self):
        return next(event.result for event in reversed(self.events) if isinstance(event, FitUpdated))

    def told(self, values, visits):
        """Information of visits on a sample that is known."""
        points = [
            expected_points(self.maker.steps(1, exit_deg, readings, HOME), light_of(self.surface), DETECTION)[0]
            for exit_deg, readings in visits
        ]
        data = dataset(points)
        return information(self.family, data.directions, data.covariance, values)


# What a fit is worth


@pytest.fixture(scope="module")
def fitted():
    scan = recipe(exit_deg=[0.0, 5.0, 20.0, 40.0, 50.0, 60.0], exit=None, time_limit_s=25.0, until={"n": 1e-6})
    return Bench(scan, surface_of(IRON)).run().result


def test_a_fit_is_as_certain_as_wanted_when_every_error_is_small_enough(fitted):
    n, sigma = (fitted.parameters[name].stderr for name in ("n", "sigma"))
    reached = judge(fitted, {"n": n * 1.01, "sigma": sigma * 1.01})
    assert reached.is_reached
    assert reached.standing == f"n {n:.3g} <= {n * 1.01:g}, sigma {sigma:.3g} <= {sigma * 1.01:g}"
    missed = judge(fitted, {"n": n * 0.9, "sigma": sigma * 0.5})
    assert missed.unmet == ("sigma", "n"), "the one farther off comes first"
    assert f"n {n:.3g} > {n * 0.9:g}" in missed.standing


def test_a_parameter_at_its_bound_is_not_known(fitted):
    at_bound = replace(fitted.parameters["n"], stderr=None, at_bound=True)
    result = replace(fitted, parameters={**fitted.parameters, "n": at_bound})
    judgement = judge(result, {"n": 1.0})
    assert judgement.unmet == ("n",)
    assert judgement.standing == "n at its bound"


def test_a_fit_that_misses_the_data_is_doubted(fitted):
    judgement = judge(replace(fitted, chi_square=99.0, p_value=1e-9), {"n": 1.0})
    assert not judgement.unmet
    assert not judgement.is_reached
    assert "misses the data by more than their noise (chi-square 99" in judgement.doubts[0]
    assert not judge(replace(fitted, degrees_of_freedom=0, p_value=None), {"n": 1.0}).is_reached


def test_another_optimum_is_a_doubt_when_it_is_farther_than_the_wanted_error(fitted):
    n = fitted.parameters["n"].value
    near, far = ({**fitted.values, "n": n + 0.5 * side} for side in (1.0, 3.0))
    assert judge(replace(fitted, alternatives=(Alternative(near, 1.5),)), {"n": 1.0}).is_reached
    doubted = judge(replace(fitted, alternatives=(Alternative(far, 1.5),)), {"n": 1.0})
    assert not doubted.is_reached
    assert "with a chi-square only 1.5 higher" in doubted.doubts[0]


def test_angles_are_wanted_in_degrees():
    free = {**METAL["free"], "exit_offset_deg": [-1.0, 1.0]}
    scan = recipe(until={"exit_offset_deg": 1e-9}, fit=METAL | {"free": free}, time_limit_s=150.0)
    result = Bench(scan, surface_of(IRON)).run().result
    stderr_deg = np.degrees(result.parameters["exit_offset_rad"].stderr)
    assert judge(result, {"exit_offset_deg": stderr_deg * 1.01}).is_reached
    assert not judge(result, {"exit_offset_deg": stderr_deg * 0.99}).is_reached


# When a scan along a list ends


SHORT = {"exit": {"start_deg": 0.0, "stop_deg": 60.0, "step_deg": 6.0}}


def test_the_scan_ends_with_the_first_point_that_makes_the_fit_certain_enough():
    bench = Bench(recipe(until={"n": 0.1}), surface_of(IRON)).run()
    assert bench.steering.reason.startswith("wanted standard errors reached: n 0.")
    updates = [event for event in bench.events if isinstance(event, FitUpdated)]
    errors = {event.points: event.result.parameters["n"].stderr for event in updates}
    last = len(bench.points)
    assert last < 61
    assert errors[last] <= 0.1 < errors[last - 1]


def test_a_list_that_is_not_enough_is_gone_through_back_and_forth():
    scan = recipe(**SHORT, until={"n": 0.05})
    bench = Bench(scan, surface_of(IRON)).run()
    there = [float(exit_deg) for exit_deg in scan.exit_angles_deg()]
    visited = [exit_deg for exit_deg, _ in bench.visits]
    assert len(visited) > len(there)
    assert visited == (there + there[::-1] + there)[: len(visited)]
    assert [point.point for point in bench.points] == list(range(len(visited)))
    assert bench.result.parameters["n"].stderr <= 0.05


def test_readings_that_differ_by_angle_stay_with_their_angles():
    angles, readings = [0.0, 10.0, 40.0, 60.0], [1, 2, 3, 4]
    bench = Bench(
        recipe(exit=None, exit_deg=angles, readings=readings, until={"n": 1e-6}, time_limit_s=60.0), surface_of(IRON)
    )
    visits = bench.run().visits
    assert set(visits) == set(zip(angles, readings, strict=True))
    assert visits[4:8] == visits[3::-1]


@pytest.mark.parametrize("adaptive_too", [False, True])
def test_no_direction_begins_that_would_end_after_the_time_limit(adaptive_too):
    bench = Bench(recipe(**SHORT, until={"n": 1e-4}, adaptive=adaptive_too, time_limit_s=100.0), surface_of(IRON)).run()
    assert 90.0 < bench.now() <= 100.0
    stderr = bench.result.parameters["n"].stderr
    assert bench.steering.reason == (
        f"time limit of 100 s: wanted standard errors not reached: n {stderr:.3g} > 0.0001"
    )


@pytest.mark.parametrize("adaptive_too", [False, True])
def test_a_reference_closes_the_scan_within_the_time_limit(adaptive_too):
    """From where the last direction leaves the bench, and never twice."""
    reference = {"exit_deg": 0.0, "every_points": 5}
    scan = recipe(until={"n": 1e-6}, adaptive=adaptive_too, time_limit_s=40.0, reference=reference)
    bench = Bench(scan, surface_of(IRON)).run()
    (closing,) = bench.closing
    assert (closing.kind, closing.point) == ("reference", len(bench.points) - 1)
    assert bench.steering.next(tuple(bench.points)) == ()
    assert bench.now_s <= 40.0
    without = Bench(scan.model_copy(update={"reference": None}), surface_of(IRON)).run()
    assert without.closing == ()


def test_a_model_that_misses_the_data_ends_nothing_early():
    """Half of this iron has a second, rougher finish, of which the fit does not know."""
    surface = Surface([*surface_of(IRON).lobes, *surface_of({**IRON, "sigma": 0.5}).lobes])
    for adaptive_too in (False, True):
        bench = Bench(recipe(**SHORT, until={"n": 5.0}, adaptive=adaptive_too, time_limit_s=100.0), surface).run()
        assert bench.now() > 90.0
        assert bench.result.parameters["n"].stderr < 5.0
        assert "the model misses the data by more than their noise" in bench.steering.reason
        assert "not to be trusted" in bench.steering.reason


def test_an_optimum_that_was_followed_is_searched_for_again_before_it_ends_the_scan(monkeypatch):
    def overconfident(*data, **how):
        result = follow(*data, **how)
        small = {name: replace(estimate, stderr=1e-9) for name, estimate in result.parameters.items()}
        return replace(result, parameters=small)

    monkeypatch.setattr(steering, "follow", overconfident)
    bench = Bench(recipe(**SHORT, until={"n": 1e-6}, time_limit_s=60.0), surface_of(IRON)).run()
    assert bench.now() > 50.0
    assert "not reached" in bench.steering.reason


@pytest.mark.parametrize("adaptive_too", [False, True])
def test_a_fault_of_the_fit_costs_the_scan_nothing(monkeypatch, adaptive_too):
    def broken(data, family, **how):
        raise ZeroDivisionError("a bug")

    monkeypatch.setattr(steering, "fit", broken)
    bench = Bench(recipe(**SHORT, until={"n": 0.1}, adaptive=adaptive_too, time_limit_s=60.0), surface_of(IRON)).run()
    assert bench.now() > 50.0
    assert all(isinstance(event, FitRefused) for event in bench.events if not isinstance(event, DirectionChosen))
    assert "because the fit has stopped: ZeroDivisionError: a bug" in bench.steering.reason
    if adaptive_too:
        assert len({exit_deg for exit_deg, _ in bench.visits}) == min(len(bench.visits), 11), "all angles, in turn"


# Where an adaptive scan looks


def chosen(bench):
    return [event for event in bench.events if isinstance(event, DirectionChosen)]


@pytest.mark.parametrize(
    ("ends", "expected"),
    [((0.0, 60.0), [0.0, 20.0, 40.0, 60.0]), ((-80.0, 10.0), [10.0, -20.0, -50.0, -80.0])],
)
def test_the_first_directions_are_spread_over_all(ends, expected):
    scan = recipe(adaptive=True, exit={"start_deg": ends[0], "stop_deg": ends[1], "step_deg": 2.0})
    assert first_exits_deg(scan, surface_family(scan.fit, 1e-4)) == expected


def test_the_same_readings_lead_to_the_same_scan():
    scan = recipe(adaptive=True, until={"n": 0.02})
    first, second = (Bench(scan, surface_of(IRON)).run() for _ in range(2))
    assert first.visits == second.visits
    assert first.steering.reason == second.steering.reason
    assert Bench(scan, surface_of(IRON), seed=2).run().visits != first.visits


def test_stays_keep_to_their_limits():
    bench = Bench(recipe(adaptive=True, time_limit_s=200.0, readings=5), surface_of(IRON)).run()
    for (exit_deg, readings), begun_s in zip(bench.visits[4:], bench.begun_s[4:], strict=True):
        assert exit_deg in range(61)
        assert 5 <= readings <= 1000
        assert readings == 5 or readings * 5 * (0.03 + READING_S) <= 2.0 * begun_s
    assert 190.0 < bench.now() <= 200.0
    visited = [exit_deg for exit_deg, _ in bench.visits]
    assert len(set(visited)) < len(visited), "a direction that tells much is measured again"


def best_known(bench, values, name, time_s):
    """Standard error after a time of the design that knows the sample, and where that design measures."""
    exit_deg = np.arange(0.0, 61.0)
    pieces = bench.told(values, [(angle_deg, 1) for angle_deg in exit_deg])

    def cost(places):
        here, total_s = HOME, 0.0
        for place in places:
            steps = bench.maker.steps(1, float(exit_deg[place]), 0, here)
            here, total_s = steps[-1].target, total_s + sum(step.duration_s for step in steps)
        return total_s, np.full(len(places), 5 * 0.035)

    parameter = bench.family.names.index(name)
    wanted = Criterion(np.eye(len(bench.family.names))[parameter])
    readings = timed_design(pieces[None], wanted, cost, time_s, 10_000)
    told = np.einsum("n,npq->pq", readings, pieces)
    return float(standard_errors(told)[parameter])


@pytest.mark.parametrize(("values", "choice"), [(IRON, METAL), (GLASS, DIELECTRIC)], ids=["iron", "glass"])
def test_after_as_long_as_the_uniform_recipe_n_is_known_almost_as_well_as_by_the_best_design(values, choice):
    scan = recipe(adaptive=True, until={"n": 1e-6}, fit=choice, time_limit_s=207.0)
    bench = Bench(scan, surface_of(values)).run()
    parameter = bench.family.names.index("n")
    reached = standard_errors(bench.told(values, bench.visits).sum(axis=0))[parameter]
    assert_allclose(bench.result.parameters["n"].stderr, reached, rtol=0.1)
    assert reached < 1.12 * best_known(bench, values, "n", 207.0)
    uniform = bench.told(values, [(angle_deg, 3) for angle_deg in np.arange(0.0, 61.0)]).sum(axis=0)
    assert reached < standard_errors(uniform)[parameter] / 3.5


def test_a_slow_arm_is_moved_less():
    """Motion is part of the price: what is told per second decides."""
    travel_deg = []
    for velocity_deg_s in (200.0, 1.0):
        arm = AxisTiming(velocity_deg_s, 80.0, 0.05)
        bench = Bench(recipe(adaptive=True, time_limit_s=300.0), surface_of(IRON), arm=arm).run()
        travel_deg.append(np.abs(np.diff([exit_deg for exit_deg, _ in bench.visits[3:]])).sum() / len(bench.visits[4:]))
    assert travel_deg[1] < 0.7 * travel_deg[0]


def situation(bench, result, here=HOME, left_s=400.0):
    return Situation(bench.points, result, ("n",), here, 60.0, left_s)


@pytest.fixture
def begun():
    """An adaptive scan after its first directions, with what would choose the next one."""
    scan = recipe(adaptive=True, until={"n": 0.01, "sigma": 1e-5}, time_limit_s=25.0)
    bench = Bench(scan, surface_of(IRON)).run()
    return bench, Adaptive(scan, bench.maker, bench.family, DETECTION)


def test_what_is_farthest_from_its_aim_is_looked_for_first(begun):
    bench, choose = begun
    both = replace(situation(bench, bench.result), unmet=("n", "sigma"))
    assert choose(both).why == "tells most about n per second"


def test_another_aim_makes_another_scan():
    wanted = {"n": 0.05, "rho_d": 1e-4}
    bench = Bench(recipe(adaptive=True, until=wanted, time_limit_s=100.0), surface_of(IRON)).run()
    whys = [event.why for event in chosen(bench)]
    assert "tells most about rho_d per second" in whys
    assert "rho_d" in chosen(bench)[-1].standing
    rho_d = bench.result.parameters["rho_d"].stderr
    for_n = Bench(recipe(adaptive=True, until={"n": 1e-6}, time_limit_s=100.0), surface_of(IRON)).run()
    assert rho_d < 0.6 * for_n.result.parameters["rho_d"].stderr


def test_two_optima_are_told_apart_where_they_differ(begun):
    bench, choose = begun
    other = {**bench.result.values, "rho_dd": 0.0}
    result = replace(bench.result, alternatives=(Alternative(other, 1.0),))
    choose._elsewhere_s = 1e9
    visit = choose(situation(bench, result))
    assert "apart" in visit.why
    assert visit.exit_deg == 0.0, "the directional lobe is bright at the normal alone"


def test_a_part_of_the_time_goes_far_from_everything_that_was_measured(begun):
    bench, choose = begun
    assert "tells most" in choose(situation(bench, bench.result)).why
    visit = choose(replace(situation(bench, bench.result), elapsed_s=300.0))
    assert "far from all others" in visit.why
    nearest_deg = min(abs(visit.exit_deg - exit_deg) for exit_deg, _ in bench.visits)
    assert nearest_deg >= 10.0
    steps = bench.maker.steps(len(bench.points), visit.exit_deg, visit.readings, HOME)
    choose.chosen(visit, sum(step.duration_s for step in steps))
    assert "tells most" in choose(replace(situation(bench, bench.result), elapsed_s=310.0)).why, "only a part"


def test_where_no_fit_describes_the_data_the_gaps_are_filled(begun):
    bench, choose = begun
    visit = choose(situation(bench, replace(bench.result, p_value=1e-9)))
    assert "no fit describes the data" in visit.why
    assert choose(situation(bench, None)).exit_deg == visit.exit_deg


def test_nothing_is_chosen_that_does_not_fit_into_the_time(begun):
    bench, choose = begun
    assert choose(situation(bench, bench.result, left_s=2.0)) is None
    visit = choose(situation(bench, bench.result, left_s=12.0))
    assert sum(step.duration_s for step in bench.maker.steps(9, visit.exit_deg, visit.readings, HOME)) <= 12.0


def test_a_rare_peak_between_the_first_directions_is_found():
    """A smooth sample reflects within a few degrees of the mirror direction, between two of the first directions."""
    values = {**IRON, "sigma": 0.03}
    scan = recipe(
        adaptive=True,
        until={"n": 0.3},
        exit={"start_deg": -75.0, "stop_deg": 84.0, "step_deg": 1.0},
        time_limit_s=300.0,
    )
    bench = Bench(scan, surface_of(values)).run()
    assert bench.steering.reason.startswith("wanted standard errors reached")
    n = bench.result.parameters["n"]
    assert abs(n.value - values["n"]) < 4.0 * n.stderr
    assert any(abs(exit_deg - 60.0) < 8.0 for exit_deg, _ in bench.visits)


# What time is best spent on


def two_places(visit_s):
    """Two parameters; one end of the list tells of the first, the other end of the second, what is between of none."""
    pieces = np.zeros((7, 2, 2))
    pieces[0, 0, 0], pieces[6, 1, 1] = 1.0, 4.0
    return Prospect(np.diag([0.1, 0.1]), pieces, np.interp(range(7), [0, 6], visit_s), 0.5)


def test_a_plan_stays_only_where_something_wanted_is_told():
    stays = plan(two_places([3.0, 3.0]), 1, 23.0)
    assert stays.places == (6,)
    assert_allclose(stays.readings, [40.0], rtol=0.01)
    assert_allclose(stays.stderr, [1 / np.sqrt(0.1), 1 / np.sqrt(0.1 + 4 * 40)], rtol=0.01)


def test_all_parameters_alike_share_the_time_unless_a_visit_costs_too_much():
    shared = plan(two_places([3.0, 3.0]), None, 26.0)
    assert sorted(shared.places) == [0, 6]
    assert_allclose(shared.readings, [20.0, 20.0], rtol=0.05)
    assert plan(two_places([3.0, 25.9]), None, 26.0).places == (0,)
    assert plan(two_places([3.0, 3.0]), None, 2.0) is None


def test_the_time_needed_is_the_time_after_which_enough_is_known():
    prospect = two_places([3.0, 3.0])
    needed_s = time_needed_s(prospect, 1, 0.1, 1000.0)
    assert_allclose(needed_s, 3.0 + (100 - 0.1) / 4 * 0.5, rtol=0.05)
    assert plan(prospect, 1, needed_s).stderr[1] <= 0.1
    assert time_needed_s(prospect, 1, 1e-6, 50.0) == 50.0


def test_far_directions_are_looked_at_again_in_turn(begun):
    bench, choose = begun
    seen = []
    for _ in range(130):
        visit = choose(situation(bench, None))
        seen.append(visit.exit_deg)
        bench.points.append(replace(bench.points[0], exit_deg=visit.exit_deg + 0.001))
    assert len(set(seen)) == 61, "every angle"
    assert max(seen.count(angle) for angle in set(seen)) <= 3
