"""The range of directions that the model knows, and what it says of others."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

_HORIZON_RAD = np.pi / 2.0
_FINITE = np.finfo(np.float64).max


# An azimuth beyond it is brought back to one turn, so that its sine can be computed fast.
_FAR_RAD = 1e4


def within_a_few_turns(azimuth_rad: NDArray[np.floating]) -> NDArray[np.floating]:
    """The same azimuths, those beyond a thousand turns counted from 0 again.

    Raises
    ------
    ValueError
        If one is not finite.
    """
    if azimuth_rad.size == 0 or (azimuth_rad.min() >= -_FAR_RAD and azimuth_rad.max() <= _FAR_RAD):
        return azimuth_rad
    _require_range("azimuth_rad", azimuth_rad, -_FINITE, _FINITE, "any finite angle")
    far = np.abs(azimuth_rad) > _FAR_RAD
    return np.where(far, np.arctan2(np.sin(azimuth_rad), np.cos(azimuth_rad)), azimuth_rad)


def require_polar(incidence_rad: ArrayLike, exit_rad: ArrayLike) -> None:
    """Raise ValueError unless incidence and exit lie from 0 to pi/2."""
    for name, angle in (("incidence_rad", incidence_rad), ("exit_rad", exit_rad)):
        # In single precision the number next to pi/2 is above it.
        horizon = np.asarray(angle).dtype.type(_HORIZON_RAD) if np.asarray(angle).dtype.kind == "f" else _HORIZON_RAD
        _require_range(name, angle, 0.0, horizon, "0 to pi/2")


def require_directions(incidence_rad: ArrayLike, exit_rad: ArrayLike, azimuth_rad: ArrayLike) -> None:
    """Raise ValueError unless incidence and exit lie from 0 to pi/2 and the azimuth is finite."""
    require_polar(incidence_rad, exit_rad)
    _require_range("azimuth_rad", azimuth_rad, -_FINITE, _FINITE, "any finite angle")


def _require_range(name: str, angle: ArrayLike, low: float, high: float, meaning: str) -> None:
    values = np.asarray(angle)
    if values.size == 0 or (low <= values.min() and values.max() <= high):  # both are nan if any value is
        return
    first = values[~((values >= low) & (values <= high))].flat[0]
    raise ValueError(f"{name} holds {first:.9g} rad; allowed is {meaning}. Nothing was computed.")


def require_asymmetry(asymmetry: float) -> None:
    """Raise ValueError unless the walls' slopes can differ by so much."""
    if not 0.0 <= asymmetry < 1.0:
        raise ValueError(f"asymmetry is {asymmetry:g}; allowed is at least 0 and below 1. Nothing was computed.")


def require_bounces(bounces: int) -> None:
    """Raise ValueError unless light can be reflected so many times."""
    if isinstance(bounces, bool) or not isinstance(bounces, int | np.integer) or bounces < 1:
        raise ValueError(f"bounces is {bounces}; it is a whole number of at least 1. Nothing was computed.")
