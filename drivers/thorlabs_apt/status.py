"""The status word of Thorlabs' APT controllers, and what its bits mean to a person."""

from __future__ import annotations

from dataclasses import dataclass

# Whether clockwise is towards higher or lower counts differs by stage, so these bits only tell moving from at rest.
_MOVING = 0x10 | 0x20 | 0x40 | 0x80 | 0x200
_HOMED = 0x400
_ENABLED = 0x80000000

_LIMITS = {
    0x1: "the clockwise limit switch",
    0x2: "the counter-clockwise limit switch",
    0x4: "the clockwise limit set in the controller",
    0x8: "the counter-clockwise limit set in the controller",
}
_FAULTS = {
    0x4000: "a position error: the motor did not follow",
    0x8000: "an instrument error",
    0x20000: "over-temperature",
    0x40000: "a fault of the supply voltage",
    0x80000: "a commutation error",
    0x1000000: "an overload of the motor",
    0x2000000: "a fault of the encoder",
    0x4000000: "over-current",
    0x40000000: "an error",
}


@dataclass(frozen=True)
class AptStatus:
    """Position in counts, and the status bits."""

    counts: int
    bits: int

    @property
    def is_moving(self) -> bool:
        """Whether the motor turns, also to find its home."""
        return bool(self.bits & _MOVING)

    @property
    def is_homed(self) -> bool:
        """Whether the counts have their zero at the home position."""
        return bool(self.bits & _HOMED)

    @property
    def is_enabled(self) -> bool:
        """Whether the motor has power."""
        return bool(self.bits & _ENABLED)

    @property
    def limits(self) -> str:
        """The limits that the stage stands at, in words; empty for none."""
        return " and ".join(text for bit, text in _LIMITS.items() if self.bits & bit)

    @property
    def faults(self) -> tuple[str, ...]:
        """The faults that the controller reports, in words."""
        return tuple(text for bit, text in _FAULTS.items() if self.bits & bit)
