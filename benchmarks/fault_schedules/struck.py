"""Which faults have truly struck during a scan, and devices of which family."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from typing import Any
from unittest import mock

import numpy as np

from sim_devices.faults.camera import ExposureFault, FileFault
from sim_devices.faults.entry import Fault, MotionFault, ReplyFault
from sim_devices.faults.known import ALL
from sim_devices.faults.light import DetectorSaturated, LampOff
from sim_devices.scene import Scene

Struck = set[tuple[str, str]]
_LIGHT: dict[type[Fault], str] = {DetectorSaturated: "signal_w", LampOff: "arriving_w"}


@contextmanager
def watched(scene: Scene) -> Iterator[Struck]:
    """Note each fault, with the type of the device, once it is felt while the block lasts.

    That is when a reply, a picture or a moving axis is disturbed, or a reading is made in other light; of other faults,
    when the device or its port is struck.
    """
    struck: Struck = set()
    detector = next(device.type for device in scene.devices.values() if device.part == "detector")

    def note(fault: Fault) -> None:
        name = fault.device_name(scene.devices)
        struck.add((fault.fault, scene.devices[name].type if name else detector))

    with ExitStack() as patches:
        for kind in ALL:
            if issubclass(kind, ReplyFault):
                method, noting = "disturbed", _before(kind.disturbed, note)
            elif issubclass(kind, ExposureFault):
                method, noting = "shot", _before(kind.shot, note)
            elif issubclass(kind, FileFault):
                method, noting = "spoilt", _before(kind.spoilt, note)
            elif issubclass(kind, MotionFault):
                method, noting = "strike_in_motion", _if_moving(kind.strike_in_motion, note)
            elif kind in _LIGHT:
                method, noting = "strike", _if_seen(kind.strike, _LIGHT[kind], note)
            else:
                method, noting = "strike", _before(kind.strike, note)
            patches.enter_context(mock.patch.object(kind, method, noting))
        yield struck


def _before(method: Callable[..., Any], note: Callable[[Fault], None]) -> Callable[..., Any]:
    def noting(fault: Fault, *arguments: Any) -> Any:
        note(fault)
        return method(fault, *arguments)

    return noting


def _if_moving(strike: Callable[..., None], note: Callable[[Fault], None]) -> Callable[..., None]:
    def noting(fault: MotionFault, board: Any, time_s: float) -> None:
        if board.world.axes[fault.axis].is_moving(time_s):
            note(fault)
        strike(fault, board, time_s)

    return noting


def _if_seen(strike: Callable[..., None], light: str, note: Callable[[Fault], None]) -> Callable[..., None]:
    def noting(fault: Fault, board: Any, random: Any, time_s: float) -> None:
        before = getattr(board.world, light)
        strike(fault, board, random, time_s)
        after = getattr(board.world, light)

        def seen(moment: Any) -> Any:
            value = after(moment)
            if np.any(value != before(moment)):
                note(fault)
            return value

        setattr(board.world, light, seen)

    return noting
