"""Whatever is allowed is answered: numbers, no warning, no negative light, no more polarization than light."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from model.lobes import Diffuse, Directional, Lobe, Specular
from model.surface import Surface
from model.vgroove import bounce_mueller, bounce_stokes

HORIZON = float(np.pi / 2.0)
BELOW_HORIZON = float(np.nextafter(HORIZON, 0.0))
ROUNDING, LEAST = 1e-12, 1e-290

edge_polar = [0.0, 5e-324, 1e-160, 1e-9, 0.5, np.pi / 4.0, 1.0, HORIZON - 1e-9, BELOW_HORIZON, HORIZON]
edge_azimuth = [0.0, -0.0, 1e-300, np.pi / 2.0, np.pi, -np.pi, np.pi - 1e-9, 2.0 * np.pi, 1e4, -1e15, 1e300]
polar = st.one_of(st.floats(0.0, HORIZON), st.sampled_from(edge_polar))
azimuth = st.one_of(st.floats(-7.0, 7.0), st.sampled_from(edge_azimuth))
directions = st.one_of(
    st.tuples(polar, polar, azimuth),
    # Beside the mirror direction and beside retro-reflection.
    st.builds(
        lambda angle, by, azimuth: (angle, min(max(angle + by, 0.0), HORIZON), azimuth + by),
        polar,
        st.sampled_from([0.0, 1e-16, 1e-12, -1e-12, 1e-6, -1e-3]),
        st.sampled_from([0.0, np.pi]),
    ),
)
roughness = st.one_of(
    st.floats(-5.0, 5.0).map(lambda exponent: min(max(10.0**exponent, 1e-5), 1e5)), st.floats(0.02, 3.0)
)
asymmetry = st.one_of(
    st.just(0.0), st.floats(0.0, 1.0, exclude_max=True), st.sampled_from([5e-324, 1e-9, 1.0 - 2.0**-53])
)
magnitude = st.floats(-8.0, 8.0).map(lambda exponent: min(max(10.0**exponent, 1e-8), 1e8))
index = st.one_of(
    st.builds(complex, st.floats(0.05, 8.0), st.one_of(st.just(0.0), st.floats(0.0, 10.0))),
    st.builds(complex, magnitude, st.one_of(st.just(0.0), magnitude)),
    st.sampled_from([1.0 + 0j, 1.0 + 1e-15 + 0j, 1.0 + 1e-9j, 0.5 + 0j, 0.5 + 1e-300j, 0.71 + 0j, 1e8 + 1e8j]),
)
weight = st.one_of(st.just(0.0), st.floats(1e-6, 1.0), st.just(1e6))
# Direction of the polarization, and how much of the light is polarized.
states = st.tuples(st.floats(0.0, np.pi), st.floats(-np.pi, np.pi), st.sampled_from([0.0, 0.5, 1.0]))
KINDS = [
    ["kaleidoscope 1"],
    ["kaleidoscope 2"],
    ["kaleidoscope 3"],
    ["single-fresnel 1", "diffuse printed", "directional 1"],
    ["single-fresnel 3", "diffuse exact", "directional 2"],
    ["kaleidoscope 2", "diffuse printed", "diffuse exact", "directional 1", "directional 2"],
]


def lobe(kind: str, rho: float, sigma: float, a: float, n: complex) -> Lobe:
    name, option = kind.split()
    if name == "diffuse":
        return Diffuse(rho, sigma, option)  # type: ignore[arg-type]
    if name == "directional":
        return Directional(rho, sigma, n, int(option))
    return Specular(rho, sigma, n, a if name == "kaleidoscope" else 0.0, int(option), name)  # type: ignore[arg-type]


def incoming(state: tuple[float, float, float]) -> NDArray[np.float64]:
    colatitude, longitude, share = state
    along = np.cos(colatitude), np.sin(colatitude) * np.cos(longitude), np.sin(colatitude) * np.sin(longitude)
    return np.array([1.0, *(share * np.array(along))])


def is_mirror(at: tuple[float, float, float]) -> bool:
    """Whether the detector is in the mirror direction to all digits, which pi is only where the angles vanish."""
    return max(at[:2]) < 1e-130


def is_mirror_as_rounded(at: tuple[float, float, float]) -> bool:
    """Whether the angles could be those of the mirror direction before they were rounded."""
    incidence, exit_, azimuth = at
    across = abs(np.cos(azimuth / 2.0)) * incidence
    return abs(incidence - exit_) <= 1e-15 * incidence + 1e-130 and across <= 1e-15 * max(1.0, abs(azimuth))


def require_light(stokes: NDArray[np.floating], scale: float) -> None:
    """No NaN, S0 >= 0, and no more polarization than light, to rounding of what unpolarized light would be."""
    assert np.isfinite(stokes).all()
    i, *polarized = stokes / max(scale, LEAST)  # whose squares do not underflow
    assert i >= -ROUNDING
    assert np.linalg.norm(polarized) <= i + ROUNDING + LEAST / max(scale, LEAST)


class Case(NamedTuple):
    """Directions (incidence, exit, azimuth), number of bounces, kinds of lobes, their numbers, and incoming light."""

    at: tuple[float, float, float]
    bounces: int
    kinds: list[str]
    rho: float
    sigma: float
    asymmetry: float
    index: complex
    state: tuple[float, float, float]


def cases(most_bounces: int) -> st.SearchStrategy[Case]:
    bounces, kinds = st.integers(1, most_bounces), st.sampled_from(KINDS)
    return st.builds(Case, directions, bounces, kinds, weight, roughness, asymmetry, index, states)


def check_bounces(case: Case) -> None:
    evaluate = {"sigma": case.sigma, "asymmetry": case.asymmetry, "index": case.index}
    matrix = bounce_mueller(case.bounces, *case.at, **evaluate)  # type: ignore[arg-type]
    stokes = bounce_stokes(case.bounces, *case.at, **evaluate, incoming=incoming(case.state))  # type: ignore[arg-type]
    if np.isinf(matrix[0, 0]):
        assert case.bounces > 1
        assert is_mirror(case.at)
        assert np.isinf(matrix).all()
        assert np.isinf(stokes).all()
        return
    assert matrix[0, 0] >= 0.0
    assert np.abs(matrix).max() <= matrix[0, 0] * (1.0 + ROUNDING) + LEAST
    require_light(matrix[:, 0], matrix[0, 0])
    require_light(stokes, matrix[0, 0])
    if HORIZON in case.at[:2]:
        assert not matrix.any()


def check_surface(case: Case) -> None:
    surface = Surface([lobe(kind, case.rho, case.sigma, case.asymmetry, case.index) for kind in case.kinds])
    try:
        matrix = surface.mueller(*case.at)
    except ValueError:
        assert is_mirror_as_rounded(case.at)
        assert any(lobe.has_caustic for lobe in surface.lobes)
        for evaluate in (surface.mueller, surface.stokes, lambda *at: surface.jacobian(["sigma"], *at)):
            with pytest.raises(ValueError, match="mirror direction itself"):
                evaluate(*case.at)
        return
    assert np.isfinite(matrix).all()
    assert matrix[0, 0] >= 0.0
    require_light(matrix[:, 0], matrix[0, 0])
    require_light(surface.stokes(*case.at, incoming(case.state)), matrix[0, 0])
    assert np.isfinite(surface.jacobian(surface.parameters, *case.at, incoming(case.state))).all()


GLASS, TILTED = 1.5 + 0j, (0.3, 0.2, 1.0)


@settings(max_examples=300, deadline=None)
@given(cases(most_bounces=3))
@example(Case((0.0, 0.0, 1.0), 2, KINDS[-1], 1.0, 0.5, 0.0, GLASS, TILTED))  # the mirror direction itself
@example(Case((0.0, 0.0, 1.0), 1, KINDS[0], 1.0, 1e-5, 0.0, GLASS, TILTED))
@example(Case((1.2, BELOW_HORIZON, 1.0), 3, KINDS[4], 1.0, 1e5, 0.3, GLASS, TILTED))
def test_anything(case: Case) -> None:
    check_bounces(case)
    check_surface(case)


@pytest.mark.long
@pytest.mark.timeout(3600)
@settings(max_examples=100_000, deadline=None)
@given(cases(most_bounces=9))
def test_anything_a_hundred_thousand_times(case: Case) -> None:
    check_bounces(case)
    check_surface(case)
