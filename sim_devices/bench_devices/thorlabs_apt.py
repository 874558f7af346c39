"""A Thorlabs APT controller with its stages on the bench."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

from pydantic import Field, model_validator

from sim_devices.bench_devices.entry import AxisRole, SimulatedDevice
from sim_devices.device import Device
from sim_devices.thorlabs_apt.controller import ThorlabsApt
from sim_devices.thorlabs_apt.models import (
    BSC200_HDR50,
    K10CR1,
    KBD101_DDR25,
    KBD101_DDR100,
    KDC101_PRM1Z8,
    AptModel,
)

if TYPE_CHECKING:
    from sim_devices.world import World

_MODELS: dict[str, AptModel] = {
    "K10CR1": K10CR1,
    "HDR50": BSC200_HDR50,
    "PRM1Z8": KDC101_PRM1Z8,
    "DDR100": KBD101_DDR100,
    "DDR25": KBD101_DDR25,
}


class ThorlabsAptDevice(SimulatedDevice):
    """A K10CR1, a KDC101 with a PRM1Z8, a KBD101 with a DDR table, or a BSC20x rack whose bays turn HDR50 tables."""

    part: ClassVar[str] = "axes"

    type: Literal["thorlabs_apt"] = Field(description="the device's family")
    stage: Literal["K10CR1", "HDR50", "PRM1Z8", "DDR100", "DDR25"] = Field(
        description="what turns; HDR50 tables hang on a rack"
    )
    axes: dict[Annotated[int, Field(ge=1, le=3)], AxisRole] = Field(
        min_length=1, description="what each stage turns, by the rack's bay; 1 for a controller of its own"
    )

    @model_validator(mode="after")
    def _has_its_bays(self) -> ThorlabsAptDevice:
        if not _MODELS[self.stage].is_rack and set(self.axes) != {1}:
            raise ValueError(f"a {self.stage} has a controller of its own, and so the axis 1 and no other")
        return self

    def roles(self) -> tuple[AxisRole, ...]:
        """The axes that it turns."""
        return tuple(self.axes.values())

    def install(self, world: World) -> Device:
        """Put its axes into the world; a stage stands on whole counts."""
        model = _MODELS[self.stage]
        step_deg = 1 / model.counts_per_deg
        return ThorlabsApt(model, {bay: world.add_axis(role, step_deg) for bay, role in self.axes.items()})
