"""A low-pass of equal RC stages, whose output is a function of time alone."""

from __future__ import annotations

import math
from collections.abc import Callable

_CELLS_PER_TIME_CONSTANT = 8
# what came earlier than 25 time constants ago is below 1e-7 of the output
_CELLS_KEPT = 25 * _CELLS_PER_TIME_CONSTANT


class LowPass:
    """Follows a signal, which must be known for the last 25 time constants at any time.

    The signal counts as constant over cells of 1/8 time constant, at its mean over the cell; the cells begin at
    multiples of their length, so that the output does not depend on when one asks for it. Of what oscillates faster
    than four times in a time constant some 2 % are left, where the filter would let still less through. Stages that
    are set anew give what they would if they had always been so.

    Parameters
    ----------
    signal : callable
        The input's mean over a stretch of time, given its start and its length.
    time_constant_s : float
        Of each stage.
    stages : int
        How many.

    Attributes
    ----------
    output_peak : float
        Greatest magnitude that has come out since it was last set to 0.
    """

    def __init__(self, signal: Callable[[float, float], float], time_constant_s: float, stages: int) -> None:
        self._signal = signal
        self.output_peak = 0.0
        self.set(time_constant_s, stages)

    def set(self, time_constant_s: float, stages: int) -> None:
        """Set the stages."""
        self._time_constant_s, self._stages = time_constant_s, stages
        self._cell_s = time_constant_s / _CELLS_PER_TIME_CONSTANT
        self._cell: int | None = None
        self._levels: list[float] = []

    def output(self, now_s: float) -> float:
        """The last stage's output; `now_s` never goes back."""
        present = math.floor(now_s / self._cell_s)
        is_new = self._cell is None
        if self._cell is None or present - self._cell > _CELLS_KEPT:
            self._cell = present - _CELLS_KEPT
            self._levels = [self._signal((self._cell - 1) * self._cell_s, self._cell_s)] * self._stages
        for cell in range(self._cell, present):
            self._levels = self._after(cell * self._cell_s, self._cell_s)
        if is_new:
            # what came before the stages were set has not passed them
            self.output_peak = 0.0
        self._cell = max(self._cell, present)
        begun_s = self._cell * self._cell_s
        return self._after(begun_s, now_s - begun_s)[-1] if now_s > begun_s else self._levels[-1]

    def _after(self, start_s: float, duration_s: float) -> list[float]:
        """Outputs of the stages after a stretch of constant input.

        With d the differences from the input before, each stage's is afterwards
        ``exp(-u) sum_j u^j / j! d[stage - j]``, u the stretch in time constants.
        """
        level = self._signal(start_s, duration_s)
        stretch = duration_s / self._time_constant_s
        weights = [math.exp(-stretch) * stretch**order / math.factorial(order) for order in range(self._stages)]
        before = [output - level for output in self._levels]
        after = [
            level + sum(weights[order] * before[stage - order] for order in range(stage + 1))
            for stage in range(self._stages)
        ]
        self.output_peak = max(self.output_peak, abs(after[-1]))
        return after
