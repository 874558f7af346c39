"""What ends the travel of a stage on an APT controller: its switch, and limits that the controller counts."""

from __future__ import annotations

import math
from dataclasses import dataclass

from sim_devices.thorlabs_apt.models import AptModel
from sim_devices.thorlabs_apt.parameters import Values

# modes of a hardware switch, of which the highest bit changes the two switches over
_STOPPING, _SWITCH_MODES = (2, 3), 0x7F
# modes of limits in counts
_AT_ONCE, _PROFILED = 2, 3
_CLOCKWISE_SWITCH, _CLOCKWISE_LIMIT, _TO_OTHER_WAY = 0x1, 0x4, 1
_CONTACT_DEG = 0.25
_FULL_TURN_DEG = 360.0


@dataclass(frozen=True)
class Barrier:
    """Where a motion ends short of its target: at once, or with its own deceleration."""

    at_deg: float
    is_abrupt: bool


class AptLimits:
    """The limits of one stage, whose switch is passed once in a turn and met in reverse.

    Parameters
    ----------
    model : AptModel
        Where the switch is, and how far the controller counts.
    """

    def __init__(self, model: AptModel) -> None:
        self._model = model
        self._switch_deg = -model.home_offset_deg
        self._reverse_switch = self._bit(_CLOCKWISE_SWITCH, is_forward=False)
        self._stops_at_switch = False
        self._soft_deg = (-math.inf, math.inf)
        self._is_abrupt = False

    def set(self, values: Values) -> None:
        """Take modes of the two switches, two limits in counts and their mode; lower above upper is no limit."""
        clockwise_mode, counter_mode, clockwise, counter, mode = values
        reverse_mode = counter_mode if self._model.forward_is_clockwise else clockwise_mode
        self._stops_at_switch = reverse_mode & _SWITCH_MODES in _STOPPING
        lower, upper = (counter, clockwise) if self._model.forward_is_clockwise else (clockwise, counter)
        is_on = mode & _SWITCH_MODES in (_AT_ONCE, _PROFILED) and lower < upper
        counts_per_deg = self._model.counts_per_deg
        self._soft_deg = (lower / counts_per_deg, upper / counts_per_deg) if is_on else (-math.inf, math.inf)
        self._is_abrupt = mode & _SWITCH_MODES == _AT_ONCE

    def barrier(self, start_deg: float, target_deg: float, zero_deg: float) -> Barrier | None:
        """What ends a motion before it is at its target; positions of the axis, of which `zero_deg` counts as 0."""
        is_forward = target_deg > start_deg
        farthest_deg = self._model.turn_limit * _FULL_TURN_DEG
        lower_deg, upper_deg = self._soft_deg
        barriers = [
            Barrier(zero_deg + (farthest_deg if is_forward else -farthest_deg), is_abrupt=False),
            Barrier(zero_deg + (upper_deg if is_forward else lower_deg), self._is_abrupt),
        ]
        if self._stops_at_switch and not is_forward:
            barriers.append(Barrier(self._contact_below(start_deg), is_abrupt=True))
        sign = 1 if is_forward else -1
        first = min(barriers, key=lambda barrier: sign * barrier.at_deg)
        if sign * (target_deg - first.at_deg) <= 0:
            return None
        # from beyond it, there is no way on at all
        return Barrier(sign * max(sign * first.at_deg, sign * start_deg), first.is_abrupt)

    def switch_from(self, start_deg: float, sign: int) -> float:
        """Where a search in a direction finds the middle of the switch; that on which the stage stands, wherever."""
        turns = (start_deg - self._switch_deg) / _FULL_TURN_DEG
        if self.is_on_switch(start_deg):
            return self._switch_deg + round(turns) * _FULL_TURN_DEG
        return self._switch_deg + sign * math.ceil(sign * turns) * _FULL_TURN_DEG

    def bits(self, position_deg: float, zero_deg: float) -> int:
        """Those of the status bits that tell limits."""
        bits = self._reverse_switch if self.is_on_switch(position_deg) else 0
        lower_deg, upper_deg = self._soft_deg
        farthest_deg, reached_deg = self._model.turn_limit * _FULL_TURN_DEG, position_deg - zero_deg
        if reached_deg > min(upper_deg, farthest_deg) - self._model.step_deg:
            bits |= self._bit(_CLOCKWISE_LIMIT, is_forward=True)
        if reached_deg < max(lower_deg, -farthest_deg) + self._model.step_deg:
            bits |= self._bit(_CLOCKWISE_LIMIT, is_forward=False)
        return bits

    def switch_bit(self, *, is_forward: bool) -> int:
        """The status bit of the switch at which a motion would end."""
        return self._bit(_CLOCKWISE_SWITCH, is_forward=is_forward)

    def is_on_switch(self, position_deg: float) -> bool:
        """Whether the stage holds the switch down."""
        return abs(math.remainder(position_deg - self._switch_deg, _FULL_TURN_DEG)) <= _CONTACT_DEG

    def _contact_below(self, start_deg: float) -> float:
        """Where a motion in reverse meets the switch, which it does at once where it stands on it."""
        if self.is_on_switch(start_deg):
            return start_deg
        edge_deg = self._switch_deg + _CONTACT_DEG
        return edge_deg + math.floor((start_deg - edge_deg) / _FULL_TURN_DEG) * _FULL_TURN_DEG

    def _bit(self, clockwise: int, *, is_forward: bool) -> int:
        return clockwise if is_forward == self._model.forward_is_clockwise else clockwise << _TO_OTHER_WAY
