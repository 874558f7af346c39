"""Surfaces of V-grooves: how much light one reflection brings from i to r, and how it is polarized.

A groove has two straight walls that end at the same height. Light that meets one wall once and leaves is the
single-bounce term: the density of facets that mirror i into r, times the share G of such a facet that no wall hides.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from model.facet import facet_mueller
from model.fresnel import require_index
from model.geometry import Directions, FloatArray, directions
from model.slopes import normal_density, require_sigma


def masking(directions: Directions) -> FloatArray:
    """Share of a facet that is both lit and seen: G = min(1, 2 cos theta_h cos ti / cos beta, the same with tr).

    Source: Torrance and Sparrow 1967; beta is the angle of incidence on the facet.
    """
    lower = np.minimum(directions.cos_incidence, directions.cos_exit)
    return np.minimum(1.0, lower * _edge(directions))


def masking_over_cosines(directions: Directions) -> FloatArray:
    """G/(cos ti cos tr), which stays finite to the horizon where both G and the cosines vanish."""
    lower = np.minimum(directions.cos_incidence, directions.cos_exit)
    higher = np.maximum(directions.cos_incidence, directions.cos_exit)
    ratio: FloatArray = np.minimum(1.0 / lower, _edge(directions)) / higher
    return ratio


def single_bounce(directions: Directions, sigma: float) -> FloatArray:
    """Single-bounce reflectance of a perfect mirror in 1/sr, D G/(4 cos ti cos tr); eq. (6) of Hao et al. 2023."""
    reflectance: FloatArray = normal_density(directions.slope, sigma) * masking_over_cosines(directions) / 4.0
    return reflectance


def bounce_mueller(
    bounces: int,
    incidence_rad: ArrayLike,
    exit_rad: ArrayLike,
    azimuth_rad: ArrayLike,
    *,
    sigma: float,
    asymmetry: float,
    index: complex,
) -> FloatArray:
    """Polarimetric reflectance of the light that meets groove walls exactly `bounces` times.

    Parameters
    ----------
    bounces : int
        Number of reflections; only 1 is computed.
    incidence_rad, exit_rad, azimuth_rad : array_like
        Directions in radians; they broadcast.
    sigma : float
        rms slope per axis.
    asymmetry : float
        How much the two walls differ in slope; only 0, the symmetric groove, is computed.
    index : complex
        Refractive index n + ik of the walls.

    Returns
    -------
    ndarray
        Mueller matrices (..., 4, 4) in 1/sr.

    Raises
    ------
    ValueError
        If other grooves or more bounces are asked for, or sigma or index cannot be what they stand for.
    """
    if bounces != 1 or asymmetry != 0.0:
        raise ValueError(
            f"Only one bounce in symmetric grooves is supported (bounces = 1, asymmetry = 0); "
            f"bounces = {bounces}, asymmetry = {asymmetry:g} was asked for. Nothing was computed."
        )
    require_sigma(sigma)
    require_index(index)
    at = directions(incidence_rad, exit_rad, azimuth_rad)
    return single_bounce(at, sigma)[..., None, None] * facet_mueller(at, index)


def single_bounce_fraction(incidence_rad: float, sigma: float) -> float:
    """Fraction of the light on a perfect mirror surface that leaves after one bounce, to about 1e-4.

    Midpoint rule over the facets, equally probable in size and direction of their slope.

    Parameters
    ----------
    incidence_rad : float
        Angle of incidence, below pi/2.
    sigma : float
        rms slope per axis.
    """
    nodes = (np.arange(200) + 0.5) / 200.0
    size = sigma * np.sqrt(-2.0 * np.log(nodes))[:, None]
    along, across = size * np.cos(np.pi * nodes), size * np.sin(np.pi * nodes)
    sin_i, cos_i = np.sin(incidence_rad), np.cos(incidence_rad)
    # Everything per unit of the facet normal's vertical component: projected = cos beta/cos theta_h.
    projected = np.maximum(cos_i + sin_i * along, 0.0)
    exit_z = 2.0 * projected / (1.0 + along**2 + across**2) - cos_i
    seen_twice = np.minimum(projected, 2.0 * np.minimum(cos_i, exit_z))
    return float(np.maximum(seen_twice, 0.0).mean() / cos_i)


def _edge(directions: Directions) -> FloatArray:
    # 2 cos theta_h/cos beta = (cos ti + cos tr)/cos² beta.
    edge: FloatArray = (directions.cos_incidence + directions.cos_exit) / directions.cos_facet**2
    return edge
