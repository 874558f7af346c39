"""The distribution of facet slopes: isotropic Gaussian, rms sigma per axis.

Beckmann's m is sigma·sqrt 2. Papers that print cos³ where D has cos⁴ carry one more 1/cos in the reflectance.
"""

from __future__ import annotations

import math

from model.kernel.expression import Value, damped

# Beyond every surface, and far from where squares overflow.
_SMALLEST, _LARGEST = 1e-5, 1e5


def slope_density(slope: Value, sigma: Value, factor: Value = 1.0) -> Value:
    """Density of facets over the slope plane times a factor, exp(-slope²/2 sigma²)/(2 pi sigma²); underflows to 0.

    Parameters
    ----------
    slope : Value
        Size of the slope.
    sigma : Value
        rms slope per axis.
    factor : Value
        What the density is multiplied with: a large one must not meet a density without digits.
    """
    half = slope * (1.0 / (2.0 * sigma))
    return damped(factor * (1.0 / (2.0 * math.pi * sigma * sigma)), -(half * half))


def normal_density(slope: Value, sigma: Value) -> Value:
    """Density D(theta_h) of facet normals over the hemisphere, so that ∫ D cos(theta) d omega = 1.

    Parameters
    ----------
    slope : Value
        tan theta_h.
    sigma : Value
        rms slope per axis.
    """
    stretch = 1.0 + slope * slope
    return slope_density(slope, sigma, stretch * stretch)


def require_sigma(sigma: float) -> None:
    """Raise ValueError unless sigma can be an rms slope."""
    if not _SMALLEST <= sigma <= _LARGEST:
        raise ValueError(f"sigma is {sigma}; the rms slope is from {_SMALLEST:g} to {_LARGEST:g}.")
