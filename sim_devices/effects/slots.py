"""What is wrong with single slots of an analyzer wheel: angles that are off, and unequal transmission."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import Field

from sim_devices.analyzer import Row, WheelAnalyzer, turned
from sim_devices.bench_devices.entry import Slot
from sim_devices.effects.entry import Effect

if TYPE_CHECKING:
    from sim_devices.world import World


class SlotAngleErrors(Effect):
    """Polarizers stand at other angles than the scene's device says; it costs nothing while the bench runs."""

    effect: Literal["slot_angle_errors"] = Field(description="the effect's name")
    errors_deg: dict[int, Annotated[float, Field(ge=-90, le=90)]] = Field(
        min_length=1, description="what is added to the polarizer's angle, by slot, in deg"
    )

    def faults(self, slots: Mapping[int, Slot]) -> tuple[str, ...]:
        """Slots that hold no polarizer."""
        return tuple(
            f"{self.effect}: slot {slot} {_holding(slots, slot)}, so it has no angle to be wrong"
            for slot in self.errors_deg
            if not isinstance(slots.get(slot), float)
        )

    def install(self, world: World) -> None:
        """Turn the polarizers in their slots."""
        for slot, row in _rows(world, self.errors_deg):
            row[:] = turned(row, self.errors_deg[slot])


class SlotTransmissions(Effect):
    """Slots pass different shares of the light; it costs nothing while the bench runs."""

    effect: Literal["slot_transmissions"] = Field(description="the effect's name")
    relative: dict[int, Annotated[float, Field(gt=0, le=1)]] = Field(
        min_length=1, description="share of what the ideal slot passes, by slot"
    )

    def faults(self, slots: Mapping[int, Slot]) -> tuple[str, ...]:
        """Slots that let nothing through."""
        return tuple(
            f"{self.effect}: slot {slot} {_holding(slots, slot)}, so it passes no share of the light"
            for slot in self.relative
            if slots.get(slot, "blocked") == "blocked"
        )

    def install(self, world: World) -> None:
        """Dim the slots."""
        for slot, row in _rows(world, self.relative):
            row *= self.relative[slot]


def _holding(slots: Mapping[int, Slot], slot: int) -> str:
    return f"is {slots[slot]}" if slot in slots else "is not on the analyzer"


def _rows(world: World, of_slots: Mapping[int, float]) -> list[tuple[int, Row]]:
    wheel = world.analyzer
    # a scene in which another analyzer is asked for its slots has been refused
    assert isinstance(wheel, WheelAnalyzer)
    return [(slot, row) for slot, row in wheel.rows.items() if slot in of_slots and row is not None]
