"""The sliders among the Elliptec modules, ELL9 with four positions and ELL6 with two."""

from __future__ import annotations

from sim_devices.thorlabs_elliptec.module import NOT_SUPPORTED, OUT_OF_RANGE, Drive, ElliptecError
from sim_devices.wheel import Wheel

ELL6, ELL9 = 0x06, 0x09
_PITCH = 0x20
_SLOTS = {ELL6: 2, ELL9: 4}
_TRAVEL_MM = {ELL6: 31, ELL9: 93}
_SLOT_S = 0.6


class ElliptecSlider:
    """A slider whose positions count in steps of 0x20.

    Parameters
    ----------
    wheel : Wheel
        Which slot is in the beam; slot 1 is position 0.
    type_code : int
        `ELL9` or `ELL6`.
    """

    def __init__(self, wheel: Wheel, type_code: int = ELL9) -> None:
        self._wheel, self._slots = wheel, _SLOTS[type_code]
        self.type_code, self.travel, self.pulses = type_code, _TRAVEL_MM[type_code], 1
        self.motors = 2 if type_code == ELL9 else 1

    def position(self, now_s: float) -> int:
        """Position of the slot in the beam, or of the one on its way there."""
        return (self._wheel.target - 1) * _PITCH

    def drive(self, command: str, value: int | None, now_s: float, *, percent: int) -> Drive:
        """Begin one of the motions ho, ma, fw, bw; at the last slot there is none further on."""
        slot = self._wheel.target
        if command in ("fw", "bw"):
            return self._slide(min(max(slot + (1 if command == "fw" else -1), 1), self._slots), now_s)
        if command == "ho" and value is not None:
            return self._slide(1, now_s)
        if command == "ma" and value is not None:
            if value % _PITCH or not 0 <= value < self._slots * _PITCH:
                raise ElliptecError(OUT_OF_RANGE)
            return self._slide(value // _PITCH + 1, now_s)
        raise ElliptecError(NOT_SUPPORTED)

    def stop(self, now_s: float) -> float:
        """Do nothing: a slider rests only at its slots."""
        return now_s

    def power_cycle(self, now_s: float) -> None:
        """Do nothing: a slider sees at which slot it is."""

    def setting(self, command: str, value: int | None) -> int:
        """Refuse: a slider has no jog step and no home offset."""
        raise ElliptecError(NOT_SUPPORTED)

    def _slide(self, slot: int, now_s: float) -> Drive:
        # round a wheel of twice the slots, the shorter way never leads past the ends
        return Drive(self._wheel.turn(slot, now_s, slots=2 * self._slots, slot_s=_SLOT_S))
