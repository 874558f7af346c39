"""Every fault that a scene or a request may name."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, Union

from pydantic import Field, TypeAdapter

from sim_devices.faults.busy import Busy
from sim_devices.faults.camera import (
    FrameCorrupt,
    FrameCut,
    FrameDark,
    FrameDropped,
    FrameSaturated,
    FrameStale,
    FrameTimeShifted,
    FrameWrongSize,
)
from sim_devices.faults.cut_off import CablePulled, PowerCycle
from sim_devices.faults.entry import Fault
from sim_devices.faults.garbled import CrcError, Garbled
from sim_devices.faults.light import DetectorSaturated, LampOff
from sim_devices.faults.markers import MarkerMisprinted, MarkersHidden
from sim_devices.faults.modbus_exception import ModbusException
from sim_devices.faults.motion import LimitHit, LostHome, ResetInMotion, Stall
from sim_devices.faults.noise import EndlessOutput, Noise, StrayPrompt
from sim_devices.faults.pieces import Duplicated, Merged, Missing, Short, Split
from sim_devices.faults.timing import Late, SlowDrip
from sim_devices.faults.wheel_by_hand import WheelByHand

ALL: tuple[type[Fault], ...] = (
    Late,
    SlowDrip,
    Split,
    Merged,
    Short,
    Duplicated,
    Missing,
    Garbled,
    CrcError,
    ModbusException,
    Noise,
    StrayPrompt,
    EndlessOutput,
    Busy,
    CablePulled,
    PowerCycle,
    ResetInMotion,
    Stall,
    LimitHit,
    LostHome,
    WheelByHand,
    DetectorSaturated,
    LampOff,
    FrameCorrupt,
    FrameCut,
    FrameWrongSize,
    FrameStale,
    FrameTimeShifted,
    FrameDropped,
    FrameSaturated,
    FrameDark,
    MarkersHidden,
    MarkerMisprinted,
)


if TYPE_CHECKING:
    AnyFault = Fault
else:
    AnyFault: Any = Annotated[Union[ALL], Field(discriminator="fault")]  # noqa: UP007 (made from a tuple)

one_fault: TypeAdapter[Fault] = TypeAdapter(AnyFault)
