"""The mirror direction, where light of two and more bounces in straight grooves has a pole."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike


def require_off_mirror(incidence_rad: ArrayLike, exit_rad: ArrayLike, azimuth_rad: ArrayLike) -> None:
    """Raise ValueError if a direction is the mirror direction, as far as its angles' own rounding can tell.

    Parameters
    ----------
    incidence_rad, exit_rad, azimuth_rad : array_like
        Angles in radians, which broadcast.
    """
    incidence, exit_, azimuth = np.broadcast_arrays(incidence_rad, exit_rad, azimuth_rad)
    # Closer than the angles' own rounding, which no azimuth of "pi" can beat, there is no other direction.
    floats = [np.finfo(angle.dtype) for angle in (incidence, exit_, azimuth) if angle.dtype.kind == "f"]
    coarsest = max(floats or [np.finfo(np.float64)], key=lambda kind: kind.eps)
    rounding = 4.0 * float(coarsest.eps)
    near = np.abs(incidence - exit_) <= rounding * incidence + 1e5 * float(coarsest.tiny) ** 0.5
    if not near.any():
        return
    at = incidence[near], exit_[near], azimuth[near]
    across = np.abs(np.cos(at[2] / 2.0)) * at[0]
    pole = (at[0] < np.pi / 2.0) & (across <= rounding * np.maximum(1.0, np.abs(at[2])))
    if pole.any():
        where = "incidence {:.6g}°, exit {:.6g}°, azimuth {:.6g}°".format(
            *(float(np.degrees(angle[pole][0])) for angle in at)
        )
        raise ValueError(
            f"The direction at {where} is the mirror direction itself, where straight grooves send light of two and "
            f"more bounces from every orientation: a point value there is infinite. Nothing was returned. Average over "
            f"the instrument's acceptance cone (model.acceptance.Acceptance), or ask for bounces = 1."
        )
