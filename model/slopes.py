"""The distribution of facet slopes: isotropic Gaussian, rms sigma per axis.

Beckmann's m is sigma·sqrt 2. Papers that print cos³ where D has cos⁴ carry one more 1/cos in the reflectance.
"""

from __future__ import annotations

import numpy as np

from model.geometry import FloatArray


def slope_density(slope: FloatArray, sigma: float) -> FloatArray:
    """Density of facets over the slope plane, exp(-slope²/2 sigma²)/(2 pi sigma²); underflows to 0."""
    with np.errstate(under="ignore"):
        density: FloatArray = np.exp(-0.5 * (slope / sigma) ** 2) / (2.0 * np.pi * sigma**2)
    return density


def normal_density(slope: FloatArray, sigma: float) -> FloatArray:
    """Density D(theta_h) of facet normals over the hemisphere, so that ∫ D cos(theta) d omega = 1.

    Parameters
    ----------
    slope : ndarray
        tan theta_h.
    sigma : float
        rms slope per axis.
    """
    density: FloatArray = slope_density(slope, sigma) * (1.0 + slope**2) ** 2
    return density


def require_sigma(sigma: float) -> None:
    """Raise ValueError unless sigma can be an rms slope."""
    if not 0.0 < sigma < np.inf:
        raise ValueError(f"sigma is {sigma}; the rms slope must be a finite number above 0.")
