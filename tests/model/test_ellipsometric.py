"""Psi and delta of light: their sign, their derivatives, and where there is none."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from model.fit.ellipsometric import Ellipsometric, wrapped
from model.lobes import Specular
from model.surface import Surface

INCIDENCE_RAD = np.radians([20.0, 50.0, 75.0])


@pytest.mark.parametrize("index", [complex(1.5, 0.0), complex(0.2, 3.4), complex(2.95, 2.93)])
def test_a_smooth_surface_has_fresnels_ratio(index: complex) -> None:
    # exp(-i omega t) and N = n + ik: the phase of r_p/r_s is the negative of an ellipsometer's delta.
    cosine = np.cos(INCIDENCE_RAD)
    root = np.sqrt(index**2 - 1.0 + cosine**2 + 0j)
    ratio = (index**2 * cosine - root) / (index**2 * cosine + root) * (cosine + root) / (cosine - root)
    surface = Surface([Specular(1.0, 0.05, index)])
    light = surface.mueller(INCIDENCE_RAD, INCIDENCE_RAD, np.full(3, np.pi)).reshape(3, 16).T
    (psi, delta), _ = Ellipsometric().of(light, np.zeros((1, 16, 3)))
    assert_allclose(np.tan(psi) * np.exp(-1j * delta), ratio, rtol=1e-9, atol=1e-12)
    assert (delta >= 0.0).all()
    assert (delta <= np.pi).all()
    s0, s1 = light[0], light[4]
    assert_allclose(np.cos(2.0 * psi), s1 / s0, rtol=1e-12)


@pytest.mark.parametrize("has_delta", [True, False])
def test_derivatives_are_those_of_differences(has_delta: bool) -> None:
    rng = np.random.default_rng(0)
    light, slopes = rng.normal(size=(16, 5)), rng.normal(size=(3, 16, 5))
    observable, step = Ellipsometric(has_delta), 1e-6
    values, derivatives = observable.of(light, slopes)
    assert values.shape == (len(observable.columns), 5)
    for parameter in range(3):
        moved = [observable.of(light + sign * step * slopes[parameter], slopes)[0] for sign in (1.0, -1.0)]
        assert_allclose(derivatives[parameter], (moved[0] - moved[1]) / (2.0 * step), rtol=1e-6, atol=1e-8)


def test_light_without_delta_and_darkness_have_finite_slopes() -> None:
    light = np.zeros((16, 2))
    light[[0, 1], 0] = 1.0
    values, slopes = Ellipsometric().of(light, np.ones((1, 16, 2)))
    assert_array_equal(values[0], [0.0, 0.0])
    assert np.isfinite(slopes).all()


def test_delta_does_not_jump_where_surfaces_have_it() -> None:
    assert_allclose(wrapped(np.radians([-1.0, 0.0, 181.0, 359.0, -179.0])), np.radians([-1.0, 0.0, 181.0, -1.0, 181.0]))
