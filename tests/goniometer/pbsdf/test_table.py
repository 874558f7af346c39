"""Tables of Mueller matrices over half and difference angles, read as Mitsuba reads them."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.interpolate import RegularGridInterpolator

from goniometer.pbsdf.axes import Axes, fitting_axes, random_pairs, relative_error
from goniometer.pbsdf.half_angles import half_angles, mueller_in_facet_frames, rays
from goniometer.pbsdf.table import NODES, tabulated
from model.acceptance import Acceptance
from model.lobes import Diffuse, Directional, Specular
from model.surface import Surface

IRON = 2.95 + 2.932j
SPECULAR = Specular(0.7, sigma=0.25, index=IRON)
THREE_LOBES = Surface(
    [
        Specular(0.7, sigma=0.18, index=IRON, asymmetry=0.3),
        Diffuse(0.1, sigma=0.18),
        Directional(0.05, sigma=0.18, index=IRON),
    ]
)
NARROW = Surface([Specular(0.7, sigma=0.02, index=1.5)])


def vectors(polar, azimuth):
    return np.stack([np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)], axis=-1)


def unit(vector):
    return vector / np.linalg.norm(vector, axis=-1, keepdims=True)


def turned_to(ray, x_from, x_to):
    """Rotators of Stokes vectors between x-axes of a ray, out of the fields' components themselves."""
    y_from, y_to = np.cross(ray, x_from), np.cross(ray, x_to)
    jones = np.stack([np.stack([(a * b).sum(-1) for b in (x_from, y_from)], axis=-1) for a in (x_to, y_to)], axis=-2)
    cos2, sin2 = jones[..., 0, 0] ** 2 - jones[..., 0, 1] ** 2, 2.0 * jones[..., 0, 0] * jones[..., 0, 1]
    matrix = np.zeros((*cos2.shape, 4, 4))
    matrix[..., 0, 0] = matrix[..., 3, 3] = 1.0
    matrix[..., 1, 1] = matrix[..., 2, 2] = cos2
    matrix[..., 1, 2], matrix[..., 2, 1] = sin2, -sin2
    return matrix


def random_angles(count):
    draw = np.random.default_rng(3)
    incidence, exit_ = draw.uniform(0.01, np.radians(85.0), (2, count))
    return incidence, exit_, draw.uniform(-np.pi, np.pi, count)


def test_half_angles_lead_back_to_the_rays():
    incidence, exit_, azimuth = random_angles(500)
    source, detector = rays(*half_angles(incidence, exit_, azimuth))
    assert_allclose(np.arccos(source[:, 2]), incidence, atol=1e-9)
    assert_allclose(np.arccos(detector[:, 2]), exit_, atol=1e-9)
    between = np.arctan2(detector[:, 1], detector[:, 0]) - np.arctan2(source[:, 1], source[:, 0])
    assert_allclose(np.exp(1j * between), np.exp(1j * azimuth), atol=1e-7)


def test_the_lower_source_is_at_phi_d_0():
    phi_d, theta_d, theta_h = half_angles(np.radians([50.0, 10.0]), np.radians([10.0, 50.0]), np.full(2, np.pi))
    assert_allclose(np.degrees([theta_d, theta_h]), [[30.0, 30.0], [20.0, 20.0]], atol=1e-9)
    assert_allclose(np.abs(np.degrees(phi_d)), [0.0, 180.0], atol=1e-6)


def test_matrices_refer_to_the_plane_of_the_two_rays():
    angles = random_angles(500)
    source, detector = vectors(angles[0], 0.0 * angles[2]), vectors(angles[1], angles[2])
    across = unit(np.cross(source, detector))
    up = np.array([0.0, 0.0, 1.0])
    from_facet = turned_to(-source, across, unit(np.cross(up, -source)))
    to_facet = turned_to(detector, unit(np.cross(up, detector)), across)
    expected = to_facet @ THREE_LOBES.mueller(*angles) @ from_facet
    found = mueller_in_facet_frames(THREE_LOBES, *half_angles(*angles))
    assert relative_error(found, expected).max() < 1e-9


def test_one_reflection_mixes_neither_45_degrees_nor_circular_light_into_s_and_p():
    matrices = mueller_in_facet_frames(Surface([SPECULAR]), *half_angles(*random_angles(500)))
    scale = matrices[:, :1, :1]
    assert np.abs(matrices[:, :2, 2:] / scale).max() < 1e-9
    assert np.abs(matrices[:, 2:, :2] / scale).max() < 1e-9
    assert (matrices[:, 0, 1] >= 0.0).all()  # a metal reflects more of s, which is +S1


def test_rays_that_coincide_have_a_frame():
    matrix = mueller_in_facet_frames(Surface([SPECULAR]), np.linspace(-3.0, 3.0, 7), 0.0, 0.3)
    assert np.isfinite(matrix).all()
    assert_allclose(matrix, np.broadcast_to(matrix[:1], matrix.shape), atol=1e-12 * matrix.max())


def test_below_the_horizon_a_table_goes_on_smoothly():
    # theta_d across the horizon of the source, at phi_d = 0
    theta_d = np.radians(np.linspace(60.0, 90.0, 301))
    brightness = mueller_in_facet_frames(THREE_LOBES, 0.0, theta_d, np.radians(15.0))[:, 0, 0]
    assert np.isfinite(brightness).all()
    assert np.abs(np.diff(brightness)).max() < 0.03 * brightness.max()


@pytest.mark.parametrize("surface", [THREE_LOBES, NARROW], ids=["three lobes", "narrow"])
def test_a_table_is_as_good_as_it_says(surface):
    table = tabulated(surface)
    assert np.prod(table.axes.shape) <= NODES
    angles = (table.axes.phi_d_rad, table.axes.theta_d_rad, table.axes.theta_h_rad)
    pairs = random_pairs(20_000, seed=99)
    found = RegularGridInterpolator(angles, table.matrices.astype(float))(np.stack(pairs, axis=-1))
    errors = relative_error(found, mueller_in_facet_frames(surface, *pairs))
    said = [table.error.median, table.error.p95, table.error.p99]
    assert_allclose(np.quantile(errors, [0.5, 0.95, 0.99]), said, rtol=0.15, atol=1e-12)
    assert said[1] < 0.02
    assert said[2] < 0.05


def test_angles_go_where_the_lobe_is():
    axes = fitting_axes(NARROW, 30_000)
    even = Axes(*(np.linspace(axis[0], axis[-1], axis.size) for axis in vars(axes).values()))
    pairs = random_pairs(20_000, seed=99)
    worst = []
    for grid in (axes, even):
        angles = tuple(vars(grid).values())
        matrices = mueller_in_facet_frames(NARROW, *np.meshgrid(*angles, indexing="ij", sparse=True))
        found = RegularGridInterpolator(angles, matrices)(np.stack(pairs, axis=-1))
        worst.append(np.quantile(relative_error(found, mueller_in_facet_frames(NARROW, *pairs)), 0.95))
    assert worst[0] < 0.1 * worst[1]


def test_axes_rise_and_reach_from_end_to_end():
    axes = fitting_axes(THREE_LOBES, 20_000)
    for axis, low, high in zip(vars(axes).values(), (-np.pi, 0.0, 0.0), (np.pi, np.pi / 2, np.pi / 2), strict=True):
        assert_allclose([axis[0], axis[-1]], [low, high])
        assert (np.diff(axis.astype(np.float32)) > 0.0).all()
    assert_allclose(axes.phi_d_rad, -axes.phi_d_rad[::-1])


def test_a_surface_seen_through_a_cone_has_a_table_where_the_surface_alone_is_infinite():
    two_bounces = Surface([Specular(0.7, sigma=0.3, index=IRON, bounces=2)])
    with pytest.raises(ValueError, match="is the mirror direction itself"):
        mueller_in_facet_frames(two_bounces, 0.5, 0.7, 0.0)
    seen = mueller_in_facet_frames(Acceptance(two_bounces, 0.02, nodes=3), 0.5, 0.7, 0.0)
    assert np.isfinite(seen).all()
