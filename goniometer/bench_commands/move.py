"""`goniometer move`: one axis to an angle, and where it came to stand."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from pathlib import Path

from acquisition.timing import AxisTiming
from goniometer.bench_commands.open_bench import Tell, open_axes
from goniometer.errors import PositionError
from goniometer.rig_devices.entry import Role


def move(rig_path: Path, role: Role, target_deg: float, tell: Tell, note: Tell, *, trace: Path | None = None) -> None:
    """Move an axis and tell where it was, how long it should take, and where it stands afterwards.

    Nothing is connected but this axis and those that it could touch.

    Raises
    ------
    LimitError, CollisionError
        When the target or the way there is forbidden; nothing was moved.
    PositionError
        When the axis came to rest outside its tolerance.
    """
    with open_axes(rig_path, [role], note, trace, alone=False) as opened:
        axis = opened.axes[role]
        here_deg = axis.position_deg()
        duration_s = _duration_s(opened.rig.axes()[role].timing, axis.way_deg(here_deg, target_deg))
        axis.start_move(target_deg)
        tell(f"{role}: from {here_deg:.4f}° to {target_deg:g}°, about {duration_s:.1f} s")
        opened.until_at_rest(axis)
        reached_deg = axis.position_deg()
        if abs(reached_deg - target_deg) > axis.tolerance_deg:
            raise PositionError(
                axis.name,
                f"it came to rest at {reached_deg:.4f} degrees (tolerance {axis.tolerance_deg:g} degrees)",
                not_done=f"the move to {target_deg:g} degrees",
                to_do=f"look whether something touches the stage, then: goniometer home --axis {role}",
            )
        tell(f"{role}: stands at {reached_deg:.4f}°")


def _duration_s(timing: AxisTiming, way_deg: Sequence[float]) -> float:
    return sum(timing.move_s(there - here) for here, there in itertools.pairwise(way_deg)) + timing.settle_s
