"""Where something that turns evenly was at any time, from where it said that it was at some."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_SAME_SPEED = 0.02
"""Relative difference of speeds up to which a turn is read as a whole."""


class EvenTurn:
    """Positions with the times before and after the question, and the straight line through them.

    A position is taken to be of the middle between question and answer.
    """

    def __init__(self) -> None:
        self._asked: list[tuple[float, float, float]] = []

    def add(self, asked_s: float, position_deg: float, answered_s: float) -> None:
        """Take in an answer."""
        self._asked.append((asked_s, position_deg, answered_s))

    @property
    def speed_deg_s(self) -> float:
        """The speed, negative backwards."""
        return self._line()[0]

    def angle_deg(self, time_s: float) -> float:
        """Where it was at a time."""
        speed_deg_s, middle_deg, middle_s = self._line()
        return middle_deg + speed_deg_s * (time_s - middle_s)

    def fault(self, tolerance_deg: float, expected_deg_s: float) -> str:
        """What was wrong with the turn, in words; empty for one that was even and as fast as it should be.

        No position may be off the line by more than the tolerance, and what a question's duration amounts to.
        """
        speed_deg_s, farthest_deg = abs(self.speed_deg_s), self._farthest_deg()
        allowed_deg = tolerance_deg + speed_deg_s * self._longest_question_s() / 2
        if farthest_deg > allowed_deg:
            return (
                f"did not turn evenly: one of its positions is {farthest_deg:.3g} degrees away from where the others "
                f"put it (allowed: {allowed_deg:.2g} degrees)"
            )
        if abs(speed_deg_s - expected_deg_s) > _SAME_SPEED * expected_deg_s:
            return f"turned at {speed_deg_s:.4g} degrees/s, and velocity_deg_s in the rig file says {expected_deg_s:g}"
        return ""

    def _line(self) -> tuple[float, float, float]:
        """Speed, and where the line is in the middle of the times, at which time."""
        time_s, position_deg, _ = self._columns()
        middle_s, middle_deg = float(time_s.mean()), float(position_deg.mean())
        since_s = time_s - middle_s
        speed_deg_s = float(since_s @ (position_deg - middle_deg) / (since_s @ since_s))
        return speed_deg_s, middle_deg, middle_s

    def _farthest_deg(self) -> float:
        time_s, position_deg, _ = self._columns()
        speed_deg_s, middle_deg, middle_s = self._line()
        return float(np.abs(position_deg - middle_deg - speed_deg_s * (time_s - middle_s)).max())

    def _longest_question_s(self) -> float:
        return float(self._columns()[2].max())

    def _columns(self) -> tuple[Floats, Floats, Floats]:
        asked_s, position_deg, answered_s = np.array(self._asked).T
        return (asked_s + answered_s) / 2, position_deg, answered_s - asked_s
