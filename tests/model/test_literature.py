"""Published models against their equations, re-derived here with vectors in space and complex amplitudes."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from model.coherency import is_physical
from model.literature import Baek2018, Hao2023, Hyde, PriestGermer, PublishedModel, ThreeComponent
from model.lobes import Diffuse, Directional, Specular
from model.mueller import PAULI
from model.stokes import dop
from model.surface import Surface

IRON, GLASS = 2.95 + 2.932j, 1.525 + 0j
REVERSAL = np.diag([1.0, 1.0, 1.0, -1.0])
DEPOLARIZER = np.diag([1.0, 0.0, 0.0, 0.0])

polar = st.floats(0.01, np.radians(88.0))
azimuth = st.floats(-2.0 * np.pi, 2.0 * np.pi).filter(lambda phi: abs(math.remainder(phi, math.pi)) > 0.01)
roughness = st.floats(0.1, 1.0)
index = st.builds(complex, st.floats(1.1, 4.0), st.floats(0.0, 5.0))

MODELS = [
    PriestGermer(0.9, 0.3, IRON),
    Hyde(0.9, 0.2, 0.3, IRON),
    ThreeComponent(0.8, 0.1, 0.05, 0.3, IRON),
    Baek2018(0.9, 0.5, 0.3, GLASS),
    Hao2023(0.8, 0.1, 0.05, 0.3, IRON),
]
every_model = pytest.mark.parametrize("model", MODELS, ids=lambda model: type(model).__name__)


def unit(vector: np.ndarray) -> np.ndarray:
    return vector / np.linalg.norm(vector)


def rays(ti: float, tr: float, phi: float) -> tuple[np.ndarray, np.ndarray]:
    to_source = np.array([np.sin(ti), 0.0, np.cos(ti)])
    to_detector = np.array([np.sin(tr) * np.cos(phi), np.sin(tr) * np.sin(phi), np.cos(tr)])
    return to_source, to_detector


def macro_frame(direction: np.ndarray) -> np.ndarray:
    """Rows x, y of a ray that travels along a direction."""
    x = unit(np.cross([0.0, 0.0, 1.0], direction))
    return np.array([x, np.cross(direction, x)])


def reflection_mueller(ti: float, tr: float, phi: float, n: complex) -> np.ndarray:
    """M of the half-vector facet: amplitudes in the plane of i and r, carried as a matrix of vectors in space."""
    i, r = rays(ti, tr, phi)
    c = unit(i + r) @ i
    w = np.sqrt(n * n - 1.0 + c * c + 0j)
    r_s, r_p = (c - w) / (c + w), (n * n * c - w) / (n * n * c + w)
    s = unit(np.cross(i, r))
    in_space = r_s * np.outer(s, s) + r_p * np.outer(np.cross(r, s), np.cross(-i, s))
    jones = macro_frame(r) @ in_space @ macro_frame(-i).T
    return np.einsum("mij,jk,nkl,il->mn", PAULI, jones, PAULI, jones.conj()).real / 2.0


def cosines(ti: float, tr: float, phi: float) -> tuple[float, float, float, float]:
    """Of incidence, exit, the facet's tilt and the incidence on the facet."""
    i, r = rays(ti, tr, phi)
    h = unit(i + r)
    return i[2], r[2], h[2], h @ i


def gaussian_density(cos_tilt: float, sigma: float) -> float:
    tan2 = 1.0 / cos_tilt**2 - 1.0
    return np.exp(-tan2 / (2.0 * sigma**2)) / (2.0 * np.pi * sigma**2 * cos_tilt**4)


def v_groove_masking(ti: float, tr: float, phi: float) -> float:
    cos_i, cos_r, cos_h, cos_b = cosines(ti, tr, phi)
    return min(1.0, 2.0 * cos_h * cos_i / cos_b, 2.0 * cos_h * cos_r / cos_b)


def unmasked(ti: float, tr: float, phi: float, sigma: float, n: complex) -> np.ndarray:
    cos_i, cos_r, cos_h, _ = cosines(ti, tr, phi)
    return gaussian_density(cos_h, sigma) / (4.0 * cos_i * cos_r) * reflection_mueller(ti, tr, phi, n)


def directional(ti: float, tr: float, phi: float, sigma: float, n: complex) -> np.ndarray:
    size = np.exp(-2.0 * np.tan(tr) / sigma**2) / (np.sqrt(2.0 * np.pi) * sigma)
    return size * reflection_mueller(ti, tr, phi, n)


def transmission_mueller(angle: float, n: float) -> np.ndarray:
    """Into a medium of real index: amplitudes t_s, t_p with the ratio of power per area that goes with them."""
    c = np.cos(angle)
    c_inside = np.sqrt(1.0 - (np.sin(angle) / n) ** 2)
    t_s, t_p = 2.0 * c / (c + n * c_inside), 2.0 * c / (n * c + c_inside)
    power = n * c_inside / c
    jones = np.diag([t_s, t_p])
    return power * np.einsum("mij,jk,nkl,il->mn", PAULI, jones, PAULI, jones).real / 2.0


def body_diffuse(ti: float, tr: float, n: float) -> np.ndarray:
    # Out of the medium power passes as into it: T(tr) from inside is the transpose of T(tr) from outside.
    return transmission_mueller(tr, n).T @ DEPOLARIZER @ transmission_mueller(ti, n) / np.pi


def ggx(ti: float, tr: float, phi: float, alpha: float, n: complex) -> np.ndarray:
    cos_i, cos_r, cos_h, _ = cosines(ti, tr, phi)
    tan2 = 1.0 / cos_h**2 - 1.0
    density = alpha**2 / (np.pi * cos_h**4 * (alpha**2 + tan2) ** 2)
    masking = np.prod([2.0 / (1.0 + np.sqrt(1.0 + alpha**2 * np.tan(angle) ** 2)) for angle in (ti, tr)])
    return density * masking / (4.0 * cos_i * cos_r) * reflection_mueller(ti, tr, phi, n)


def assert_is(model: PublishedModel, at: tuple[float, float, float], expected: np.ndarray) -> None:
    assert_allclose(model.mueller(*at), expected, rtol=0.0, atol=1e-9 * expected[0, 0] + 1e-280)


@settings(max_examples=200, deadline=None)
@given(polar, polar, azimuth, roughness, index)
def test_priest_and_germer(ti: float, tr: float, phi: float, sigma: float, n: complex) -> None:
    assert_is(PriestGermer(0.7, sigma, n), (ti, tr, phi), 0.7 * unmasked(ti, tr, phi, sigma, n))


@settings(max_examples=200, deadline=None)
@given(polar, polar, azimuth, roughness, index)
def test_hyde(ti: float, tr: float, phi: float, sigma: float, n: complex) -> None:
    specular = v_groove_masking(ti, tr, phi) * unmasked(ti, tr, phi, sigma, n)
    assert_is(Hyde(0.7, 0.2, sigma, n), (ti, tr, phi), 0.7 * specular + 0.2 / np.pi * DEPOLARIZER)


@settings(max_examples=200, deadline=None)
@given(polar, polar, azimuth, roughness, index)
def test_three_components(ti: float, tr: float, phi: float, sigma: float, n: complex) -> None:
    specular = v_groove_masking(ti, tr, phi) * unmasked(ti, tr, phi, sigma, n)
    expected = 0.7 * specular + 0.2 / np.pi * DEPOLARIZER + 0.1 * directional(ti, tr, phi, sigma, n)
    assert_is(ThreeComponent(0.7, 0.2, 0.1, sigma, n), (ti, tr, phi), expected)


@settings(max_examples=200, deadline=None)
@given(polar, polar, azimuth, roughness, st.floats(1.1, 4.0))
def test_baek(ti: float, tr: float, phi: float, alpha: float, n: float) -> None:
    expected = 0.7 * ggx(ti, tr, phi, alpha, n) + 0.3 * body_diffuse(ti, tr, n)
    assert_is(Baek2018(0.7, 0.3, alpha, n), (ti, tr, phi), expected)


@settings(max_examples=200, deadline=None)
@given(polar, polar, azimuth, roughness, index)
def test_hao_where_every_bounce_is_summed(ti: float, tr: float, phi: float, sigma: float, n: complex) -> None:
    # G of eqs. (3), (4) is then the masking of the incoming light alone.
    cos_i, _, cos_h, cos_b = cosines(ti, tr, phi)
    specular = min(1.0, 2.0 * cos_h * cos_i / cos_b) * unmasked(ti, tr, phi, sigma, n)
    c1, c2 = 0.8532 * sigma**-0.095, 0.3595 * sigma**1.785
    bracket = max(c1 + c2 * np.tan(ti) * np.tan(tr) * np.cos(phi), 0.0)
    diffuse = v_groove_masking(ti, tr, phi) / np.pi * bracket * DEPOLARIZER
    expected = 0.7 * specular + 0.2 * diffuse + 0.1 * directional(ti, tr, phi, sigma, n)
    assert_is(Hao2023(0.7, 0.2, 0.1, sigma, n, bounces=40), (ti, tr, phi), expected)


def test_without_masking_one_bounce_is_divided_by_g() -> None:
    # D has 1/cos⁴ in both; with 1/cos³ they would differ by the cosine of the facet's tilt.
    exits, azimuths = np.radians([5.0, 40.0, 75.0])[:, None], np.radians([10.0, 100.0, 179.0])
    grooves = Surface([Specular(1.0, 0.4, IRON)]).stokes(1.2, exits, azimuths)
    masking = np.vectorize(lambda tr, phi: v_groove_masking(1.2, tr, phi))(exits, azimuths)
    assert masking.min() < 0.7
    model = PriestGermer(1.0, 0.4, IRON).stokes(1.2, exits, azimuths)
    assert_allclose(model, grooves / masking[..., None], rtol=1e-11, atol=1e-14)


def test_hydes_facets_are_a_specular_lobe_of_one_bounce() -> None:
    at = (1.2, np.linspace(0.0, 1.57, 9)[:, None], np.linspace(-3.2, 3.2, 7))
    grooves = Surface([Specular(0.6, 0.4, IRON)]).mueller(*at)
    assert_allclose(Hyde(0.6, 0.0, 0.4, IRON).mueller(*at), grooves, rtol=1e-14, atol=0.0)


def test_haos_model_is_the_printed_lobes() -> None:
    at = (1.0, np.linspace(0.0, 1.5, 7), 2.5)
    lobes = [
        Specular(0.7, 0.3, GLASS, bounces=3, reading="single-fresnel"),
        Diffuse(0.2, 0.3, averages="printed"),
        Directional(0.1, 0.3, GLASS, exponent=1),
    ]
    model = Hao2023(0.7, 0.2, 0.1, 0.3, GLASS, bounces=3)
    assert_allclose(model.mueller(*at), Surface(lobes).mueller(*at), rtol=1e-15, atol=0.0)


def asymmetry_under_exchange(model: PublishedModel) -> float:
    ti, tr, phi = 0.9, 0.5, 2.0
    there, back = model.mueller(ti, tr, phi), model.mueller(tr, ti, phi)
    return float(np.abs(REVERSAL @ back.T @ REVERSAL - there).max() / there[0, 0])


@pytest.mark.parametrize("model", [MODELS[0], MODELS[1], MODELS[3]], ids=lambda model: type(model).__name__)
@settings(max_examples=100, deadline=None)
@given(polar, polar, azimuth)
def test_reciprocity(model: PublishedModel, ti: float, tr: float, phi: float) -> None:
    there, back = model.mueller(ti, tr, phi), model.mueller(tr, ti, phi)
    assert_allclose(REVERSAL @ back.T @ REVERSAL, there, rtol=0.0, atol=1e-10 * there[0, 0])


def test_no_reciprocity_with_a_directional_lobe_or_a_masking_of_the_incoming_light_alone() -> None:
    assert asymmetry_under_exchange(ThreeComponent(0.0, 0.0, 1.0, 0.8, IRON)) > 0.1
    steep = Hao2023(1.0, 0.0, 0.0, 0.8, IRON, bounces=40)
    there, back = (steep.stokes(ti, tr, 2.5)[0] for ti, tr in ((1.4, 0.1), (0.1, 1.4)))
    assert abs(there - back) > 0.1 * there


@every_model
@settings(max_examples=150, deadline=None)
@given(st.floats(0.0, np.radians(89.9999)), st.floats(0.0, np.radians(89.9999)), st.floats(-7.0, 7.0))
def test_mueller_matrices_are_physical(model: PublishedModel, ti: float, tr: float, phi: float) -> None:
    assert is_physical(model.mueller(ti, tr, phi))


HARD = np.radians([0.0, 1e-8, 30.0, 60.0, 89.9999, 90.0])


@pytest.mark.parametrize("precision", [np.float64, np.float32])
@every_model
def test_hard_directions_are_finite_and_physical(model: PublishedModel, precision: type) -> None:
    turns = np.array([0.0, 1e-9, np.pi / 2.0, np.pi - 1e-9, np.pi, np.pi + 1e-9], precision)
    last = np.nextafter(precision(np.pi / 2.0), precision(0.0))
    polar_rad = np.append(HARD.astype(precision), [0.0, last]).astype(precision)
    at = (polar_rad[:, None, None], polar_rad[:, None], turns)
    matrices = model.mueller(*at)
    assert np.isfinite(matrices).all()
    assert is_physical(matrices, 1e-12 if precision is np.float64 else 1e-5).all()
    horizon = polar_rad >= precision(np.pi / 2.0)
    assert not matrices[horizon].any()
    assert not matrices[:, horizon].any()
    assert (matrices[~horizon][:, ~horizon][..., 0, 0] >= 0.0).all()
    assert np.isfinite(model.jacobian(model.parameters, *at)).all()


@pytest.mark.parametrize("extreme", [1e-4, 10.0])
@pytest.mark.parametrize("n", [1.0 + 1e-9, 1.5, 30.0])
def test_extreme_roughness_and_index_are_finite(extreme: float, n: float) -> None:
    for model in (PriestGermer(1.0, extreme, n), Hyde(1.0, 0.5, extreme, n), Baek2018(1.0, 0.5, extreme, n)):
        matrices = model.mueller(HARD[:, None, None], HARD[:, None], np.array([0.0, 1.0, np.pi]))
        assert np.isfinite(matrices).all()
        assert is_physical(matrices).all()


def reflected(model: PublishedModel, incidence_rad: float, nodes: int = 400) -> float:
    """Share of unpolarized light that leaves, by midpoints in cos² and azimuth."""
    midpoints = (np.arange(nodes) + 0.5) / nodes
    exits, turns = np.arccos(np.sqrt(midpoints))[:, None], 2.0 * np.pi * midpoints
    return float(np.pi * model.stokes(incidence_rad, exits, turns)[..., 0].mean())


@pytest.mark.parametrize("alpha", [0.1, 0.5, 1.0])
@pytest.mark.parametrize("incidence_deg", [0.0, 45.0, 80.0])
def test_specular_and_body_light_together_are_no_more_than_came(alpha: float, incidence_deg: float) -> None:
    # What the smooth surface lets in is what it does not reflect; a rough one reflects less at grazing angles.
    total = reflected(Baek2018(1.0, 1.0, alpha, GLASS), np.radians(incidence_deg))
    assert 0.5 < total < 1.0


def test_masking_keeps_a_mirror_below_one_and_its_lack_does_not() -> None:
    mirror, grazing = 1e-6 + 1e6j, np.radians(87.0)
    assert reflected(Hyde(1.0, 0.0, 0.4, mirror), grazing) < 1.0
    assert reflected(PriestGermer(1.0, 0.4, mirror), grazing) > 2.0


def test_a_smooth_ggx_surface_reflects_as_fresnel_says() -> None:
    angle, n = np.radians(50.0), 1.5
    c, w = np.cos(angle), np.sqrt(n**2 - np.sin(angle) ** 2)
    fresnel = (((c - w) / (c + w)) ** 2 + ((n**2 * c - w) / (n**2 * c + w)) ** 2) / 2.0
    # Walter et al. 2007 leave out what meets two facets, of the order of alpha.
    assert_allclose(reflected(Baek2018(1.0, 0.0, 0.03, n), angle, 3000), fresnel, rtol=0.02)


def test_specular_light_is_s_polarized_and_light_from_the_body_p_polarized() -> None:
    at = (np.radians(40.0), np.radians([20.0, 45.0, 70.0]), np.pi)
    specular, body = Baek2018(1.0, 0.0, 0.5, GLASS).stokes(*at), Baek2018(0.0, 1.0, 0.5, GLASS).stokes(*at)
    assert (specular[:, 1] > 0.0).all()
    assert (body[:, 1] < 0.0).all()
    assert_allclose(body[:, 2:], 0.0, atol=0.0)


@pytest.mark.parametrize("exit_rad", [1e-9, 0.01, 0.7, 1.3, 1.5707])
@pytest.mark.parametrize("n", [1.001, 1.5, 3.0])
def test_light_from_the_body_is_polarized_by_its_exit_alone(exit_rad: float, n: float) -> None:
    # (Tp - Ts)/(Tp + Ts) with its fractions cleared, also where a difference of transmittances has no digits left.
    sine2, cosine = np.sin(exit_rad) ** 2, np.cos(exit_rad)
    denominator = 2.0 + 2.0 * n**2 - (n + 1.0 / n) ** 2 * sine2 + 4.0 * cosine * np.sqrt(n**2 - sine2)
    contrast = (n - 1.0) * (n + 1.0) / n
    for incidence_rad in (0.0, 1.3):
        light = Baek2018(0.0, 1.0, 0.5, n).stokes(incidence_rad, exit_rad, 0.3)
        assert_allclose(-light[1] / light[0], contrast**2 * sine2 / denominator, rtol=1e-12)


def test_light_from_the_body_is_unpolarized_at_the_normal() -> None:
    assert dop(Baek2018(0.0, 1.0, 0.5, 1.5).stokes(1.3, 0.0, 0.3)) == 0.0


def test_a_thinner_body_lets_nothing_out_beyond_total_reflection() -> None:
    body = Baek2018(0.0, 1.0, 0.5, 0.8)
    inside, beyond = np.arcsin(0.8) - 1e-3, np.arcsin(0.8) + 1e-3
    assert body.stokes(0.2, inside, 1.0)[0] > 0.0
    assert not body.mueller(0.2, beyond, 1.0).any()
    assert np.isfinite(body.jacobian(["n"], 0.2, [inside, beyond], 1.0)).all()


ARGUMENTS = {
    PriestGermer: ("rho_s", "sigma"),
    Hyde: ("rho_s", "rho_d", "sigma"),
    ThreeComponent: ("rho_s", "rho_d", "rho_dd", "sigma"),
    Baek2018: ("rho_s", "rho_d", "alpha"),
    Hao2023: ("rho_s", "rho_d", "rho_dd", "sigma"),
}


@pytest.mark.parametrize("kind", ARGUMENTS, ids=lambda kind: kind.__name__)
def test_jacobians_are_derivatives(kind: type) -> None:
    at, step = (0.9, np.radians([15.0, 50.0, 70.0]), 2.6), 1e-5
    values = dict.fromkeys(ARGUMENTS[kind], 0.3) | {"n": 1.7} | ({} if kind is Baek2018 else {"k": 0.3})

    def made(**changed: float) -> PublishedModel:
        numbers = values | changed
        return kind(*(numbers[name] for name in ARGUMENTS[kind]), complex(numbers["n"], numbers.get("k", 0.0)))

    assert set(made().parameters) == set(values)
    jacobian = made().jacobian(tuple(values), *at)
    for column, (name, value) in enumerate(values.items()):
        change = made(**{name: value + step}).stokes(*at) - made(**{name: value - step}).stokes(*at)
        assert_allclose(jacobian[..., column], change / (2.0 * step), rtol=1e-6, atol=1e-9)


@every_model
def test_describe_names_the_authors_and_every_lobe(model: PublishedModel) -> None:
    first, *lobes = model.describe().splitlines()
    assert any(author in first for author in ("Priest and Germer", "Hyde", "Wang", "Baek", "Hao"))
    assert lobes == [lobe.describe() for lobe in model.lobes]


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Baek2018(1.0, 0.5, 0.3, IRON), r"index is \(2.95\+2.932j\).*real index, k = 0"),
        (lambda: Baek2018(1.0, 0.5, 0.3, -1.5), "n above 0"),
        (lambda: Baek2018(1.0, 0.5, 0.0, 1.5), "alpha is 0.0.*above 0"),
        (lambda: Baek2018(1.0, -0.5, 0.3, 1.5), "rho_d is -0.5"),
        (lambda: PriestGermer(-1.0, 0.3, 1.5), "rho_s is -1.0"),
        (lambda: PriestGermer(1.0, 0.0, 1.5), "sigma is 0.0"),
        (lambda: Hyde(1.0, np.nan, 0.3, 1.5), "rho_d is nan"),
        (lambda: ThreeComponent(1.0, 0.1, np.inf, 0.3, 1.5), "rho_dd is inf"),
        (lambda: Hao2023(1.0, 0.1, 0.1, 0.3, 1.5 - 1.0j), "k of at least 0"),
    ],
)
def test_what_cannot_be_is_refused(make, message) -> None:
    with pytest.raises(ValueError, match=message):
        make()
