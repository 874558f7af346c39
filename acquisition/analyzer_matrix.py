"""The analyzer matrix: how S0, S1 and S2 mix into the power behind a polarizer, and whether they can be told apart."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from goniometer.errors import ReductionError

CONDITION_LIMIT = 100.0
"""Ratio of largest to smallest singular value up to which a set of analyzer angles is accepted.

Relative errors of the readings, such as a polarizer that sits a little off its angle, reach S1 and S2 enlarged by up
to this ratio. Four angles 45 degrees apart, or three 60 degrees apart, have 1.41.
"""

_SAME_ANGLE_DEG = 1e-6


def analyzer_row(analyzer_deg: float | None) -> NDArray[np.float64]:
    """Row of the analyzer matrix, ``½ [1, cos 2psi, sin 2psi]``, for an ideal linear polarizer at angle psi.

    Parameters
    ----------
    analyzer_deg : float or None
        Angle of the transmitted polarization from the s-direction in degrees; None for an open slot, ``[1, 0, 0]``.

    Returns
    -------
    ndarray, shape (3,)
        The row that the Stokes parameters S0, S1, S2 are multiplied with.
    """
    if analyzer_deg is None:
        return np.array([1.0, 0.0, 0.0])
    twice_rad = 2.0 * np.radians(analyzer_deg)
    return 0.5 * np.array([1.0, np.cos(twice_rad), np.sin(twice_rad)])


def check_analyzer_set(angles_deg: Sequence[float | None]) -> None:
    """Refuse a set of analyzer angles from which S0, S1 and S2 cannot be told apart.

    Parameters
    ----------
    angles_deg : sequence of float or None
        The angles in degrees; None for an open slot.

    Raises
    ------
    ReductionError
        When the analyzer matrix has a rank below 3, or a condition number above `CONDITION_LIMIT`.
    """
    named = ", ".join("open" if angle is None else f"{angle:g}" for angle in angles_deg)
    spread_them = "Spread the angles over 180 degrees, for example 0, 60, 120 or 0, 45, 90, 135"
    different = _number_of_different(angles_deg)
    if different < 3:
        raise ReductionError(
            f"the analyzer settings {named} amount to {different} different one{'s' * (different != 1)}, because a "
            "polarizer turned by 180 degrees is the same polarizer; S0, S1 and S2 need at least 3 different settings. "
            f"{spread_them}"
        )
    condition = float(np.linalg.cond(np.array([analyzer_row(angle) for angle in angles_deg])))
    if condition > CONDITION_LIMIT:
        raise ReductionError(
            f"the analyzer settings {named} lie so close together that errors of the readings reach S1 and S2 enlarged "
            f"up to {condition:.0f} times (condition number; at most {CONDITION_LIMIT:g} is accepted). {spread_them}"
        )


def _number_of_different(angles_deg: Sequence[float | None]) -> int:
    different: list[float | None] = []
    for angle in angles_deg:
        if not any(_is_same(angle, other) for other in different):
            different.append(angle)
    return len(different)


def _is_same(one_deg: float | None, other_deg: float | None) -> bool:
    if one_deg is None or other_deg is None:
        return one_deg is other_deg
    return abs((one_deg - other_deg + 90.0) % 180.0 - 90.0) < _SAME_ANGLE_DEG
