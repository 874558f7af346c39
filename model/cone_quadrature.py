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
    bearing = np.where(far, 0.0, np.arctan2(across, along))

    nearest, farthest = np.tan((distance - half_angle_rad) / 2.0), np.tan((distance + half_angle_rad) / 2.0)
    psi, radius, area = _disc((farthest + nearest) / 2.0, (farthest - nearest) / 2.0, nodes, panels)
    weight = area * 4.0 / (1.0 + radius**2) ** 2 / (4.0 * np.pi * np.sin(half_angle_rad / 2.0) ** 2)

    theta, direction = 2.0 * np.arctan(radius), bearing[:, None] + psi
    sin_pole, cos_pole = np.sin(pole_polar)[:, None], np.cos(pole_polar)[:, None]
    outwards, sideways = np.sin(theta) * np.cos(direction), np.sin(theta) * np.sin(direction)
    height = np.cos(theta) * cos_pole - outwards * sin_pole
    horizontal = np.cos(theta) * sin_pole + outwards * cos_pole
    above = height > 0.0
    return Cones(
        polar_rad=np.where(above, np.arctan2(np.hypot(horizontal, sideways), height), 0.0),
        azimuth_rad=pole_azimuth[:, None] + np.arctan2(sideways, horizontal),
        weight=np.where(above, weight, 0.0),
    )


def _disc(centre: FloatArray, radius: FloatArray, nodes: int, panels: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Polar coordinates about a pole, and weights, of nodes in discs whose centres lie at ψ = 0; (discs, nodes)."""
    lines, line_weight = _gauss(_LINES_PER_NODE * nodes // 2)
    half, half_weight = lines * np.pi / 2.0, line_weight * np.pi / 2.0
    inside = (centre < radius)[:, None]
    c, r = centre[:, None], radius[:, None]
    # From inside: the half-plane towards the centre and the one away from it, each line from the pole to the rim.
    psi_in = np.concatenate([half, half + np.pi])
    end_in = c * np.cos(psi_in) + np.sqrt(np.maximum(r**2 - (c * np.sin(psi_in)) ** 2, 0.0))
    # From outside: lines that meet the disc, by the angle v at which they meet its rim.
    v, v_weight = (both * np.pi / 2.0 for both in _gauss(_LINES_PER_NODE * nodes))
    ratio = r / np.where(inside, np.inf, c)
    psi_out = np.arcsin(ratio * np.sin(v))
    middle, reach = c * np.cos(psi_out), r * np.cos(v)

    psi = np.where(inside, psi_in, psi_out)
    step = np.where(inside, np.concatenate([half_weight, half_weight]), v_weight * ratio * np.cos(v) / np.cos(psi_out))
    start, end = np.where(inside, 0.0, middle - reach), np.where(inside, end_in, middle + reach)
    share, share_weight = _graded(nodes, panels)
    distance = start[..., None] + (end - start)[..., None] * share
    area = step[..., None] * (end - start)[..., None] * share_weight * distance
    shape = (len(centre), area.shape[1] * area.shape[2])
    return np.broadcast_to(psi[..., None], area.shape).reshape(shape), distance.reshape(shape), area.reshape(shape)


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
