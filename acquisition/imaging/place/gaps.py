"""Pictures with unknown pixels, for those who look for edges in them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def without_gaps(light: NDArray[np.float32]) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Fill pixels that are NaN with the mean of those about them, so that a bad pixel neither makes nor breaks an edge.

    Returns
    -------
    filled : ndarray
        Without NaN; in the midst of a gap of more than three pixels it is the picture's median.
    known : ndarray
        Where the filled picture says something: all but the inside of such gaps.
    """
    import cv2

    unknown = ~np.isfinite(light)
    if not unknown.any():
        return light, np.ones(light.shape, bool)
    level = float(np.median(light[~unknown])) if not unknown.all() else 0.0
    present = np.where(unknown, 0.0, light).astype(np.float32)
    weight = cv2.GaussianBlur((~unknown).astype(np.float32), (0, 0), 1.0)
    near = cv2.GaussianBlur(present, (0, 0), 1.0) / np.maximum(weight, 1e-6)
    known = ~unknown | (weight > 0.25)
    return np.where(unknown, np.where(known, near, level), light).astype(np.float32), known
