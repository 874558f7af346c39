"""Sets of directions at 60° incidence that speed is measured on, in radians, all of them exact in single precision."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Directions = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]

LARGEST_EXIT_DEG, TURN_DEG = 85.0, 360.0
AZIMUTHS_PER_EXIT = 400


def scattered(count: int) -> Directions:
    """Random exit angles and azimuths out of plane, an incidence for each: arrays of one length, as peers take them."""
    random = np.random.default_rng(1)
    exit_deg, azimuth_deg = random.uniform(0.0, LARGEST_EXIT_DEG, count), random.uniform(0.0, TURN_DEG, count)
    return _radians(np.full(count, 60.0)), _radians(exit_deg), _radians(azimuth_deg)


def tabulated(count: int) -> Directions:
    """A grid of exit angles by azimuths, as one tabulates a reflectance: arrays that broadcast, neighbours in order."""
    exit_deg = _midpoints(0.0, LARGEST_EXIT_DEG, count // AZIMUTHS_PER_EXIT)
    azimuth_deg = _midpoints(0.0, TURN_DEG, AZIMUTHS_PER_EXIT)
    return _radians(np.array(60.0)), _radians(exit_deg)[:, None], _radians(azimuth_deg)


def scanned(count: int) -> Directions:
    """A scan in the plane of incidence, through the mirror direction but not onto it."""
    signed_deg = _midpoints(-LARGEST_EXIT_DEG, LARGEST_EXIT_DEG, count)
    return _radians(np.array(60.0)), _radians(np.abs(signed_deg)), _radians(np.where(signed_deg > 0.0, 180.0, 0.0))


DIRECTION_SETS: dict[str, Callable[[int], Directions]] = {"random": scattered, "grid": tabulated, "in plane": scanned}


def _midpoints(start: float, stop: float, count: int) -> NDArray[np.float64]:
    return start + (stop - start) * (np.arange(count) + 0.5) / count


def _radians(angle_deg: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.radians(angle_deg).astype(np.float32).astype(np.float64)
