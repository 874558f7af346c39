"""How a real bench stands when a scan is taken up again, and which of its axes cannot be believed."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from acquisition.engine import Bench
from acquisition.expand import Target
from acquisition.protocols import HomingAxis
from acquisition.timing import POLL_S
from drivers.clock import Clock
from goniometer.errors import DeviceFaultError
from goniometer.rig_file import Rig


def come_to_rest(bench: Bench, clock: Clock, check: Callable[[], None]) -> None:
    """Wait until what a killed program has set in motion stands."""
    for axis in bench.axes.values():
        while axis.is_homed() and axis.is_moving():
            check()
            clock.sleep(POLL_S)


def out_of_place(bench: Bench, rig: Rig, places: Sequence[Target]) -> tuple[HomingAxis, ...]:
    """The axes to home: those that are homed before every scan, and those that are not where the scan has left them.

    A program that was killed has left every axis at one of the places that it may have come to, or between them. One
    that is elsewhere was moved, or its controller was reset and counts from where it stands.

    Raises
    ------
    DeviceFaultError
        When such an axis could touch something on its way home.
    """
    homed = list(bench.to_home)
    for role, axis in bench.axes.items():
        if axis in homed:
            continue
        angles_deg = [place.axes_deg[role] for place in places]
        at_deg = axis.position_deg() if axis.is_homed() else None
        low_deg, high_deg = min(angles_deg), max(angles_deg)
        if at_deg is not None and low_deg - axis.tolerance_deg <= at_deg <= high_deg + axis.tolerance_deg:
            continue
        if any(role in entry.roles() for entry in rig.collision_zones):
            where = "does not know where it stands" if at_deg is None else f"says that it stands at {at_deg:g} degrees"
            raise DeviceFaultError(
                axis.name,
                f"it {where}, and the scan has left it between {low_deg:g} and {high_deg:g} degrees",
                not_done="the run was not resumed and nothing was moved, because of the rig's collision zones",
                to_do=f"see that the way is clear, home it (goniometer home --axis {role}), bring it back (goniometer "
                f"move {role} {angles_deg[0]:g}), then resume once more",
            )
        homed.append(axis)
    return tuple(homed)
