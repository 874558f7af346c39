"""What a scene's effects have in common: a name, and a place on the light's way."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import TYPE_CHECKING, Literal

from pydantic import Field

from sim_devices.bench_devices.entry import Slot
from sim_devices.scene_part import ScenePart

if TYPE_CHECKING:
    from sim_devices.world import World

Arm = Literal["source_arm", "detector_arm", "detector_azimuth"]


class Effect(ScenePart, ABC):
    """An effect; a subclass names it in `effect`, a literal with one value."""

    effect: str

    @property
    def title(self) -> str:
        """Its name, and what it is given for when a scene may name it once for each of several."""
        return self.effect

    def faults(self, slots: Mapping[int, Slot]) -> tuple[str, ...]:
        """What keeps it from acting on an analyzer with these slots, of which one that is no wheel has none."""
        return ()

    @abstractmethod
    def install(self, world: World) -> None:
        """Wrap what it disturbs; all devices and the effects before it are in place."""


class ArmEffect(Effect):
    """An effect on where an arm truly is."""

    axis: Arm = Field(description="the arm that has it")

    @property
    def title(self) -> str:
        """Its name and the arm."""
        return f"{self.effect} of {self.axis}"
