"""Mitsuba reads an exported surface and finds the model's Mueller matrices: angles, frames, signs and units agree."""

import json

import numpy as np
import pytest
from scipy.interpolate import RegularGridInterpolator

from goniometer.pbsdf.axes import relative_error
from goniometer.pbsdf.export import write_pbsdf
from goniometer.pbsdf.half_angles import half_angles, mueller_in_facet_frames
from goniometer.pbsdf.table import tabulated
from model.acceptance import Acceptance
from model.lobes import Diffuse, Directional, Specular
from model.surface import Surface

pytestmark = pytest.mark.interop

IRON = 2.95 + 2.932j
SURFACES = {
    "three lobes": Surface(
        [
            Specular(0.7, sigma=0.1764, index=IRON),
            Diffuse(0.1, sigma=0.1764),
            Directional(0.05, sigma=0.1764, index=IRON),
        ]
    ),
    # light that is circular in part, also of unpolarized light; two reflections are not mirrored onto each other
    "two bounces": Acceptance(Surface([Specular(1.0, sigma=0.6, index=IRON, bounces=2, asymmetry=0.3)]), 0.02, nodes=2),
}
NODES = {"three lobes": 200_000, "two bounces": 20_000}


@pytest.fixture
def directions():
    """Random ones, half of them near the mirror direction, where the specular lobe is."""
    draw = np.random.default_rng(3)
    incidence, exit_ = draw.uniform(0.02, np.radians(85.0), (2, 400))
    azimuth = draw.uniform(-np.pi, np.pi, 400)
    exit_[200:] = np.clip(incidence[200:] + draw.normal(0.0, 0.15, 200), 0.02, np.radians(85.0))
    azimuth[200:] = np.pi + draw.normal(0.0, 0.3, 200)
    return np.stack([incidence, exit_, azimuth])


@pytest.mark.parametrize("name", SURFACES)
def test_mitsuba_evaluates_what_the_model_says(name, directions, session, tmp_path):
    surface = SURFACES[name]
    table = tabulated(surface, NODES[name])
    path = tmp_path / "surface.pbsdf"
    write_pbsdf(path, table, name)
    found = np.array(session("mitsuba_session.py", str(path), json.dumps(directions.T.tolist())))

    true = surface.mueller(*directions)
    errors = relative_error(found, true)
    assert np.median(errors) < 3.0 * table.error.median
    assert np.quantile(errors, 0.9) < table.error.p99

    # what is left is the table's interpolation, not a sign: it takes the same in the frames of the table
    at = half_angles(*directions)
    angles = (table.axes.phi_d_rad, table.axes.theta_d_rad, table.axes.theta_h_rad)
    own = RegularGridInterpolator(angles, table.matrices.astype(float))(np.stack(at, axis=-1))
    in_facet = mueller_in_facet_frames(surface, *at)
    np.testing.assert_allclose(
        np.linalg.norm(found - true, axis=(1, 2)), np.linalg.norm(own - in_facet, axis=(1, 2)), rtol=0.05, atol=1e-4
    )


def test_every_element_that_polarizes_is_large_enough_to_be_compared(directions):
    seen = sum(
        np.abs(surface.mueller(*directions) / surface.mueller(*directions)[:, :1, :1]) for surface in SURFACES.values()
    )
    assert (seen.max(axis=0) > 0.05).all()
