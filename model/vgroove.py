"""Surfaces of V-grooves: how much light k reflections bring from i to r, and how it is polarized.

A groove has two straight walls that end at the same height. Light that meets one wall of a symmetric groove once and
leaves is the density of facets that mirror i into r, times the share G of such a facet that no wall hides; it needs no
more than the half vector. Everything else goes through `groove_reflectance`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from model.domain import above_horizon, require_directions
from model.facet import facet_mueller, facet_stokes
from model.fresnel import require_index
from model.geometry import Directions, FloatArray, directions
from model.groove_plane import groove_plane
from model.groove_reflectance import groove_mueller, groove_stokes
from model.mueller import UNPOLARIZED
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

    In the mirror direction itself more than one bounce is +inf in all elements: grooves of every orientation send light
    there, a caustic that only an average over directions makes finite. pi in double precision is not that direction.

    Parameters
    ----------
    bounces : int
        Number of reflections, at least 1.
    incidence_rad, exit_rad : array_like
        Angles from the normal, 0 to pi/2; at the horizon itself the result is 0.
    azimuth_rad : array_like
        phi_r - phi_i; pi is the mirror side. All three broadcast.
    sigma : float
        rms slope per axis, > 0.
    asymmetry : float
        a of grooves with walls of slopes t(1 + a) and t(1 - a); at least 0, below 1.
    index : complex
        Refractive index n + ik of the walls.

    Returns
    -------
    ndarray
        Mueller matrices (..., 4, 4) in 1/sr, from the s-frame of the incoming to the s-frame of the outgoing ray.

    Raises
    ------
    ValueError
        If an argument is outside its range.
    """
    _require_domain(bounces, incidence_rad, exit_rad, azimuth_rad, sigma, asymmetry, index)
    if bounces == 1 and asymmetry == 0.0:
        at = directions(incidence_rad, exit_rad, azimuth_rad)
        matrix = single_bounce(at, sigma)[..., None, None] * facet_mueller(at, index)
    else:
        plane = groove_plane(incidence_rad, exit_rad, azimuth_rad)
        matrix = groove_mueller(plane, bounces, sigma, asymmetry, index)
    return np.where(above_horizon(incidence_rad, exit_rad)[..., None, None], matrix, 0.0)


def bounce_stokes(
    bounces: int,
    incidence_rad: ArrayLike,
    exit_rad: ArrayLike,
    azimuth_rad: ArrayLike,
    *,
    sigma: float,
    asymmetry: float,
    index: complex,
    incoming: ArrayLike = UNPOLARIZED,
) -> FloatArray:
    """Stokes vectors (..., 4) in 1/sr of `bounce_mueller` times an incoming state; unpolarized light needs no matrix.

    Parameters
    ----------
    bounces, incidence_rad, exit_rad, azimuth_rad, sigma, asymmetry, index
        As for `bounce_mueller`.
    incoming : array_like
        Stokes vector (4,) or (..., 4) in the s-frame of the incoming ray.

    Raises
    ------
    ValueError
        If an argument is outside its range, or the Stokes vector has not four elements.
    """
    _require_domain(bounces, incidence_rad, exit_rad, azimuth_rad, sigma, asymmetry, index)
    state = np.asarray(incoming, dtype=np.float64)
    if state.shape[-1:] != (4,):
        raise ValueError(f"incoming has shape {state.shape}; a Stokes vector has four elements on its last axis.")
    if bounces == 1 and asymmetry == 0.0:
        at = directions(incidence_rad, exit_rad, azimuth_rad)
        stokes = single_bounce(at, sigma)[..., None] * facet_stokes(at, index, state)
    else:
        plane = groove_plane(*np.broadcast_arrays(incidence_rad, exit_rad, azimuth_rad, state[..., 0])[:3])
        stokes = groove_stokes(plane, bounces, sigma, asymmetry, index, state)
    return np.where(above_horizon(incidence_rad, exit_rad)[..., None], stokes, 0.0)


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


def _require_domain(
    bounces: int,
    incidence_rad: ArrayLike,
    exit_rad: ArrayLike,
    azimuth_rad: ArrayLike,
    sigma: float,
    asymmetry: float,
    index: complex,
) -> None:
    if not isinstance(bounces, int | np.integer) or bounces < 1:
        raise ValueError(f"bounces is {bounces}; it is a whole number of at least 1. Nothing was computed.")
    if not 0.0 <= asymmetry < 1.0:
        raise ValueError(f"asymmetry is {asymmetry:g}; allowed is at least 0 and below 1. Nothing was computed.")
    require_sigma(sigma)
    require_index(index)
    require_directions(incidence_rad, exit_rad, azimuth_rad)
