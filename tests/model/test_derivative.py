"""Derivatives by a surface's parameters against differences of its formulas, computed directly in wider arithmetic."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray

from model.geometry import angles
from model.lobes import Diffuse, Directional, Lobe, Specular
from model.lobes.diffuse import printed_averages
from model.surface import Surface

pytestmark = pytest.mark.skipif(np.finfo(np.longdouble).nmant <= 52, reason="no type here is wider than float64")

LongArray = NDArray[np.longdouble]
STATE = np.array([1.0, 0.3, -0.5, 0.6])
# Differences of fourth order over steps this long: 1e-24 of the fifth derivative, and 1e-13 by rounding.
STEP = np.longdouble(1e-6)
STENCIL = [(-2, 1.0 / 12.0), (-1, -2.0 / 3.0), (1, 2.0 / 3.0), (2, -1.0 / 12.0)]
VALUES = {"sigma": 0.45, "asymmetry": 0.3, "rho_s": 0.7, "rho_d": 0.2, "rho_dd": 0.1}
INDICES = [1.5 + 0j, 1.0 / 1.5 + 0j, 2.95 + 2.932j, 0.2 + 3.4j, 0.9 + 0.05j]


def make(kind: str, index: complex, **values: float) -> Lobe:
    """A lobe, of the specular ones "kaleidoscope K" or "single-fresnel K"."""
    v = VALUES | values
    name, _, option = kind.partition(" ")
    if name == "diffuse":
        return Diffuse(v["rho_d"], v["sigma"], option)  # type: ignore[arg-type]
    if name == "directional":
        return Directional(v["rho_dd"], v["sigma"], index, int(option))
    asymmetry = v["asymmetry"] if name == "kaleidoscope" else 0.0
    return Specular(v["rho_s"], v["sigma"], index, asymmetry, int(option), name)  # type: ignore[arg-type]


SPECULAR = [f"kaleidoscope {count}" for count in (1, 2, 3, 4)] + [f"single-fresnel {count}" for count in (1, 2, 3)]
OTHERS = ["diffuse printed", "diffuse exact", "directional 1", "directional 2"]


def directions(count: int, seed: int) -> list[NDArray[np.float64]]:
    random = np.random.default_rng(seed)
    return [random.uniform(low, high, count) for low, high in ((0.0, 1.5), (0.0, 1.5), (-3.1, 3.1))]


def exact_averages(sigma: np.longdouble) -> tuple[np.longdouble, np.longdouble]:
    """⟨cos⟩ and ½⟨tan² cos⟩ over Beckmann slopes with m = sigma: ∫ exp(-s) g(m² s) ds, double-exponential rule."""
    x = np.linspace(np.longdouble(-4.5), np.longdouble(4.5), 400)
    s = np.exp(x - np.exp(-x))
    weights = np.exp(-s) * s * (1.0 + np.exp(-x)) * (x[1] - x[0])
    slope2 = sigma * sigma * s
    cosine = 1.0 / np.sqrt(1.0 + slope2)
    return (weights * cosine).sum(), (weights * slope2 * cosine).sum() / 2.0


def direct(lobes: Sequence[Lobe], values: Mapping[str, np.longdouble], at: Sequence[NDArray]) -> LongArray:
    """Stokes vectors (..., 4) from the lobes' formulas, run on arrays."""
    light = np.zeros((*at[0].shape, 4), np.longdouble)
    for lobe in lobes:
        known = dict(values)
        if isinstance(lobe, Diffuse):
            averages = exact_averages if lobe.averages == "exact" else printed_averages
            c = averages(values["sigma"])  # type: ignore[operator]
            known["c1"], known["c2"] = c if lobe.averages == "exact" else c[0]
        form = lobe.form(frozenset(lobe.parameters))
        with np.errstate(all="ignore"):
            wide = angles(*(np.asarray(angle, np.longdouble) for angle in at))
            matrix = form.function(wide, {name: known[name] for name in lobe.numbers}, *form.options)
        for position, row in enumerate(matrix):
            for element, incoming in zip(row, STATE, strict=True):
                light[..., position] += element * np.longdouble(incoming)
    return light


def differences(lobes: Sequence[Lobe], names: Sequence[str], at: Sequence[NDArray]) -> LongArray:
    """Derivatives (..., 4, names) by differences."""
    values = {"sigma": VALUES["sigma"], "asymmetry": 0.0}
    for lobe in lobes:
        values |= {name: value for name, value in lobe.numbers.items() if name not in ("c1", "c2")}
        values["sigma"] = lobe.sigma  # type: ignore[attr-defined]
    wide = {name: np.longdouble(value) for name, value in values.items()}
    columns = []
    for name in names:
        beside = [(weight, wide | {name: wide[name] + steps * STEP}) for steps, weight in STENCIL]
        columns.append(sum(weight * direct(lobes, shifted, at) for weight, shifted in beside) / STEP)
    return np.stack(columns, axis=-1)


def assert_agrees(lobes: Sequence[Lobe], at: Sequence[NDArray], tolerance: float = 1e-9) -> None:
    surface = Surface(lobes)
    names = surface.parameters
    computed, light = surface.jacobian(names, *at, STATE), surface.stokes(*at, STATE)
    expected = differences(lobes, names, at)
    lit = light[..., 0] > 1e-12
    assert lit.mean() > 0.2
    scale = np.abs(expected).max(axis=-2, keepdims=True) + np.abs(light).max(axis=-1)[..., None, None] + 1e-30
    excess = (np.abs(computed - expected) / scale)[lit].max(axis=(0, 1))
    assert (excess < tolerance).all(), dict(zip(names, excess.astype(float), strict=True))


@pytest.mark.parametrize("index", INDICES)
@pytest.mark.parametrize("kind", SPECULAR)
def test_specular_lobes(kind: str, index: complex) -> None:
    assert_agrees([make(kind, index)], directions(150, 1))


@pytest.mark.parametrize("index", INDICES)
@pytest.mark.parametrize("kind", ["directional 1", "directional 2"])
def test_directional_lobes(kind: str, index: complex) -> None:
    ti, tr, phi = directions(150, 2)
    assert_agrees([make(kind, index)], [ti, 0.3 * tr, phi])


@pytest.mark.parametrize("sigma", [0.02, 0.0999999, 0.1, 0.1000001, 0.45, 2.0])
@pytest.mark.parametrize("kind", ["diffuse printed", "diffuse exact"])
def test_diffuse_lobes_also_where_series_and_function_meet(kind: str, sigma: float) -> None:
    assert_agrees([make(kind, 1.5 + 0j, sigma=sigma)], directions(150, 3))


def test_lobes_together_share_their_parameters() -> None:
    kinds = ["kaleidoscope 2", "single-fresnel 2", "diffuse exact", "diffuse printed", "directional 2"]
    lobes = [make(kind, 1.5 + 0.3j) for kind in kinds]
    assert Surface(lobes).parameters == ("rho_s", "sigma", "n", "k", "asymmetry", "rho_d", "rho_dd")
    assert_agrees(lobes, directions(150, 4))


def test_a_parameter_changes_in_every_lobe_that_has_it() -> None:
    at = directions(50, 5)
    lobes = [Specular(0.7, 0.3, 1.5 + 0.2j), Directional(0.1, 0.4, 2.0 + 0.1j), Diffuse(0.3, 0.5)]
    together = Surface(lobes).jacobian(["sigma", "n", "rho_d"], *at)
    for column, names in enumerate((["sigma"], ["n"], ["rho_d"])):
        apart = sum(Surface([lobe]).jacobian(names, *at)[..., 0] for lobe in lobes if names[0] in lobe.parameters)
        assert_allclose(together[..., column], apart, rtol=0.0, atol=1e-15 * np.abs(apart).max())


@pytest.mark.parametrize("beside", [0.0, 1e-9, -1e-9, 1e-12])
@pytest.mark.parametrize(
    "index",
    [
        pytest.param(np.sqrt(1.5) + 0j, id="N²-1 = 1/2"),
        pytest.param(np.sqrt(0.5) + 0j, id="N²-1 = -1/2"),
        pytest.param(np.sqrt(1.5 + 0.49) + 0.7j, id="Re N²-1 = 1/2"),
        pytest.param(np.sqrt(0.5 + 0.04) + 0.2j, id="Re N²-1 = -1/2"),
    ],
)
@pytest.mark.parametrize("kind", ["kaleidoscope 1", "kaleidoscope 2"])
def test_on_both_sides_of_a_switch_between_formulas(kind: str, index: complex, beside: float) -> None:
    assert_agrees([make(kind, index + beside)], directions(150, 6))


@pytest.mark.parametrize("beside", [0.0, 1e-9, -1e-9, 1e-3, -1e-3])
def test_where_the_refracted_wave_turns_evanescent(beside: float) -> None:
    # q = n² - k² - sin² changes its sign on the facet of this retro-reflection, where absorption keeps all smooth.
    k, sin2 = 0.4, np.sin(1.0) ** 2
    index = complex(np.sqrt(sin2 + k * k + beside), k)
    at = [np.array([1.0, 1.0]), np.array([1.0, 1.0 + 1e-9]), np.array([0.0, 1e-10])]
    assert_agrees([make("kaleidoscope 1", index)], at)


@pytest.mark.parametrize("beside", [1e-2, -1e-2])
def test_near_the_critical_angle_of_a_lossless_wall(beside: float) -> None:
    sin2 = np.sin(1.0) ** 2
    at = [np.array([1.0]), np.array([1.0]), np.array([0.0])]
    assert_agrees([make("kaleidoscope 1", complex(np.sqrt(sin2 + beside), 0.0))], at)


@pytest.mark.parametrize("asymmetry", [1e-4, 0.05, 0.8, 0.98])
@pytest.mark.parametrize("kind", ["kaleidoscope 1", "kaleidoscope 2", "kaleidoscope 3"])
def test_from_nearly_symmetric_to_nearly_one_sided_grooves(kind: str, asymmetry: float) -> None:
    assert_agrees([make(kind, 2.0 + 1.0j, asymmetry=asymmetry)], directions(150, 10))


@pytest.mark.parametrize("kind", ["kaleidoscope 1", "kaleidoscope 2", "kaleidoscope 3", "kaleidoscope 4"])
def test_symmetric_grooves_change_with_all_but_the_asymmetry_as_they_do_without_it(kind: str) -> None:
    at = directions(150, 7)
    lobe = make(kind, 2.0 + 1.0j, asymmetry=0.0)
    names = ["sigma", "n", "k", "rho_s"]
    alone = Surface([lobe]).jacobian(names, *at, STATE)
    with_it = Surface([lobe]).jacobian([*names, "asymmetry"], *at, STATE)
    expected = differences([lobe], names, at)
    scale = np.abs(expected).max(axis=-2, keepdims=True) + 1e-12
    assert (np.abs(alone - expected) / scale).max() < 1e-9
    assert (np.abs(with_it[..., :4] - expected) / scale).max() < 1e-9
    # Grooves and their mirror images are equally likely: all is even in a.
    assert (np.abs(with_it[..., 4]) <= 1e-12 * scale[..., 0]).all()


@pytest.mark.parametrize("kind", SPECULAR + OTHERS)
@pytest.mark.parametrize("index", [1.5 + 0j, 1.0 + 0j, 0.5 + 0j, 1e-3 + 5.0j, 50.0 + 80.0j])
def test_derivatives_are_finite_to_every_edge(kind: str, index: complex) -> None:
    edges = np.array([0.0, 1e-160, 1e-9, 0.5, 1.0, np.radians(89.9999), np.pi / 2.0])
    ti, tr, phi = np.meshgrid(edges[1:], edges, [0.0, 1e-9, 2.0, np.pi, -np.pi, 7.0], indexing="ij")
    mirror = (np.abs(ti - tr) < 1e-12) & (np.abs(ti * np.cos(phi / 2.0)) < 1e-12)  # where no more than one bounce is
    ti, tr, phi = ti[~mirror], tr[~mirror], phi[~mirror]
    for asymmetry in (0.0, 0.999):
        for sigma in (1e-3, 0.5, 10.0):
            surface = Surface([make(kind, index, sigma=sigma, asymmetry=asymmetry)])
            jacobian = surface.jacobian(surface.parameters, ti, tr, phi, STATE)
            assert np.isfinite(jacobian).all()
            assert not jacobian[(ti == np.pi / 2.0) | (tr == np.pi / 2.0)].any()


def test_unpolarized_light_takes_the_short_way_to_the_same_derivatives() -> None:
    surface, at = Surface([make("kaleidoscope 3", 2.0 + 1.0j), make("diffuse printed", 0j)]), directions(50, 8)
    names = ["sigma", "k"]
    short, long = surface.jacobian(names, *at), surface.jacobian(names, *at, [1.0, 1e-200, 0.0, 0.0])
    assert_allclose(short, long, rtol=0.0, atol=1e-190)
    assert_array_equal(surface.jacobian(names, *at, [4.0, 0.0, 0.0, 0.0]), 4.0 * short)


def test_columns_come_in_the_order_asked_for() -> None:
    surface, at = Surface([make("kaleidoscope 2", 2.0 + 1.0j)]), directions(20, 9)
    jacobian = surface.jacobian(["k", "rho_s", "sigma"], *at)
    assert jacobian.shape == (20, 4, 3)
    assert_array_equal(jacobian[..., ::-1], surface.jacobian(["sigma", "rho_s", "k"], *at))
    assert_allclose(jacobian[..., 1] * 0.7, surface.stokes(*at), rtol=1e-14, atol=1e-300)


def test_in_the_mirror_direction_itself_the_derivative_is_refused_like_the_light() -> None:
    surface = Surface([make("kaleidoscope 2", 2.0 + 1.0j)])
    for evaluate in (surface.stokes, lambda *at: surface.jacobian(["sigma"], *at)):
        with pytest.raises(ValueError, match="mirror direction itself"):
            evaluate(0.0, [0.0, 0.3], 0.0)


@pytest.mark.parametrize("names", [[], ["sgima"], ["sigma", "asymmetry"]])
def test_parameters_that_the_surface_has_not_are_refused(names: list[str]) -> None:
    surface = Surface([make("single-fresnel 1", 1.5 + 0j)])
    with pytest.raises(ValueError, match=r"\['rho_s', 'sigma', 'n', 'k'\]"):
        surface.jacobian(names, 0.1, 0.2, 0.3)
