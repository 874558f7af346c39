"""The range of directions that the model knows, and what it says of others."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

_HORIZON_RAD = np.pi / 2.0


def require_directions(incidence_rad: ArrayLike, exit_rad: ArrayLike, azimuth_rad: ArrayLike) -> None:
    """Raise ValueError unless incidence and exit lie from 0 to pi/2 and the azimuth is finite."""
    for name, angle in (("incidence_rad", incidence_rad), ("exit_rad", exit_rad)):
        _require_range(name, angle, 0.0, _HORIZON_RAD, "0 to pi/2")
    _require_range("azimuth_rad", azimuth_rad, -np.inf, np.inf, "any finite angle")


def above_horizon(incidence_rad: ArrayLike, exit_rad: ArrayLike) -> NDArray[np.bool_]:
    """Whether both directions lie above the horizon, at which reflectance is 0 by definition."""
    above: NDArray[np.bool_] = np.less(incidence_rad, _HORIZON_RAD) & np.less(exit_rad, _HORIZON_RAD)
    return above


def _require_range(name: str, angle: ArrayLike, low: float, high: float, meaning: str) -> None:
    values = np.asarray(angle, dtype=np.float64)
    inside = np.isfinite(values) & (values >= low) & (values <= high)
    if not inside.all():
        first = values[~inside].flat[0]
        raise ValueError(f"{name} holds {first:.9g} rad; allowed is {meaning}. Nothing was computed.")
