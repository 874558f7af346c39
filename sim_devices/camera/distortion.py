"""A lens' distortion, as OpenCV's `calib3d` has it (its documentation, "Camera Calibration and 3D Reconstruction")."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
Coefficients = tuple[float, float, float, float, float]

# Newton's method doubles the digits with every step once it is near.
_STEPS = 30
_CONVERGED = 1e-13


def distorted(x: FloatArray, y: FloatArray, coefficients: Coefficients) -> tuple[FloatArray, FloatArray]:
    """Where the lens puts directions.

    Parameters
    ----------
    x, y : ndarray
        Tangents of the directions, x/z and y/z of the camera's axes.
    coefficients : tuple of float
        k1, k2, p1, p2, k3.

    Returns
    -------
    x, y : ndarray
        Where a lens without distortion would show what this one shows there; times `focal_px` they are pixels.
    """
    k1, k2, p1, p2, k3 = coefficients
    r2 = x * x + y * y
    radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    return (
        x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
        y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
    )


def undistorted(x: FloatArray, y: FloatArray, coefficients: Coefficients) -> tuple[FloatArray, FloatArray]:
    """The directions that the lens puts at x and y, the inverse of `distorted`.

    Raises
    ------
    ValueError
        If no direction is put at some of them, or the picture is folded over there.
    """
    if not any(coefficients):
        return x, y
    u, v = x, y
    for _ in range(_STEPS):
        (at_x, at_y), (xx, xy, yy) = distorted(u, v, coefficients), _slopes(u, v, coefficients)
        area = xx * yy - xy * xy
        if not (area > 0.0).all():
            break
        du, dv = (yy * (x - at_x) - xy * (y - at_y)) / area, (xx * (y - at_y) - xy * (x - at_x)) / area
        u, v = u + du, v + dv
        if max(np.abs(du).max(), np.abs(dv).max()) < _CONVERGED:
            return u, v
    raise ValueError(
        f"the distortion {list(coefficients)} folds the picture over, or leaves parts of it without a direction; "
        "give k1, k2, p1, p2, k3 that hold as far as the picture's corners"
    )


def _slopes(x: FloatArray, y: FloatArray, coefficients: Coefficients) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Derivatives of `distorted`, x by x, x by y (which is y by x), and y by y."""
    k1, k2, p1, p2, k3 = coefficients
    r2 = x * x + y * y
    radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    rise = 2.0 * (k1 + r2 * (2.0 * k2 + 3.0 * r2 * k3))
    return (
        radial + rise * x * x + 2.0 * p1 * y + 6.0 * p2 * x,
        rise * x * y + 2.0 * p1 * x + 2.0 * p2 * y,
        radial + rise * y * y + 6.0 * p1 * y + 2.0 * p2 * x,
    )
