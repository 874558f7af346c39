"""What faults have in common: a name, a time, and what they strike."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from pydantic import Field

from sim_devices.bench_devices.entry import AxisRole, SimulatedDevice
from sim_devices.scene_part import ScenePart

if TYPE_CHECKING:
    from sim_devices.camera.plate import Plate
    from sim_devices.faults.switchboard import Switchboard

Random = np.random.Generator
Chunks = list[tuple[float, bytes]]


class Fault(ScenePart, ABC):
    """A fault; a subclass names it in `fault`, a literal with one value."""

    needs: ClassVar[tuple[type, ...]] = ()
    """Hooks (`sim_devices.faults.hooks`) of which the device that it strikes must have one; none: needs none."""

    fault: str
    at_s: float = Field(default=0.0, ge=0, description="when it strikes, on the bench's clock; at once if that is over")

    def device_name(self, devices: Mapping[str, SimulatedDevice]) -> str:
        """The device that it strikes; empty for what happens to the light."""
        return ""

    def objections(self, devices: Mapping[str, SimulatedDevice]) -> tuple[str, ...]:
        """What keeps a bench with these devices from having it."""
        return ()

    def objections_of(self, plate: Plate | None) -> tuple[str, ...]:
        """What keeps a bench from having it that has this plate before its camera."""
        return ()

    @abstractmethod
    def strike(self, board: Switchboard, random: Random, time_s: float) -> None:
        """Let it happen."""


class DeviceFault(Fault):
    """A fault of one device, or of its port."""

    device: str = Field(description="name of the device in the scene")

    def device_name(self, devices: Mapping[str, SimulatedDevice]) -> str:
        """The one that it names."""
        return self.device

    def objections(self, devices: Mapping[str, SimulatedDevice]) -> tuple[str, ...]:
        """Say so where there is no such device."""
        if self.device in devices:
            return ()
        return (f"the fault {self.fault} is of {self.device!r}, and the devices are {', '.join(devices)}",)


class ReplyFault(DeviceFault):
    """A fault of the next `replies` replies of a device."""

    replies: int = Field(default=1, ge=1, le=1_000_000, description="how many replies in a row it disturbs")

    def strike(self, board: Switchboard, random: Random, time_s: float) -> None:
        """Stand between the device and its port until all are disturbed."""
        board.port(self.device).disturb(self.disturbed, random, self.replies)

    @abstractmethod
    def disturbed(self, due_s: float, reply: bytes, random: Random) -> Chunks:
        """What becomes of a reply: pieces of it, in order, with the times at which they come."""


class AxisFault(Fault):
    """A fault of one axis, and so of the device that turns it."""

    axis: AxisRole = Field(description="the axis, by its role")

    def device_name(self, devices: Mapping[str, SimulatedDevice]) -> str:
        """The one that turns the axis."""
        return next(name for name, device in devices.items() if self.axis in device.roles())

    def objections(self, devices: Mapping[str, SimulatedDevice]) -> tuple[str, ...]:
        """Say so where no device turns the axis."""
        if any(self.axis in device.roles() for device in devices.values()):
            return ()
        return (f"the fault {self.fault} is of the axis {self.axis}, which no device turns",)


class MotionFault(AxisFault):
    """A fault in the middle of a motion: the first that the axis begins once the fault is there."""

    into_motion_s: float = Field(default=0.2, ge=0, le=3600, description="how long the axis has moved by then, in s")

    def strike(self, board: Switchboard, random: Random, time_s: float) -> None:
        """Wait for the next motion."""
        axis = board.world.axes[self.axis]

        def begin(start_s: float) -> None:
            axis.before_motion.remove(begin)
            board.at(start_s + self.into_motion_s, lambda now_s: self.strike_in_motion(board, now_s))

        axis.before_motion.append(begin)

    @abstractmethod
    def strike_in_motion(self, board: Switchboard, time_s: float) -> None:
        """Let it happen, while the axis moves or has just come to rest."""
