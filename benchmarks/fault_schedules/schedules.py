"""What a seed stands for: a bench, and one to three faults of any kind that it can have, at any moment of its scan."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass
from random import Random
from typing import Any, get_args

from benches import KINDS, short_scan

from sim_devices.bench import Bench
from sim_devices.faults.camera import FrameFault
from sim_devices.faults.entry import AxisFault, DeviceFault, Fault, ReplyFault
from sim_devices.faults.known import ALL, one_fault
from sim_devices.faults.markers import MarkerFault
from sim_devices.serving.clock import VirtualClock

Draw = Callable[[Random], Any]
Drawn = dict[str, Any]


@dataclass(frozen=True)
class Schedule:
    """A bench, and the faults that strike there."""

    bench: str
    faults: tuple[Drawn, ...]


def _seconds(least: float, most: float) -> Draw:
    return lambda chance: round(chance.uniform(least, most), 3)


def _one_of(*values: Any) -> Draw:
    return lambda chance: chance.choice(values)


def _soon(chance: Random) -> float:
    """Within one second, and mostly before a short motion has ended."""
    return round(chance.random() ** 3, 3)


def _few(chance: Random) -> int:
    return chance.choice((1, 1, 1, 2, 3, 10))


KEYS: dict[str, dict[str, Draw]] = {
    "late": {"late_s": _seconds(0.01, 4.0)},
    "slow_drip": {},
    "split": {"apart_s": _seconds(0.001, 1.0)},
    "merged": {},
    "short": {"lost_bytes": lambda chance: chance.randint(1, 12)},
    "duplicated": {},
    "missing": {},
    "garbled": {"bits": _one_of(1, 1, 2, 8)},
    "crc_error": {},
    "modbus_exception": {"code": _one_of(1, 2, 3, 4, 6, 11)},
    "noise": {"noise_bytes": _one_of(1, 5, 50, 5000)},
    "stray_prompt": {
        "text": _one_of("> ", "\r\n", "\n", "pos?\r3\r> ", "1\r\n", "0.1\n", "0GS00\r\n", "0PO00000000\r\n")
    },
    "endless_output": {"for_s": _seconds(0.01, 20.0)},
    "busy": {"for_s": _seconds(0.01, 10.0)},
    "cable_pulled": {"for_s": _seconds(0.1, 20.0)},
    "power_cycle": {"off_s": _seconds(0.1, 6.0)},
    "reset_in_motion": {"into_motion_s": _soon},
    "stall": {"into_motion_s": _soon},
    "limit_hit": {"into_motion_s": _soon},
    "lost_home": {},
    "wheel_by_hand": {},
    "detector_saturated": {"for_s": _seconds(0.01, 2.0)},
    "lamp_off": {"for_s": _seconds(0.1, 10.0)},
    "frame_corrupt": {"frames": _few, "wrong_bytes": _one_of(1, 8, 64)},
    "frame_cut": {"frames": _few, "lost_bytes": _one_of(1, 12, 300, 1000)},
    "frame_wrong_size": {"frames": _few},
    "frame_stale": {"frames": _few},
    # what lasts for longer than the pictures that are thrown away at first is the camera's clock, for all one can see
    "frame_time_shifted": {"frames": _one_of(1, 2), "early_s": _seconds(0.005, 4.0)},
    "frame_dropped": {"frames": _few},
    "frame_saturated": {"frames": _few, "share": _one_of(1.0, 0.3)},
    "frame_dark": {"frames": _few},
    "markers_hidden": {"markers": _one_of([0], [1, 2], [0, 1, 2, 3]), "for_s": _seconds(0.1, 10.0)},
    "marker_misprinted": {"marker": _one_of(1, 3), "shows": _one_of(2, 9), "for_s": _seconds(0.1, 10.0)},
}
"""What is drawn for each fault besides the moment, the device or axis, and the number of replies."""


def schedule(seed: int, duration_s: Callable[[str], float]) -> Schedule:
    """What strikes under this seed; `duration_s` tells how long a bench's scan takes without faults."""
    chance = Random(seed)
    bench = chance.choice(list(KINDS))
    possible = possible_faults(bench)
    faults = []
    for _ in range(chance.choice((1, 1, 2, 3))):
        kind = chance.choice([kind for kind in possible for _ in range(_weight(kind))])
        drawn = _drawn(kind, chance.choice(possible[kind]), chance)
        # an axis that moves but once, at the beginning, would hardly ever be caught
        at_s = 0.0 if chance.random() < 0.15 else round(chance.uniform(0.0, duration_s(bench)), 4)
        faults.append(drawn | {"at_s": at_s})
    return Schedule(bench, tuple(faults))


@functools.cache
def possible_faults(name: str) -> dict[type[Fault], tuple[str, ...]]:
    """What a bench can have: each kind of fault with the devices or axes that it can strike; one, "", for the light."""
    scan = short_scan(name)
    scene = scan.scene([], seed=1)
    bench = Bench(scene, VirtualClock())
    try:
        possible = {}
        for kind in ALL:
            if is_of(kind) == "lamp_off" and scan.recipe.reference is None:
                continue  # nobody could see it
            targets: list[str] = [""]
            if issubclass(kind, AxisFault):
                targets = [role for device in scene.devices.values() for role in device.roles()]
            elif issubclass(kind, DeviceFault):
                targets = list(scene.devices)
            faults = {target: one_fault.validate_python(_drawn(kind, target, Random(0))) for target in targets}
            can = tuple(target for target, fault in faults.items() if not bench.faults.objections(fault))
            possible |= {kind: can} if can else {}
        return possible
    finally:
        bench.stop()


def _weight(kind: type[Fault]) -> int:
    """Faults that one bench alone can have are drawn more often there, for others strike on many."""
    return 3 if issubclass(kind, FrameFault | MarkerFault) else 1


def is_of(kind: type[Fault]) -> str:
    """The name of a kind of fault."""
    (name,) = get_args(kind.model_fields["fault"].annotation)
    return str(name)


def _drawn(kind: type[Fault], target: str, chance: Random) -> Drawn:
    fault: Drawn = {"fault": is_of(kind)}
    if issubclass(kind, AxisFault):
        fault["axis"] = target
    elif issubclass(kind, DeviceFault):
        fault["device"] = target
    if issubclass(kind, ReplyFault):
        fault["replies"] = _few(chance)
    return fault | {key: draw(chance) for key, draw in KEYS[is_of(kind)].items()}
