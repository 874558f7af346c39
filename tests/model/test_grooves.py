"""Any number of bounces in symmetric and asymmetric grooves: a table made at 60 digits, and what must hold anywhere."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from model.vgroove import bounce_mueller, bounce_stokes

TABLE = Path(__file__).parent.parent / "golden" / "vgroove_bounces.csv"
HORIZON = np.pi / 2.0
PERFECT = 1.0 + 1e8j  # reflects all but 4e-16
GLASS, IRON = 1.5 + 0j, 2.95 + 2.932j
REVERSAL, MIRROR = np.diag([1.0, 1.0, 1.0, -1.0]), np.diag([1.0, 1.0, -1.0, -1.0])
# Stokes = STATES · (E ⊗ E*).
STATES = np.array([[1, 0, 0, 1], [1, 0, 0, -1], [0, 1, 1, 0], [0, -1j, 1j, 0]])

polar = st.one_of(st.floats(0.0, np.radians(89.9999)), st.sampled_from([0.0, 1e-8, 0.5, np.radians(89.9999), HORIZON]))
azimuth = st.one_of(st.floats(-7.0, 7.0), st.sampled_from([0.0, np.pi, np.pi - 1e-9, -np.pi + 1e-9, 1e-300]))
bounces = st.integers(1, 9)
roughness = st.floats(-4.0, 1.0).map(lambda exponent: 10.0**exponent)
asymmetry = st.one_of(st.just(0.0), st.floats(0.0, 1.0, exclude_max=True))
index = st.one_of(
    st.builds(complex, st.floats(0.05, 8.0), st.one_of(st.just(0.0), st.floats(0.0, 100.0))),
    st.sampled_from([1.0 + 1e-9 + 0j, 1.0 + 0j, 0.5 + 0j, 0.5 + 1e-12j]),
)


def eigenvalues(mueller: np.ndarray) -> np.ndarray:
    """Of the Hermitian matrices that must not be negative for physical Mueller matrices (Cloude 1986)."""
    transfer = np.linalg.inv(STATES) @ mueller @ STATES
    grid = transfer.reshape(*mueller.shape[:-2], 2, 2, 2, 2)
    return np.linalg.eigvalsh(np.swapaxes(grid, -3, -2).reshape(mueller.shape))


def directions(count: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    return rng.uniform(0.0, 1.57, count), rng.uniform(0.0, 1.57, count), rng.uniform(-7.0, 7.0, count)


def test_agrees_with_the_reference_to_rounding() -> None:
    rows = np.genfromtxt(TABLE, delimiter=",", names=True, comments="#", skip_header=7)
    assert len(rows) == 310
    for row in rows:
        k, ti, tr, phi, sigma, a, n, kappa, sensitivity, total, *elements = row.tolist()
        expected = np.reshape(elements, (4, 4))
        computed = bounce_mueller(int(k), ti, tr, phi, sigma=sigma, asymmetry=a, index=complex(n, kappa))
        # In the caustic and on the edge of support the input's rounding decides; there the other bounces set the scale.
        tolerance = 1e-12 * total if np.isnan(sensitivity) or sensitivity == 1.0 else 0.0
        tolerance += (1e-12 + 4.0 * np.nan_to_num(sensitivity)) * expected[0, 0]
        assert_allclose(computed, expected, rtol=0.0, atol=tolerance, err_msg=str(row))


def assert_reciprocal(k: int, a: float, at: tuple[np.ndarray, np.ndarray, np.ndarray]) -> None:
    """F(r, i) is F(i, r) transposed, with S3 and what comes of it reversed."""
    ti, tr, phi = at
    there = bounce_mueller(k, ti, tr, phi, sigma=0.7, asymmetry=a, index=IRON)
    back = bounce_mueller(k, tr, ti, phi, sigma=0.7, asymmetry=a, index=IRON)
    excess = np.abs(REVERSAL @ np.swapaxes(back, -1, -2) @ REVERSAL - there).max(axis=(-1, -2))
    assert (excess <= 3e-14 * there[:, 0, 0] + 1e-300).all()
    if k == 1:
        assert_allclose(back[:, 0, 0], there[:, 0, 0], rtol=1.5e-15, atol=1e-300)


@pytest.mark.parametrize("a", [0.0, 0.3, 0.9, 0.999999])
@pytest.mark.parametrize("k", [1, 2, 3, 4, 5, 8])
def test_reciprocity(k: int, a: float) -> None:
    assert_reciprocal(k, a, directions(5000))


@pytest.mark.long
@pytest.mark.parametrize("a", [0.0, *np.random.default_rng(6).uniform(0.0, 1.0, 6)])
@pytest.mark.parametrize("k", [1, 2, 3, 4])
def test_reciprocity_at_a_hundred_thousand_pairs(k: int, a: float) -> None:
    assert_reciprocal(k, float(a), directions(100_000, seed=7))


@pytest.mark.parametrize("a", [0.0, 0.3, 0.999])
@pytest.mark.parametrize("k", [1, 2, 3, 4])
def test_mirror_symmetry(k: int, a: float) -> None:
    ti, tr, phi = directions(5000)
    evaluate = partial(bounce_mueller, k, ti, tr, sigma=0.7, asymmetry=a, index=IRON)
    one_side, other_side = evaluate(phi), evaluate(-phi)
    excess = np.abs(MIRROR @ other_side @ MIRROR - one_side).max(axis=(-1, -2))
    assert (excess <= 1e-13 * one_side[:, 0, 0] + 1e-300).all()


@settings(max_examples=400, deadline=None)
@given(bounces, polar, polar, azimuth, roughness, asymmetry, index)
def test_every_matrix_is_physical(k: int, ti: float, tr: float, phi: float, sigma: float, a: float, n: complex) -> None:
    matrix = bounce_mueller(k, ti, tr, phi, sigma=sigma, asymmetry=a, index=n)
    assert not np.isnan(matrix).any()
    assert matrix[0, 0] >= 0.0
    if np.isinf(matrix[0, 0]):
        assert k > 1
        assert max(ti, tr) < 1e-130  # with an azimuth of pi as it is rounded, ρ is 1e-16 of that
        return
    scale = matrix[0, 0] or 1.0
    assert eigenvalues(matrix / scale).min() >= -1e-13 or scale < 1e-300
    assert np.abs(matrix).max() <= matrix[0, 0] * (1.0 + 1e-13) + 1e-300


@settings(max_examples=100, deadline=None)
@given(bounces, polar, polar, azimuth, asymmetry, index, st.lists(st.floats(-1.0, 1.0), min_size=3, max_size=3))
def test_stokes_is_mueller_times_the_incoming_state(
    k: int, ti: float, tr: float, phi: float, a: float, n: complex, polarized: list[float]
) -> None:
    evaluate = {"sigma": 0.5, "asymmetry": a, "index": n}
    matrix = bounce_mueller(k, ti, tr, phi, **evaluate)
    if np.isfinite(matrix[0, 0]):
        for state in ([2.0, 0.0, 0.0, 0.0], [2.0, *polarized]):
            stokes = bounce_stokes(k, ti, tr, phi, **evaluate, incoming=state)
            assert_allclose(stokes, matrix @ state, rtol=0.0, atol=1e-14 * matrix[0, 0] + 1e-300)


def test_inputs_and_incoming_states_broadcast() -> None:
    evaluate = {"sigma": 0.5, "asymmetry": 0.2, "index": GLASS}
    ti, tr, phi = np.linspace(0.1, 1.4, 3)[:, None], np.linspace(0.0, 1.5, 4), 2.5
    states = np.eye(4)[:, None, None, :]
    columns = bounce_stokes(3, ti, tr, phi, **evaluate, incoming=states)
    matrices = bounce_mueller(3, ti, tr, phi, **evaluate)
    assert matrices.shape == (3, 4, 4, 4)
    assert_allclose(np.moveaxis(columns, 0, -1), matrices, rtol=0.0, atol=1e-15)
    assert_array_equal(bounce_mueller(3, ti[1, 0], tr[2], phi, **evaluate), matrices[1, 2])


@pytest.mark.parametrize("a", [0.0, 0.5])
@pytest.mark.parametrize("k", [1, 2, 3, 4])
class TestHardCases:
    """What double precision breaks first."""

    def test_horizon_is_zero(self, k: int, a: float) -> None:
        for ti, tr in ((HORIZON, 0.3), (0.3, HORIZON), (HORIZON, HORIZON)):
            assert not bounce_mueller(k, ti, tr, 2.0, sigma=0.5, asymmetry=a, index=GLASS).any()

    def test_normal_incidence_does_not_depend_on_azimuth(self, k: int, a: float) -> None:
        phi = np.linspace(0.0, 6.0, 7)
        power = bounce_stokes(k, 0.0, 0.6, phi, sigma=0.5, asymmetry=a, index=IRON)[:, 0]
        assert_allclose(power, power[0], rtol=1e-14)

    def test_retro_reflection_in_a_right_angle(self, k: int, a: float) -> None:
        # Light that comes straight back has met its last wall along that wall's normal, at odd k.
        exact = bounce_mueller(k, 0.3, 0.3, 0.0, sigma=0.5, asymmetry=a, index=IRON)
        near = bounce_mueller(k, 0.3, 0.3 + 1e-9, 1e-9, sigma=0.5, asymmetry=a, index=IRON)
        assert_allclose(near, exact, rtol=0.0, atol=1e-7 * exact[0, 0])

    def test_caustic_falls_off_as_one_over_rho(self, k: int, a: float) -> None:
        # At normal incidence rho = sin tr, and nothing else changes.
        far, near = (bounce_mueller(k, 0.0, tr, 1.0, sigma=0.5, asymmetry=a, index=IRON)[0, 0] for tr in (1e-12, 1e-15))
        assert_allclose(near, far * (1000.0 if k > 1 else 1.0), rtol=1e-10)

    def test_mirror_direction_itself(self, k: int, a: float) -> None:
        matrix = bounce_mueller(k, 0.0, 0.0, 1.0, sigma=0.5, asymmetry=a, index=IRON)
        stokes = bounce_stokes(k, 0.0, 0.0, 1.0, sigma=0.5, asymmetry=a, index=IRON)
        assert np.isinf(matrix).all() == (k > 1)
        assert np.isinf(stokes).all() == (k > 1)
        assert not np.isnan(matrix).any()

    def test_double_pi_is_beside_the_mirror_direction(self, k: int, a: float) -> None:
        matrix = bounce_mueller(k, 1.0, 1.0, np.pi, sigma=2.0, asymmetry=a, index=IRON)
        assert np.isfinite(matrix).all()

    def test_underflow_is_exactly_zero(self, k: int, a: float) -> None:
        matrix = bounce_mueller(k, 0.2, 0.9, 1.0, sigma=1e-4, asymmetry=a, index=IRON)
        assert_array_equal(matrix, 0.0)

    def test_no_contrast_reflects_nothing(self, k: int, a: float) -> None:
        assert not bounce_mueller(k, 0.3, 0.4, 1.0, sigma=1.0, asymmetry=a, index=1.0 + 0j).any()
        faint = bounce_mueller(k, 0.3, 0.4, 1.0, sigma=1.0, asymmetry=a, index=1.0 + 1e-9 + 0j)[0, 0]
        fainter = bounce_mueller(k, 0.3, 0.4, 1.0, sigma=1.0, asymmetry=a, index=1.0 + 0.5e-9 + 0j)[0, 0]
        assert_allclose(faint, fainter * 4.0**k, rtol=1e-6)

    def test_both_sides_of_the_branch_cut(self, k: int, a: float) -> None:
        # n < 1: total reflection beyond the critical angle; an infinitesimal k must not change its side.
        lossless = bounce_mueller(k, 0.8, 1.2, 2.8, sigma=1.0, asymmetry=a, index=0.6 + 0j)
        lossy = bounce_mueller(k, 0.8, 1.2, 2.8, sigma=1.0, asymmetry=a, index=0.6 + 1e-13j)
        assert_allclose(lossy, lossless, rtol=0.0, atol=1e-11 * lossless[0, 0])

    def test_continuous_where_a_ray_grazes_a_tip(self, k: int, a: float) -> None:
        tr = np.linspace(0.0, 1.5, 20001)
        power = bounce_stokes(k, 0.4, tr, 1.0, sigma=2.0, asymmetry=a, index=PERFECT)[:, 0]
        assert np.abs(np.diff(power)).max() <= 3e-3 * power.max()
        assert np.abs(np.diff(power, 2)).max() > 1e-5 * power.max()  # and there is a tip to graze

    def test_symmetric_grooves_are_the_limit_of_asymmetric_ones(self, k: int, a: float) -> None:
        ti, tr, phi = directions(300)
        limit, exact = (
            bounce_mueller(k, ti, tr, phi, sigma=0.7, asymmetry=small, index=IRON) for small in (1e-13, 0.0)
        )
        assert_allclose(limit, exact, rtol=0.0, atol=1e-9 * exact[:, 0, 0].max())


@pytest.mark.parametrize(("k", "from_horizon", "phi"), [(2, 2.0e-6, np.pi - 1e-10), (3, 1.5e-6, 1e-8)])
def test_narrow_grooves_keep_their_digits(k: int, from_horizon: float, phi: float) -> None:
    # Δp is about 1e-6 of the walls here: a difference of two p would keep ten digits of it.
    power = [
        bounce_stokes(k, HORIZON - 1e-6, HORIZON - from_horizon, phi, sigma=1e5, asymmetry=a, index=PERFECT)[0]
        for a in (0.0, 1e-13)
    ]
    assert power[0] > 0.0
    assert_allclose(power[1], power[0], rtol=2e-12)


def test_nearly_one_sided_grooves_keep_their_digits() -> None:
    # With a close to 1 the slope follows the small cosine of an opening near a right angle, and exp() magnifies it.
    expected = 1.1335483662128053e-31  # section 4 of the model's description at 90 digits
    arguments = {"sigma": 7.835885716554345, "asymmetry": 0.999999, "index": 0.7 + 1e-6j}
    computed = bounce_stokes(2, 0.03322217495732758, 0.04421107284152981, 0.0, **arguments)[0]
    assert_allclose(computed, expected, rtol=4e-13)


def test_stays_physical_where_two_walls_nearly_extinguish_the_light() -> None:
    # Where both reflections polarize fully and cross, products of Mueller matrices lose twice the digits of Jones ones.
    ti, tr, phi = directions(200_000, seed=2)
    matrix = bounce_mueller(2, ti, tr, phi, sigma=1.0, asymmetry=0.0, index=GLASS)
    lit = matrix[matrix[:, 0, 0] > 0.0]
    assert eigenvalues(lit / lit[:, :1, :1]).min() >= -1e-14


@pytest.mark.parametrize("a", [0.1, 0.5, 0.9, 0.999, 1.0 - 1e-6, 1.0 - 1e-12, 1.0 - 2.0**-53])
def test_the_groove_is_found_everywhere(a: float) -> None:
    # The light found must come back: an opening that is not settled is another one for the way back.
    ti, tr, phi = directions(20_000, seed=1)
    tr = np.where(phi > 5.0, ti, tr)
    for k in (3, 5, 7, 21):
        there = bounce_stokes(k, ti, tr, phi, sigma=1.0, asymmetry=a, index=GLASS)[:, 0]
        back = bounce_stokes(k, tr, ti, phi, sigma=1.0, asymmetry=a, index=GLASS)[:, 0]
        assert_allclose(there, back, rtol=1e-11, atol=1e-200)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"bounces": 0}, "bounces is 0"),
        ({"bounces": 1.5}, "bounces is 1.5"),
        ({"asymmetry": 1.0}, "asymmetry is 1; allowed is at least 0 and below 1"),
        ({"asymmetry": -0.1}, "asymmetry is -0.1"),
        ({"asymmetry": np.nan}, "asymmetry is nan"),
        ({"sigma": 0.0}, "sigma is 0.0"),
        ({"index": 1.5 - 1e-9j}, "index is"),
        ({"incidence_rad": -1e-9}, "incidence_rad holds -1e-09 rad; allowed is 0 to pi/2"),
        ({"exit_rad": [0.1, 1.6]}, "exit_rad holds 1.6 rad"),
        ({"azimuth_rad": np.inf}, "azimuth_rad holds inf"),
    ],
)
def test_says_what_is_out_of_range(arguments: dict[str, object], message: str) -> None:
    legal: dict[str, object] = {
        "bounces": 2,
        "incidence_rad": 0.3,
        "exit_rad": 0.4,
        "azimuth_rad": 1.0,
        "sigma": 0.3,
        "asymmetry": 0.1,
        "index": GLASS,
    }
    for function in (bounce_mueller, bounce_stokes):
        with pytest.raises(ValueError, match=message):
            function(**(legal | arguments))


def test_an_incoming_state_has_four_elements() -> None:
    with pytest.raises(ValueError, match="four elements"):
        bounce_stokes(2, 0.3, 0.4, 1.0, sigma=0.3, asymmetry=0.1, index=GLASS, incoming=[1.0, 0.0, 0.0])
