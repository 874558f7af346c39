"""An analyzer made of a polarizer, and optionally of a retarder before it, of which at least one turns."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Protocol

from goniometer.errors import ConfigurationError, DeviceError, LimitError, NotConnectedError


class TurningAxis(Protocol):
    """What carries an element; `drivers.axis.Axis` is one. Angles in degrees."""

    name: str
    settle_s: float
    tolerance_deg: float

    def connect(self) -> tuple[str, ...]:
        """Check the stage and set it up; moves nothing. Returns what it held from earlier use."""
        ...

    def reconnect(self) -> None:
        """Open its port afresh, once, after the link was lost."""
        ...

    def start_move(self, target_deg: float) -> None:
        """Begin to move."""
        ...

    def is_moving(self) -> bool:
        """Ask whether the motion goes on."""
        ...

    def remaining_s(self) -> float:
        """How long it should still move."""
        ...

    def position_deg(self) -> float:
        """Where the axis says it is."""
        ...

    def stop(self) -> None:
        """Stop; safe to call at any time."""
        ...


@dataclass(frozen=True)
class SlotAngles:
    """Where the axes stand for one slot, in degrees; None for an element that is fixed, or not there."""

    polarizer_deg: float | None = None
    retarder_deg: float | None = None


class RotatingAnalyzer:
    """Numbered slots, each an angle of every element that turns.

    Parameters
    ----------
    polarizer, retarder : TurningAxis or None
        Turn the polarizer and the retarder; None for one that is fixed, or not there.
    name : str
        The device's name in the rig file.
    slots : mapping of int to SlotAngles
        The angles of each slot.

    Raises
    ------
    ConfigurationError
        When nothing turns, a slot lacks an angle or has one too many, or two slots cannot be told apart.
    """

    def __init__(
        self,
        polarizer: TurningAxis | None = None,
        retarder: TurningAxis | None = None,
        *,
        name: str,
        slots: Mapping[int, SlotAngles],
    ) -> None:
        self.name = name
        turning = {"polarizer_deg": polarizer, "retarder_deg": retarder}
        self._axes = tuple(axis for axis in turning.values() if axis is not None)
        if not self._axes:
            raise ConfigurationError([f"{name}: neither polarizer nor retarder turns. Name an axis in the rig file."])
        self.settle_s = max(axis.settle_s for axis in self._axes)
        self._slots = {slot: _angles_deg(angles) for slot, angles in slots.items()}
        faults = self._angle_faults({key for key, axis in turning.items() if axis}, slots) or self._slot_faults()
        if faults:
            raise ConfigurationError(faults)

    def connect(self) -> tuple[str, ...]:
        """Check every axis again; moves nothing. Returns what they held from earlier use."""
        return tuple(f"{axis.name}: {note}" for axis in self._axes for note in axis.connect())

    def reconnect(self) -> None:
        """Open the axes' ports afresh, once, after a link was lost; raises NotConnectedError."""
        for axis in self._axes:
            axis.reconnect()

    def start_select(self, slot: int) -> None:
        """Begin to turn the axes to a slot's angles.

        Raises
        ------
        LimitError
            For a slot that there is not; nothing is sent.
        DeviceError
            When an axis does not take its move; an axis that has begun is stopped.
        """
        if slot not in self._slots:
            raise LimitError(
                self.name,
                f"slot {slot} does not exist; the analyzer has the slots {', '.join(map(str, sorted(self._slots)))}",
                not_done="the move was refused and nothing was sent",
                to_do="correct the slot in the rig file",
            )
        with ExitStack() as undo:
            undo.callback(self.stop)
            for axis, angle_deg in zip(self._axes, self._slots[slot], strict=True):
                axis.start_move(angle_deg)
            undo.pop_all()

    def is_moving(self) -> bool:
        """Whether an axis is still on its way; raises what an axis raises when its motion has failed."""
        moving = [axis.is_moving() for axis in self._axes]  # each is asked: asking is what moves an axis on
        return any(moving)

    def remaining_s(self) -> float:
        """How long the last axis should still take."""
        return max(axis.remaining_s() for axis in self._axes)

    def slot(self) -> int | None:
        """Which slot's angles the axes say they are at, each within its tolerance and whole turns aside; or None."""
        positions_deg = tuple(axis.position_deg() for axis in self._axes)
        for slot, angles_deg in self._slots.items():
            if self._are_alike(positions_deg, angles_deg, tolerances=1):
                return slot
        return None

    def stop(self) -> None:
        """Stop every axis, also when one of them cannot be stopped; safe to call at any time.

        Raises
        ------
        DeviceError
            What the axis that could not be stopped has raised; NotConnectedError when there was more than one.
        """
        failures: list[DeviceError] = []
        for axis in self._axes:
            try:
                axis.stop()
            except DeviceError as failure:
                failures.append(failure)
        if len(failures) > 1:
            raise NotConnectedError(
                self.name,
                "; ".join(f"{failure.device}: {failure.happened}" for failure in failures),
                not_done="neither axis was stopped, and both may still be moving",
                to_do=failures[0].to_do,
            )
        if failures:
            raise failures[0]

    def _angle_faults(self, needed: set[str], slots: Mapping[int, SlotAngles]) -> list[str]:
        given = {
            slot: {key for key, angle in vars(angles).items() if angle is not None} for slot, angles in slots.items()
        }
        return [
            f"{self.name}: slot {slot} has {' and '.join(sorted(keys)) or 'no angle'}; allowed: "
            f"{' and '.join(sorted(needed))}, for {' and '.join(axis.name for axis in self._axes)}. Correct the slot "
            "in the rig file."
            for slot, keys in given.items()
            if keys != needed
        ]

    def _slot_faults(self) -> list[str]:
        slots = sorted(self._slots)
        return [
            f"{self.name}: the slots {one} and {other} have angles that cannot be told apart within the axes' "
            "tolerances. Give them other angles, or leave one of them out."
            for number, one in enumerate(slots)
            for other in slots[number + 1 :]
            if self._are_alike(self._slots[one], self._slots[other], tolerances=2)
        ]

    def _are_alike(self, some_deg: tuple[float, ...], others_deg: tuple[float, ...], tolerances: int) -> bool:
        return all(
            abs((one_deg - other_deg + 180.0) % 360.0 - 180.0) <= tolerances * axis.tolerance_deg
            for axis, one_deg, other_deg in zip(self._axes, some_deg, others_deg, strict=True)
        )


def _angles_deg(angles: SlotAngles) -> tuple[float, ...]:
    return tuple(angle for angle in (angles.polarizer_deg, angles.retarder_deg) if angle is not None)
