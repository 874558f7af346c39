"""Quadrature over a cone of directions, along lines through a pole where the integrand may go as one over the distance.

Seen from the pole in stereographic projection, ϱ = tan(θ/2), the cone is a disc, whose lines through the pole end on
its rim. The element of solid angle, 4 ϱ dϱ dψ/(1 + ϱ²)², takes such a pole away, so that Gauss's rules serve along the
lines and from line to line.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from model.geometry import FloatArray

_LINES_PER_NODE = 4
_SHORTEST = 1e-10


@dataclass(frozen=True)
class Cones:
    """Directions of a quadrature over cones, one cone a row.

    Attributes
    ----------
    polar_rad, azimuth_rad : ndarray
        Shape (cones, nodes).
    weight : ndarray
        Same shape, over a row in sum 1 up to the quadrature's error; 0 below the horizon.
    """

    polar_rad: FloatArray
    azimuth_rad: FloatArray
    weight: FloatArray


def cones(
    polar_rad: FloatArray,
    azimuth_rad: FloatArray,
    half_angle_rad: float,
    pole_polar_rad: FloatArray,
    pole_azimuth_rad: FloatArray,
    stretch: FloatArray,
    nodes: int,
    panels: int,
) -> Cones:
    """Nodes and weights of means over circular cones.

    Parameters
    ----------
    polar_rad, azimuth_rad : ndarray
        Shape (cones,); the central directions, polar angle from the normal.
    half_angle_rad : float
        Of all cones, above 0.
    pole_polar_rad, pole_azimuth_rad : ndarray
        Shape (cones,); the poles, inside or outside of the cones.
    stretch : ndarray
        Shape (cones,); how much narrower than along the pole's meridian the integrand is across it, above 0 to 1. Lines
        are denser where it is narrow.
    nodes : int
        Nodes on each panel of a line; the cone has four times as many lines.
    panels : int
        Panels of each line, each next to the pole half as long as the one before.
    """
    # The centre as seen from the pole, from differences of angles: along and across the pole's meridian.
    turn = azimuth_rad - pole_azimuth_rad
    along = np.sin(polar_rad - pole_polar_rad) - 2.0 * np.cos(pole_polar_rad) * np.sin(polar_rad) * _haversine(turn)
    across = np.sin(polar_rad) * np.sin(turn)
    cos = 1.0 - 2.0 * (
        _haversine(polar_rad - pole_polar_rad) + np.sin(polar_rad) * np.sin(pole_polar_rad) * _haversine(turn)
    )
    # A pole far away has nothing to say; the centre of the cone serves in its place.
    far = cos < 0.0
    pole_polar, pole_azimuth = np.where(far, polar_rad, pole_polar_rad), np.where(far, azimuth_rad, pole_azimuth_rad)
    distance = np.where(far, 0.0, np.arctan2(np.hypot(along, across), cos))
    # Of a centre that is the pole itself all bearings are one; lines are densest about the meridian.
    bearing = np.where(distance > _SHORTEST, np.arctan2(across, along), 0.0)

    nearest, farthest = np.tan((distance - half_angle_rad) / 2.0), np.tan((distance + half_angle_rad) / 2.0)
    middle = (farthest + nearest) / 2.0
    x, y, area = _disc(
        middle * np.cos(bearing),
        middle * np.sin(bearing),
        (farthest - nearest) / 2.0,
        np.where(far, 1.0, stretch),
        nodes,
        panels,
    )
    radius = np.hypot(x, y)
    weight = area / ((1.0 + radius**2) ** 2 * np.pi * np.sin(half_angle_rad / 2.0) ** 2)
    if panels == 1:
        # What varies little over the cone is averaged exactly so; what stands close to the pole is better off without.
        weight = weight / weight.sum(axis=1, keepdims=True)

    # Back onto the sphere: parts along the pole's meridian, across it, and along the pole.
    sin_pole, cos_pole = np.sin(pole_polar)[:, None], np.cos(pole_polar)[:, None]
    scale = 1.0 / (1.0 + radius**2)
    outwards, sideways, towards = 2.0 * x * scale, 2.0 * y * scale, (1.0 - radius**2) * scale
    height = towards * cos_pole - outwards * sin_pole
    horizontal = towards * sin_pole + outwards * cos_pole
    above = height > 0.0
    return Cones(
        polar_rad=np.where(above, np.arctan2(np.hypot(horizontal, sideways), height), 0.0),
        azimuth_rad=pole_azimuth[:, None] + np.arctan2(sideways, horizontal),
        weight=np.where(above, weight, 0.0),
    )


def _disc(
    centre_x: FloatArray, centre_y: FloatArray, radius: FloatArray, stretch: FloatArray, nodes: int, panels: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Coordinates (discs, nodes) about a pole, and weights, on lines x = s cos η, y = stretch s sin η through it."""
    inside = (np.hypot(centre_x, centre_y) < radius)[:, None]
    cx, cy, r, q = (part[:, None] for part in (centre_x, centre_y, radius, stretch))
    eta_in, step_in = _from_inside(cx, q * cy, nodes)
    eta_out, step_out, root_out = _from_outside(cx, cy, np.where(inside, 0.0, r), q, nodes)
    eta, step = np.where(inside, eta_in, eta_out), np.where(inside, step_in, step_out)

    # Where the lines meet the rim: a s² - 2 b s + c² - r² = 0.
    ux, uy = np.cos(eta), q * np.sin(eta)
    a, b = ux**2 + uy**2, ux * cx + uy * cy
    root = np.where(inside, np.sqrt(np.maximum(b**2 + a * (r**2 - cx**2 - cy**2), 0.0)), root_out)
    start, end = np.where(inside, 0.0, (b - root) / a), (b + root) / a
    # With the pole on the rim itself lines away from the cone have no length; none may end in the pole.
    end = np.where(inside, np.maximum(end, _SHORTEST), end)
    share, share_weight = _graded(nodes, panels)
    s = start[..., None] + (end - start)[..., None] * share
    area = (q * step * (end - start))[..., None] * share_weight * s
    shape = (len(centre_x), area.shape[1] * area.shape[2])
    return (s * ux[..., None]).reshape(shape), (s * uy[..., None]).reshape(shape), area.reshape(shape)


def _from_inside(bx: FloatArray, by: FloatArray, nodes: int) -> tuple[FloatArray, FloatArray]:
    # The half-plane towards the centre and the one away from it, between which the rim may be close to the pole.
    line, weight = _gauss(_LINES_PER_NODE * nodes // 2)
    half, step = line * np.pi / 2.0, weight * np.pi / 2.0
    eta = np.arctan2(by, bx) + np.concatenate([half, half + np.pi])
    return eta, np.broadcast_to(np.concatenate([step, step]), eta.shape)


def _from_outside(
    cx: FloatArray, cy: FloatArray, r: FloatArray, q: FloatArray, nodes: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    # b² - a (c² - r²) is a quadratic form in (cos η, sin η), positive about one axis η0: λ1 cos² + λ2 sin² of η - η0.
    beyond = np.maximum(cx**2 + cy**2 - r**2, 0.0)
    xx, yy, xy = cx**2 - beyond, q**2 * (cy**2 - beyond), q * cx * cy
    mean, spread = (xx + yy) / 2.0, np.hypot((xx - yy) / 2.0, xy)
    axis = 0.5 * np.arctan2(2.0 * xy, xx - yy)
    axis = axis + np.where(np.cos(axis) * cx + q * np.sin(axis) * cy < 0.0, np.pi, 0.0)
    first = np.maximum(mean + spread, 0.0)
    line, weight = _gauss(_LINES_PER_NODE * nodes)
    v, step = line * np.pi / 2.0, weight * np.pi / 2.0
    widest = np.sqrt(first / np.where(spread > 0.0, 2.0 * spread, 1.0))
    sine = np.minimum(widest, 1.0) * np.sin(v)
    lean = np.arcsin(sine)
    return axis + lean, step * np.minimum(widest, 1.0) * np.cos(v) / np.cos(lean), np.sqrt(first) * np.cos(v)


@cache
def _gauss(count: int) -> tuple[FloatArray, FloatArray]:
    node, weight = np.polynomial.legendre.leggauss(count)
    return node, weight


@cache
def _graded(count: int, panels: int) -> tuple[FloatArray, FloatArray]:
    # From 0 to 1 in panels that are shorter towards 0.
    edges = np.concatenate([[0.0], 0.5 ** np.arange(panels - 1, -1, -1)])
    node, weight = _gauss(count)
    widths = np.diff(edges)[:, None]
    return (edges[:-1, None] + widths * (node + 1.0) / 2.0).ravel(), (widths * weight / 2.0).ravel()


def _haversine(angle_rad: FloatArray) -> FloatArray:
    sine: FloatArray = np.sin(angle_rad / 2.0)
    return sine * sine
