"""Light that is missing, or too much of it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Literal

import numpy as np
from pydantic import Field

from sim_devices.bench_devices.entry import SimulatedDevice
from sim_devices.effects.measurement import Measurement, Moment, Stokes
from sim_devices.faults.entry import Fault, Random

if TYPE_CHECKING:
    from sim_devices.faults.switchboard import Switchboard


class LampOff(Fault):
    """A lamp that goes out, and comes on again."""

    fault: Literal["lamp_off"] = Field(description="the fault's name")
    for_s: float = Field(default=1e9, gt=0, le=1e9, description="how long it is out, in s; for ever if not given")

    def strike(self, board: Switchboard, random: Random, time_s: float) -> None:
        """Let nothing arrive."""
        arriving_w, end_s = board.world.arriving_w, time_s + self.for_s

        def nothing_w(moment: Moment) -> Stokes:
            return np.zeros(4) if time_s <= moment.middle_s < end_s else arriving_w(moment)

        board.world.arriving_w = nothing_w


class DetectorSaturated(Fault):
    """A detector that gets more light than it takes, for example from a lamp in the room."""

    fault: Literal["detector_saturated"] = Field(description="the fault's name")
    for_s: float = Field(default=1.0, gt=0, le=1e9, description="how long it lasts, in s")

    def objections(self, devices: Mapping[str, SimulatedDevice]) -> tuple[str, ...]:
        """Say so where the detector is a camera, whose pixels are told of one by one."""
        cameras = [name for name, device in devices.items() if device.type == "http_camera"]
        return tuple(
            f"the detector {name} is a camera; the fault of its pictures is frame_saturated" for name in cameras
        )

    def strike(self, board: Switchboard, random: Random, time_s: float) -> None:
        """Let every measurement be over the range."""
        signal_w, end_s = board.world.signal_w, time_s + self.for_s

        def over_range_w(measurement: Measurement) -> float:
            return math.inf if time_s <= measurement.middle_s < end_s else signal_w(measurement)

        board.world.signal_w = over_range_w
