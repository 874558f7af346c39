"""The analyzer matrix: how Stokes parameters mix into the power behind an analyzer, and whether they can be told apart.

One row belongs to each state of the analyzer. Light passes a retarder, where there is one, and then a polarizer.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from acquisition.swept_row import swept_row
from goniometer.errors import ReductionError

CONDITION_LIMIT = 100.0
"""Ratio of largest to smallest singular value up to which a set of analyzer states is accepted.

Relative errors of the readings, such as a polarizer that sits a little off its angle, reach the Stokes parameters
enlarged by up to this ratio. Four polarizers 45 degrees apart, or three 60 degrees apart, have 1.41; a quarter-wave
plate at -51.7, -15.1, 15.1 and 51.7 degrees before a polarizer at 0 has 3.4.
"""

_SAME = 1e-8
"""Two states are one, and a state is blind to a Stokes parameter, where the rows differ by no more than this."""

_NAMES = ("S0", "S1", "S2", "S3")


@dataclass(frozen=True)
class AnalyzerState:
    """What stands before the detector; angles in degrees from the s-direction, towards p.

    Parameters
    ----------
    polarizer_deg : float or None
        Angle of the transmitted polarization; None for an open slot.
    retarder_deg : float or None
        Angle of the fast axis of the retarder that the light passes first; None without one.
    retardance_deg : float or None
        By how much the slow axis comes behind the fast one, 90 for a quarter-wave plate; None without a retarder.
    polarizer_sweep_deg, retarder_sweep_deg : float
        How far each turns, evenly, while light is collected; the angles are those in the middle.
    """

    polarizer_deg: float | None = None
    retarder_deg: float | None = None
    retardance_deg: float | None = None
    polarizer_sweep_deg: float = 0.0
    retarder_sweep_deg: float = 0.0

    def row(self) -> NDArray[np.float64]:
        """The row (4,) whose product with S0, S1, S2, S3 is what passes.

        For a polarizer at psi behind a retarder delta at beta, with u = 2 psi - 2 beta, it is ½ [1, cos u cos 2beta -
        cos delta sin u sin 2beta, cos u sin 2beta + cos delta sin u cos 2beta, sin delta sin u]; without a retarder
        ½ [1, cos 2psi, sin 2psi, 0]. Of what turns meanwhile it is the mean (`swept_row`).
        """
        if self.polarizer_deg is None:
            return np.array([1.0, 0.0, 0.0, 0.0])
        if self.polarizer_sweep_deg or self.retarder_sweep_deg:
            of_retarder = self.retarder_deg or 0.0, self.retarder_sweep_deg, self.retardance_deg or 0.0
            return swept_row(self.polarizer_deg, self.polarizer_sweep_deg, *of_retarder)
        twice = math.radians(2.0 * self.polarizer_deg)
        if self.retarder_deg is None or self.retardance_deg is None:
            return 0.5 * np.array([1.0, math.cos(twice), math.sin(twice), 0.0])
        fast, delta = math.radians(2.0 * self.retarder_deg), math.radians(self.retardance_deg)
        along, across = math.cos(twice - fast), math.sin(twice - fast)
        s1 = along * math.cos(fast) - math.cos(delta) * across * math.sin(fast)
        s2 = along * math.sin(fast) + math.cos(delta) * across * math.cos(fast)
        return 0.5 * np.array([1.0, s1, s2, math.sin(delta) * across])

    def __str__(self) -> str:
        if self.polarizer_deg is None:
            return "open"
        return (
            f"{self.polarizer_deg:g}" if self.retarder_deg is None else f"{self.retarder_deg:g}/{self.polarizer_deg:g}"
        )


def analyzer_matrix(states: Sequence[AnalyzerState]) -> NDArray[np.float64]:
    """The rows of states, shape (N, 3), or (N, 4) where the power behind any of them depends on S3."""
    rows = np.array([state.row() for state in states]).reshape(-1, 4)
    return rows if (np.abs(rows[:, 3]) > _SAME).any() else rows[:, :3]


def check_analyzer_set(angles_deg: Sequence[float | None]) -> None:
    """Refuse a set of polarizers from which S0, S1 and S2 cannot be told apart; as `check_states`.

    Parameters
    ----------
    angles_deg : sequence of float or None
        The angles in degrees; None for an open slot.
    """
    check_states([AnalyzerState(angle) for angle in angles_deg])


def check_states(states: Sequence[AnalyzerState], *, element: Literal["analyzer", "generator"] = "analyzer") -> None:
    """Refuse a set of analyzer states from which the Stokes parameters that they depend on cannot be told apart.

    These are S0, S1 and S2; and S3 as soon as one state depends on it, for then it cannot be left out. A message names
    the element whose states these are; light that is made has the Stokes parameters that pass backwards.

    Raises
    ------
    ReductionError
        When the analyzer matrix has a rank below its number of columns, or a condition number above `CONDITION_LIMIT`.
    """
    matrix = analyzer_matrix(states)
    needed = matrix.shape[1]
    has_retarder = any(state.retarder_deg is not None for state in states)
    named = ", ".join(map(str, states))
    if has_retarder:
        named = f"{named} (retarder/polarizer)"
    wanted = "S0, S1 and S2" if needed == 3 else "S0, S1, S2 and S3"
    if element == "generator":
        wanted = f"the responses to {wanted}"
    remedy = _remedy(states, needed)
    different = _number_of_different(matrix)
    if different < needed:
        alike = "" if has_retarder else ", because a polarizer turned by 180 degrees is the same polarizer"
        raise ReductionError(
            f"the {element} settings {named} amount to {different} different one{'s' * (different != 1)}{alike}; "
            f"{wanted} need at least {needed} different settings. {remedy}"
        )
    _, values, directions = np.linalg.svd(matrix)
    condition = float(values[0] / values[-1]) if values[-1] > _SAME else math.inf
    if condition == math.inf:
        raise ReductionError(
            f"the {element} settings {named} tell nothing of {_combination(directions[-1])}; {wanted} cannot be told "
            f"apart. {remedy}"
        )
    if condition > CONDITION_LIMIT:
        raise ReductionError(
            f"the {element} settings {named} lie so close together that errors of the readings reach "
            f"{wanted.removeprefix('S0, ')} enlarged up to {condition:.0f} times (condition number; at most "
            f"{CONDITION_LIMIT:g} is accepted). {remedy}"
        )


def _remedy(states: Sequence[AnalyzerState], needed: int) -> str:
    if needed == 3:
        return "Spread the angles over 180 degrees, for example 0, 60, 120 or 0, 45, 90, 135"
    if len({state.retarder_deg for state in states}) == 1:
        return "A retarder that stands still leaves a part of the linear polarization unseen: turn it too"
    return "Turn the retarder over 180 degrees, for example to -51.7, -15.1, 15.1, 51.7 with the polarizer at 0"


def _combination(direction: NDArray[np.float64]) -> str:
    """A direction in Stokes space in words, such as ``S2`` or ``0.5 S1 - 0.87 S2``."""
    terms = [(part, name) for part, name in zip(direction, _NAMES, strict=False) if abs(part) > 1e-3]
    if len(terms) == 1:
        return terms[0][1]
    sign = math.copysign(1.0, terms[0][0])
    (first, name), *others = ((sign * part, name) for part, name in terms)
    rest = (f" {'+' if part > 0 else '-'} {abs(part):.2g} {other}" for part, other in others)
    return f"{first:.2g} {name}{''.join(rest)}"


def _number_of_different(matrix: NDArray[np.float64]) -> int:
    different: list[NDArray[np.float64]] = []
    for row in matrix:
        if not any(np.abs(row - other).max() <= _SAME for other in different):
            different.append(row)
    return len(different)
