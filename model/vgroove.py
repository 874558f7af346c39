"""Surfaces of V-grooves: how much light k reflections bring from i to r, and how it is polarized.

A groove has two straight walls that end at the same height. Light that meets one wall of a symmetric groove once and
leaves is the density of facets that mirror i into r, times the share G of such a facet that no wall hides.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from model.domain import require_asymmetry, require_bounces
from model.evaluation import Addend, Form, Light, Program, evaluate
from model.fresnel import require_index
from model.geometry import Angles
from model.groove_reflectance import groove_mueller
from model.kernel.expression import Value
from model.matrix import Matrix
from model.mueller import UNPOLARIZED
from model.slopes import require_sigma
from model.stokes import is_unpolarized, require_stokes

_NUMBERS = ("sigma", "asymmetry", "n", "k")


def bounce_mueller(
    bounces: int,
    incidence_rad: ArrayLike,
    exit_rad: ArrayLike,
    azimuth_rad: ArrayLike,
    *,
    sigma: float,
    asymmetry: float,
    index: complex,
) -> NDArray[np.floating]:
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
        phi_r - phi_i; pi is the mirror side. All three broadcast; float32 arrays are computed with in single precision.
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
    program, numbers = _program(bounces, sigma, asymmetry, index, "mueller")
    elements = evaluate(program, numbers, incidence_rad, exit_rad, azimuth_rad)
    return np.moveaxis(elements.reshape(4, 4, *elements.shape[1:]), (0, 1), (-2, -1))


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
) -> NDArray[np.floating]:
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
    state = require_stokes(incoming)
    unpolarized = is_unpolarized(state)
    program, numbers = _program(bounces, sigma, asymmetry, index, "unpolarized" if unpolarized else "stokes")
    elements = evaluate(program, numbers, incidence_rad, exit_rad, azimuth_rad, None if unpolarized else state)
    stokes = np.moveaxis(elements, 0, -1)
    return stokes * state[0].astype(stokes.dtype) if unpolarized and state[0] != 1.0 else stokes


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


def _program(
    bounces: int, sigma: float, asymmetry: float, index: complex, light: Light
) -> tuple[Program, dict[str, float]]:
    require_bounces(bounces)
    require_asymmetry(asymmetry)
    require_sigma(sigma)
    require_index(index)
    values = (sigma, asymmetry, complex(index).real, complex(index).imag)
    form = Form(_one_count, (int(bounces), asymmetry == 0.0))
    wiring = tuple((name, name) for name in _NUMBERS)
    return Program((Addend(form, wiring),), _NUMBERS, light), dict(zip(_NUMBERS, values, strict=True))


def _one_count(at: Angles, numbers: Mapping[str, Value], bounces: int, symmetric: bool) -> Matrix:
    asymmetry = 0.0 if symmetric else numbers["asymmetry"]
    return groove_mueller(at, [bounces], numbers["sigma"], asymmetry, numbers["n"], numbers["k"])
