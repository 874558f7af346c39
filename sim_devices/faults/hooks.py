"""What can happen to a simulated device itself; a device that has not got such a method cannot have the fault."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol, runtime_checkable

from sim_devices.axis import Axis

if TYPE_CHECKING:
    from sim_devices.camera.camera import Camera


@runtime_checkable
class LosesPower(Protocol):
    """A device with a plug."""

    def power_cycle(self, now_s: float) -> None:
        """Lose power for a moment, and all that is not kept without it."""
        ...


@runtime_checkable
class Resets(Protocol):
    """A device that can begin afresh without losing power."""

    def reset(self, now_s: float) -> None:
        """Begin afresh."""
        ...


@runtime_checkable
class HasLimitSwitches(Protocol):
    """A controller of axes with switches at their ends."""

    def hit_limit(self, axis: Axis, now_s: float) -> None:
        """Stop an axis as its limit switch does."""
        ...


@runtime_checkable
class LosesHome(Protocol):
    """A controller that counts from a home position."""

    def lose_home(self, axis: Axis, now_s: float) -> None:
        """Forget where home is."""
        ...


@runtime_checkable
class HasButton(Protocol):
    """A device that a person can move by a button on it."""

    def press(self, now_s: float) -> None:
        """Press the button that moves one step forward."""
        ...


@runtime_checkable
class TakesPictures(Protocol):
    """A device with a camera, of which pictures and files can go wrong."""

    camera: Camera


@runtime_checkable
class Line(Protocol):
    """What answers at a port that several devices share; one of them can be off while the others go on."""

    def turn_off(self, member: object, until_s: float) -> None:
        """Let one of them hear and say nothing until then."""
        ...
