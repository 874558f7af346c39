"""What a rotation stage's driver offers to the axis above it."""

from __future__ import annotations

from typing import Protocol, runtime_checkable


@runtime_checkable
class SaysWhenItStood(Protocol):
    """A stage whose `is_moving` asks more behind the end of a motion, in which it settles already."""

    stood_s: float
    """When the device last said that it stands, on the bench's clock."""


class Stage(Protocol):
    """One stage, as its controller knows it: angles in degrees of its own scale, unbounded.

    A stage obeys and reports. Limits, the approach from one side, the way round a full turn and deadlines are the
    axis' own (`drivers.axis`), so that they are the same for every make.
    """

    name: str
    velocity_deg_s: float
    acceleration_deg_s2: float
    reports_in_motion: bool
    """Whether the position can be asked for while the stage moves."""

    def connect(self) -> tuple[str, ...]:
        """Check that the device is the one expected and tell it its speed; moves nothing.

        After a lost link, when it is called again, the device must be the same, and not have lost its power unless it
        keeps its home without; raises DeviceFaultError otherwise.

        Returns
        -------
        tuple of str
            Errors that were left in the device from earlier use.
        """
        ...

    def is_homed(self) -> bool:
        """Whether the device knows where its zero is."""
        ...

    def start_homing(self) -> None:
        """Begin to search the home position."""
        ...

    def start_move(self, target_deg: float) -> None:
        """Begin to move; raises DeviceFaultError when the device does not take the command."""
        ...

    def is_moving(self) -> bool:
        """Ask the device; raises DeviceFaultError when it reports that the motion has failed."""
        ...

    def position_deg(self) -> float:
        """Where the device says it is."""
        ...

    def stop(self) -> None:
        """Stop; safe to call at any time."""
        ...

    def reconnect(self) -> None:
        """Open the port afresh, once, after the link was lost; moves nothing, and waits for nobody."""
        ...

    def close(self) -> None:
        """Close the port."""
        ...
