"""Ratios and angles read off Stokes vectors (..., 4), in the convention S1 > 0 is s-polarized, S3 > 0 clockwise.

Clockwise is as seen by the receiver, who looks at the source. Ratios are nan where S0 is 0; angles of light without
the polarization that they describe are 0. Linear quantities also take vectors (..., 3) without S3.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from model.geometry import FloatArray


def dop(stokes: ArrayLike) -> FloatArray:
    """Degree of polarization sqrt(S1² + S2² + S3²)/S0."""
    s = np.asarray(stokes, dtype=np.float64)
    return _share(np.linalg.norm(s[..., 1:4], axis=-1), s)


def dolp(stokes: ArrayLike) -> FloatArray:
    """Degree of linear polarization sqrt(S1² + S2²)/S0.

    Computed from the summed Stokes vector: the square printed in eq. (13) of Hao et al. 2023 loses a cross term.
    """
    s = np.asarray(stokes, dtype=np.float64)
    return _share(np.hypot(s[..., 1], s[..., 2]), s)


def docp(stokes: ArrayLike) -> FloatArray:
    """Degree of circular polarization S3/S0, with its sign: positive is clockwise."""
    s = np.asarray(stokes, dtype=np.float64)
    return _share(s[..., 3], s)


def aolp(stokes: ArrayLike) -> FloatArray:
    """Angle of linear polarization ½ atan2(S2, S1) in (-pi/2, pi/2], counted from the s-direction x towards y."""
    s = np.asarray(stokes, dtype=np.float64)
    angle = np.arctan2(s[..., 2], s[..., 1]) / 2.0
    # p-polarized light is at +pi/2, also when its S2 is a rounding error below zero.
    return np.where(angle <= -np.pi / 2.0, np.pi / 2.0, angle)


def ellipticity(stokes: ArrayLike) -> FloatArray:
    """Angle of ellipticity ½ atan2(S3, sqrt(S1² + S2²)) in [-pi/4, pi/4]; its tangent is the ellipse's axis ratio.

    Positive is clockwise, pi/4 is circular.
    """
    s = np.asarray(stokes, dtype=np.float64)
    angle: FloatArray = np.arctan2(s[..., 3], np.hypot(s[..., 1], s[..., 2])) / 2.0
    return angle


def _share(part: FloatArray, stokes: FloatArray) -> FloatArray:
    with np.errstate(invalid="ignore", divide="ignore"):
        share: FloatArray = part / stokes[..., 0]
    return share


def require_stokes(values: ArrayLike) -> FloatArray:
    """Stokes vectors (..., 4) as an array; ValueError if they have not four finite elements.

    Any are taken, also those that no light has: products with a matrix are linear.
    """
    stokes = np.asarray(values, dtype=np.float64)
    if stokes.shape[-1:] != (4,):
        raise ValueError(f"incoming has shape {stokes.shape}; a Stokes vector has four elements on its last axis.")
    finite = np.isfinite(stokes).all(axis=-1)
    if not finite.all():
        raise ValueError(
            f"incoming holds {stokes[~finite][0].tolist()}; a Stokes vector has finite elements. Nothing was computed."
        )
    return stokes


def is_unpolarized(stokes: FloatArray) -> bool:
    """Whether this is one Stokes vector, and that of unpolarized light."""
    return stokes.ndim == 1 and stokes[0] > 0.0 and not stokes[1:].any()
