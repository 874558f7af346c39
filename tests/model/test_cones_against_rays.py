"""Polarized light in a detector's cone: the closed form averaged over the cone against rays in explicit grooves."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_array_less

from model.acceptance import Acceptance
from model.bounce_bound import bounces_for
from model.lobes import Specular
from model.raytrace import LitSurface
from model.raytrace_cone import Cone, cone_mueller
from model.surface import Surface

INDICES = [1.5 + 0j, 0.97 + 6.4j, 2.95 + 2.932j, 1.0 / 1.5 + 0j]


def assert_rays_agree(setting: int, rays: int) -> None:
    """All sixteen elements within four standard errors, where at least a few hundred rays land."""
    random = np.random.default_rng([2025, setting])
    asymmetry = random.choice([0.0, random.uniform(0.0, 0.8)])
    lit = LitSurface(random.uniform(0.0, 1.3), 10.0 ** random.uniform(-0.9, -0.1), asymmetry)
    half_angle = np.radians(random.uniform(0.3, 4.0))
    if setting % 2:  # about the mirror direction, where the caustic is
        near = random.uniform(-3.0, 3.0, 2) * half_angle
        exit_rad, azimuth_rad = abs(lit.incidence_rad + near[0]), np.pi + near[1]
    else:
        exit_rad, azimuth_rad = random.uniform(0.0, 1.3), random.uniform(-np.pi, np.pi)
    cone, index = Cone(exit_rad, azimuth_rad, half_angle), INDICES[setting % len(INDICES)]

    bounces = bounces_for(1e-7, lit.sigma, lit.asymmetry)
    surface = Surface([Specular(1.0, lit.sigma, index, lit.asymmetry, bounces)])
    expected = Acceptance(surface, half_angle, nodes=24).mueller(lit.incidence_rad, exit_rad, azimuth_rad)
    if expected[0, 0] < 1e-20:
        pytest.skip("The tracer leaves out slopes beyond 12 sigma, which is all there is here.")
    sample = cone_mueller(lit, cone, index=index, rays=rays, seed=setting)
    assert sample.stderr[0, 0] < 0.1 * sample.mean[0, 0], "choose another setting: few rays land"
    tolerance = 4.0 * sample.stderr + 1e-4 * sample.mean[0, 0]
    assert_array_less(np.abs(sample.mean - expected), tolerance, err_msg=f"{lit} {cone} {index}")


@pytest.mark.parametrize("setting", range(4))
def test_all_light_in_a_cone(setting: int) -> None:
    assert_rays_agree(setting, 50_000)


@pytest.mark.long
@pytest.mark.parametrize("setting", range(4, 104))
def test_all_light_in_a_cone_at_a_hundred_settings(setting: int) -> None:
    assert_rays_agree(setting, 300_000)
