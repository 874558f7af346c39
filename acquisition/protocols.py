"""What the engine asks of a device: small Protocols that any driver can satisfy.

Every slow action has two halves, a start that returns at once and a poll, so that one thread can let all devices work
at the same time and can be interrupted between any two polls.
"""

from __future__ import annotations

from typing import Protocol, runtime_checkable

from drivers.camera.frame import Frame
from drivers.camera.region import RegionMean


class Reachable(Protocol):
    """What every device has: a link that may be lost."""

    name: str

    def connect(self) -> tuple[str, ...]:
        """Check that it is the device expected and set it up; moves nothing. Returns what it held from earlier use.

        After a lost link: check that it is the same still, and has kept its home; raises DeviceError otherwise.
        """
        ...

    def reconnect(self) -> None:
        """Open its port afresh, once, after the link was lost; raises NotConnectedError."""
        ...


@runtime_checkable
class RotaryAxis(Reachable, Protocol):
    """One axis that turns; angles in degrees."""

    settle_s: float
    tolerance_deg: float

    @property
    def rested_s(self) -> float:
        """When it was seen to have come to rest, on the bench's clock."""
        ...

    def start_move(self, target_deg: float) -> None:
        """Begin to move; raises LimitError before the first byte when the target is outside the limits."""
        ...

    def is_moving(self) -> bool:
        """Ask the device; raises DeviceFaultError or ReplyTimeoutError when the motion has failed."""
        ...

    def remaining_s(self) -> float:
        """How long it should still move, by its speed; asks nothing. Infinite when nobody can tell."""
        ...

    def position_deg(self) -> float:
        """Where the device says it is."""
        ...

    def stop(self) -> None:
        """Stop at once; safe to call at any time."""
        ...


class HomingAxis(RotaryAxis, Protocol):
    """An axis that can search its home position."""

    def is_homed(self) -> bool:
        """Whether it knows where its zero is."""
        ...

    def start_homing(self) -> None:
        """Begin to search the home position; `is_moving` tells when it is found."""
        ...


class Analyzer(Reachable, Protocol):
    """A polarization analyzer that takes one of several numbered slots."""

    settle_s: float

    def start_select(self, slot: int) -> None:
        """Begin to bring a slot into the beam."""
        ...

    def is_moving(self) -> bool:
        """Whether the slot is still on its way; raises ReplyTimeoutError when it does not arrive."""
        ...

    def remaining_s(self) -> float:
        """How long it should still take; asks nothing. Infinite when nobody can tell."""
        ...

    def slot(self) -> int | None:
        """Which slot the device says is in the beam; None when there is none."""
        ...

    def stop(self) -> None:
        """Stop at once, where the device can; safe to call at any time."""
        ...


class TakesExposures(Protocol):
    """What begins readings."""

    def start_reading(self, exposure_s: float) -> None:
        """Begin one reading; raises LimitError for an exposure that cannot be."""
        ...


class Detector(Reachable, TakesExposures, Protocol):
    """A detector of optical power."""

    def is_exposing(self) -> bool:
        """Whether the reading still needs the light; afterwards the bench may move, `is_reading` or not.

        A detector that then finds the reading in doubt takes it again, and needs the light once more.
        """
        ...

    def is_reading(self) -> bool:
        """Whether the reading is still being taken; raises ReplyTimeoutError when it does not come."""
        ...

    def power_w(self) -> float:
        """The finished reading; raises DeviceFaultError when the detector was saturated."""
        ...


@runtime_checkable
class Camera(Detector, Protocol):
    """A detector that takes pictures: its power is the mean over a region of them."""

    def read(self) -> RegionMean:
        """Mean and variance over its region of the finished reading; raises as `power_w` does."""
        ...

    def frame(self) -> Frame:
        """The picture of the finished reading, saturated or not; raises ReplyError when there is none."""
        ...


@runtime_checkable
class TakesFrames(Protocol):
    """A detector whose readings are pictures, to be stored with them."""

    used_s: float

    def frames(self) -> tuple[Frame, ...]:
        """The pictures of the finished reading; its power comes from one that was exposed for `used_s`."""
        ...
