"""What a scene's devices have in common: a type, a part to play, and a place on the bench."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

from pydantic import Field

from sim_devices.device import Device
from sim_devices.scene_part import ScenePart

if TYPE_CHECKING:
    from sim_devices.world import World

AxisRole = Literal["source_arm", "detector_arm", "sample_azimuth"]
Slot = Literal["open", "blocked"] | Annotated[float, Field(ge=-180, le=180)]


class SimulatedDevice(ScenePart, ABC):
    """A device; a subclass names its family in `type`, a literal with one value."""

    part: ClassVar[str]
    """What it does on the bench: "axes", "analyzer" or "detector"."""

    type: str
    line: str | None = Field(
        default=None,
        min_length=1,
        description="name of the serial line, where several devices with addresses share one port",
    )

    def roles(self) -> tuple[AxisRole, ...]:
        """The axes of the bench that it turns."""
        return ()

    @abstractmethod
    def install(self, world: World) -> Device:
        """Put its axes, its optics or its acceptance into the world, and return what answers at its port."""
