"""What an SR830 tells of its measurement: offset outputs, snapshots, and its auxiliary inputs and outputs."""

from __future__ import annotations

from sim_devices.stanford_sr830.lock_in import LockIn
from sim_devices.stanford_sr830.parameters import place, require, text
from sim_devices.stanford_sr830.settings import AUX_OUTPUT

_LARGEST_OFFSET, _LARGEST_AUX_V = 105.0, 10.5


class Sr830Outputs:
    """The outputs of a lock-in.

    Aux input 1 tells the detector's mean level before the lock-in, the others are 0. The displays show X and Y.

    Parameters
    ----------
    lock_in : LockIn
        What is measured.
    """

    def __init__(self, lock_in: LockIn) -> None:
        self._lock_in = lock_in
        self.reset()

    def reset(self) -> None:
        """No offsets, and nothing at the auxiliary outputs."""
        self._aux_outputs_v = [AUX_OUTPUT.default] * 4
        # of X, Y and R: offset in percent of full scale, and expansion as 0, 1 or 2
        self._offsets = [(0.0, 0.0)] * 3

    def tell_output(self, parameters: list[float], now_s: float) -> str:
        """Answer OUTP?."""
        return text(self._all(now_s)[place(parameters, 4)])

    def tell_snapshot(self, parameters: list[float], now_s: float) -> str:
        """Answer SNAP?: two to six values of one instant."""
        require(2 <= len(parameters) <= 6)
        values = self._all(now_s)
        return ",".join(text(values[place([parameter], len(values))]) for parameter in parameters)

    def tell_aux_input(self, parameters: list[float], now_s: float) -> str:
        """Answer OAUX?."""
        return text(self._aux_inputs_v(now_s)[place(parameters, 4)])

    def tell_aux_output(self, parameters: list[float], now_s: float) -> str:
        """Answer AUXV?."""
        return text(self._aux_outputs_v[place(parameters, 4)])

    def set_aux_output(self, parameters: list[float], now_s: float) -> None:
        """Obey AUXV."""
        require(len(parameters) == 2)
        self._aux_outputs_v[place(parameters[:1], 4)] = AUX_OUTPUT.take(parameters[1])

    def tell_offset(self, parameters: list[float], now_s: float) -> str:
        """Answer OEXP?."""
        return ",".join(map(text, self._offsets[place(parameters, 3)]))

    def set_offset(self, parameters: list[float], now_s: float) -> None:
        """Obey OEXP; an expansion is kept, and acts on a rear connector only."""
        require(len(parameters) == 3 and abs(parameters[1]) <= _LARGEST_OFFSET and parameters[2] in (0, 1, 2))
        self._offsets[place(parameters[:1], 3)] = round(parameters[1], 2), parameters[2]

    def offset_to_zero(self, channel: int, now_s: float) -> None:
        """Subtract from X, Y or R, channels 0 to 2, what it is now, as far as an offset goes."""
        percent = 100 * self._lock_in.outputs(now_s)[channel] / self._lock_in.full_scale_v
        self._offsets[channel] = max(-_LARGEST_OFFSET, min(_LARGEST_OFFSET, round(percent, 2))), 0.0

    def _all(self, now_s: float) -> list[float]:
        """Everything that a snapshot may name, in its order."""
        *volts, theta_deg, frequency_hz = self._lock_in.outputs(now_s)
        full_scale_v = self._lock_in.full_scale_v
        x, y, r = (value - offset / 100 * full_scale_v for value, (offset, _) in zip(volts, self._offsets, strict=True))
        return [x, y, r, theta_deg, *self._aux_inputs_v(now_s), frequency_hz, x, y]

    def _aux_inputs_v(self, now_s: float) -> list[float]:
        level_v = min(self._lock_in.level_v(now_s), _LARGEST_AUX_V)
        # to a third of a millivolt
        return [round(level_v * 3000) / 3000, 0.0, 0.0, 0.0]
