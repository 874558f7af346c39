"""Optimal designs: textbook cases, the equivalence theorem, and small problems solved by trying everything."""

import itertools

import numpy as np
import pytest
from numpy.testing import assert_allclose

from goniometer.errors import FitError
from model.design.design import Criterion, optimal_design
from model.design.information import information, standard_errors
from model.design.timed_design import timed_design
from model.fit import lobe_family
from model.geometry import in_plane

X = np.linspace(-1.0, 1.0, 21)
CRITERIA = [
    pytest.param(Criterion(), id="D"),
    pytest.param(Criterion(np.array([0.0, 1.0, 0.0, 0.0, 0.0])), id="c"),
    pytest.param(Criterion(np.array([0.0, 1.0, 0.0, 0.0, 0.0]), 0.1), id="c with others"),
]


def polynomial(degree, x=X):
    """Information (1, N, P, P) of readings of a polynomial, at each place."""
    rows = np.vander(x, degree + 1, increasing=True)
    return np.einsum("np,nq->npq", rows, rows)[None]


def glass(samples=1):
    """Information of directions on a ground glass, for some samples; neighbours half a degree apart."""
    family = lobe_family(
        ["specular", "diffuse", "directional"], free={"sigma": (0.02, 1.0), "n": (1.1, 4.0)}, fixed={"k": 0.0}
    )
    exit_rad, azimuth_rad = in_plane(np.radians(np.arange(0.0, 60.1, 0.5)))
    directions = (np.full(len(exit_rad), np.radians(60.0)), exit_rad, azimuth_rad)
    noise = np.tile(1e-6 * np.eye(3), (len(exit_rad), 1, 1))
    return np.array(
        [
            information(
                family,
                directions,
                noise,
                {"sigma": 0.12 + 0.04 * sample, "n": 1.5 + 0.1 * sample, "rho_s": 0.7, "rho_d": 0.1, "rho_dd": 0.05},
            )
            for sample in range(samples)
        ]
    )


@pytest.mark.parametrize("degree", [1, 2, 3])
def test_the_d_optimal_design_of_a_polynomial_is_guests(degree):
    """At the ends and where the derivative of Legendre's polynomial is 0, in equal parts (Guest 1958)."""
    places = {1: [-1.0, 1.0], 2: [-1.0, 0.0, 1.0], 3: [-1.0, -(5.0**-0.5), 5.0**-0.5, 1.0]}[degree]
    x = np.unique([*X, *places])
    design = optimal_design(polynomial(degree, x), Criterion(), tolerance=1e-8)
    assert_allclose(design.shares[np.isin(x, places)], 1.0 / (degree + 1), atol=1e-3)


@pytest.mark.parametrize(
    ("wanted", "expected"),
    [([0.0, 1.0, 0.0], {-1.0: 0.5, 1.0: 0.5}), ([0.0, 0.0, 1.0], {-1.0: 0.25, 0.0: 0.5, 1.0: 0.25})],
)
def test_the_c_optimal_design_of_a_parabola_is_elfvings(wanted, expected):
    """Also where it leaves the other parameters open, as the first does."""
    design = optimal_design(polynomial(2), Criterion(np.array(wanted)), tolerance=1e-6)
    assert_allclose(design.shares, [expected.get(round(x, 9), 0.0) for x in X], atol=2e-3)


@pytest.mark.parametrize("criterion", CRITERIA)
def test_gains_are_derivatives_of_the_criterion(criterion):
    pieces = glass(2)
    told, step = pieces[:, ::7].sum(axis=1), 1e-4
    for place in (0, 60, 119):
        up, down = (criterion.uncertainty(told + side * step * pieces[:, place]) for side in (1.0, -1.0))
        assert_allclose(criterion.gains(told, pieces)[place], (down - up) / (2.0 * step), rtol=1e-5)


@pytest.mark.parametrize("criterion", CRITERIA)
@pytest.mark.parametrize("samples", [1, 3])
def test_the_equivalence_theorem_holds(criterion, samples):
    """No direction gains more than the design's own, which all gain alike, within the tolerance."""
    pieces = glass(samples)
    design = optimal_design(pieces, criterion, tolerance=1e-5)
    told = np.einsum("n,snpq->spq", design.shares + 1e-6 / len(design.shares), pieces)
    gains = criterion.gains(told, pieces)
    assert_allclose(design.shares.sum(), 1.0)
    assert gains.max() <= 1.0 + 2e-5
    assert_allclose(gains[design.shares > 1e-3], 1.0, atol=1e-2)


@pytest.mark.parametrize("criterion", CRITERIA)
def test_no_other_shares_are_better(criterion):
    pieces = glass()
    design = optimal_design(pieces, criterion, tolerance=1e-3)
    random = np.random.default_rng(1)
    reached = criterion.uncertainty(np.einsum("n,snpq->spq", design.shares + 1e-9, pieces))
    for _ in range(200):
        other = random.dirichlet(np.where(random.random(pieces.shape[1]) < 0.1, 1.0, 1e-3))
        mixed = 0.9 * design.shares + 0.1 * other
        for shares in (other, mixed):
            assert criterion.uncertainty(np.einsum("n,snpq->spq", shares + 1e-9, pieces)) > reached - 1.1e-3


@pytest.mark.parametrize("criterion", CRITERIA)
def test_units_of_parameters_do_not_matter(criterion):
    scale = np.array([1e-6, 1e3, 1.0, 1e5, 1e-2])
    shares = optimal_design(glass(), criterion, tolerance=1e-6).shares
    wanted = None if criterion.wanted is None else criterion.wanted / scale
    other = optimal_design(glass() / np.outer(scale, scale), Criterion(wanted, criterion.alike), tolerance=1e-6).shares
    assert_allclose(np.cumsum(other), np.cumsum(shares), atol=0.02)


def test_what_is_known_beforehand_need_not_be_measured():
    """Of a line with a known height only the slope is left, which is measured at one end as well as at both."""
    known = np.diag([1e6, 0.0])
    design = optimal_design(polynomial(1), Criterion(), known, tolerance=1e-6)
    assert_allclose(design.shares[0] + design.shares[-1], 1.0, atol=1e-3)
    parabola = optimal_design(polynomial(2), Criterion(), np.diag([0.0, 0.0, 1e6]), tolerance=1e-6)
    assert_allclose(parabola.shares[[0, -1]], 0.5, atol=1e-2)


def test_what_nothing_determines_has_no_design():
    with pytest.raises(FitError, match="do not determine the parameters"):
        optimal_design(polynomial(2, np.array([-1.0, 1.0])), Criterion())


PLACES = np.array([-1.0, -0.6, 0.1, 0.5, 1.0])
READING_S = np.array([1.0, 1.0, 1.0, 1.0, 3.0])


def cost(places):
    """Two seconds a visit, and the way there and back."""
    chosen = PLACES[list(places)]
    return 2.0 * len(places) + float(np.abs(np.diff(chosen)).sum()), READING_S[list(places)]


@pytest.mark.parametrize("criterion", [Criterion(), Criterion(np.array([0.0, 1.0, 0.0]), 0.1)])
@pytest.mark.parametrize(("time_s", "worse"), [(12.0, 0.1), (16.0, 0.05), (22.0, 0.05)])
def test_a_timed_design_is_almost_the_best_of_all(criterion, time_s, worse):
    """Where there is time for four readings only, one of them is a large part."""
    pieces = polynomial(2, PLACES)
    best = np.inf
    for count in range(3, 6):
        for places in itertools.combinations(range(5), count):
            visits_s, reading_s = cost(places)
            for readings in itertools.product(range(1, 14), repeat=count):
                if visits_s + reading_s @ readings <= time_s:
                    told = np.einsum("n,npq->pq", readings, pieces[0, list(places)])
                    best = min(best, criterion.uncertainty(told[None]))
    readings = timed_design(pieces, criterion, cost, time_s, 100)
    visits_s, reading_s = cost(np.flatnonzero(readings))
    assert visits_s + reading_s @ readings[readings > 0] <= time_s
    assert criterion.uncertainty(np.einsum("n,snpq->spq", readings, pieces)) < best + worse


def test_more_time_never_tells_less():
    pieces = glass()

    def seconds(places):
        return 3.0 * len(places), np.full(len(places), 0.2)

    stderrs = [
        standard_errors(np.einsum("n,npq->pq", timed_design(pieces, Criterion(), seconds, time_s, 1000), pieces[0]))
        for time_s in (15.0, 30.0, 60.0, 120.0, 1200.0)
    ]
    assert (np.diff(np.prod(stderrs, axis=1)) < 0.0).all()


@pytest.mark.parametrize("time_s", [10.0, 11.0, 14.0, 60.0])
def test_the_search_finds_the_directions_that_trying_all_sets_finds(time_s):
    """Every set of directions 10 degrees apart is given the time by itself."""
    pieces, criterion = glass()[:, ::20], Criterion(np.eye(5)[1], 0.1)

    def reached(places):
        def seconds(chosen):
            return 3.0 * len(chosen), np.full(len(chosen), 0.2)

        try:
            readings = timed_design(pieces[:, list(places)], criterion, seconds, time_s, 1000)
        except FitError:
            return np.inf
        return criterion.uncertainty(np.einsum("n,snpq->spq", readings, pieces[:, list(places)]))

    sets = [places for count in (2, 3, 4) for places in itertools.combinations(range(7), count)]
    best = min(reached(places) for places in sets)
    assert reached(range(7)) < best + 1e-3


def test_what_costs_more_is_read_less():
    """Of a line that is read at its two ends, the determinant is largest when as much time is spent at either."""

    def unequal(places):
        return 0.0, np.array([1.0, 4.0])[list(places)]

    readings = timed_design(polynomial(1, np.array([-1.0, 1.0])), Criterion(), unequal, 160.0, 1000)
    assert_allclose(readings, [80, 20], atol=1)


def test_no_direction_is_read_more_often_than_allowed():
    readings = timed_design(polynomial(2, PLACES), Criterion(), cost, 40.0, 5)
    assert readings.max() == 5


def test_a_time_that_is_too_short_is_refused():
    with pytest.raises(FitError, match="5 s are not enough to visit"):
        timed_design(polynomial(2, PLACES), Criterion(), cost, 5.0, 100)
