"""Thorlabs Elliptec sliders ELL9 (four slots) and ELL6 (two) as analyzers, on a bus that several modules share."""

from __future__ import annotations

import math

from drivers.motion import stop_or_warn
from drivers.thorlabs_elliptec.bus import ElliptecBus
from drivers.thorlabs_elliptec.module import ElliptecModule
from drivers.thorlabs_elliptec.packets import Packet
from goniometer.errors import DeviceFaultError, LimitError, PositionError

_SLOTS = {9: 4, 6: 2}
_PULSES_PER_SLOT = 0x20
_NEAR_PULSES = 2


class ElliptecSlider:
    """One slider that holds polarizers; it steps from slot to slot.

    Parameters
    ----------
    bus : ElliptecBus
        The bus it is on.
    address : int
        Its address on the bus, 0 to 15.
    name : str
        The device's name in the rig file.
    slots : int
        How many slots it has: 4 or 2.
    settle_s : float
        Time to come to rest after its answer.
    """

    def __init__(self, bus: ElliptecBus, address: int, *, name: str, slots: int, settle_s: float) -> None:
        self.name, self.slots, self.settle_s = name, slots, settle_s
        self._module, self._address = ElliptecModule(bus, address, name), address
        self._target = self._next = 0

    @property
    def identity(self) -> str:
        """What the module said of itself, with its serial number."""
        return self._module.says

    def connect(self) -> tuple[str, ...]:
        """Check that the module is a slider with these slots; moves nothing.

        Returns
        -------
        tuple of str
            The error that was left in the module from earlier use.

        Raises
        ------
        DeviceFaultError
            When it is another module, or another than the last time.
        """
        model = self._module.identity().model
        if _SLOTS.get(model) != self.slots:
            raise DeviceFaultError(
                self.name,
                f"the module with address {self._address:X} is of type {model}, not a slider of {self.slots} slots",
                not_done="nothing was moved",
                to_do="check the address and the slots in the rig file",
            )
        return self._module.left_over()

    def start_select(self, slot: int) -> None:
        """Begin to bring a slot into the beam.

        Raises
        ------
        LimitError
            For a slot that the slider has not; nothing is sent.
        PositionError
            When it stands between two slots; nothing is moved.
        DeviceFaultError
            When it still moves.
        """
        if not 1 <= slot <= self.slots:
            raise LimitError(
                self.name,
                f"slot {slot} does not exist; the slider has slots 1 to {self.slots}",
                not_done="the move was refused and nothing was sent",
                to_do="correct the slot in the rig file",
            )
        self._module.refuse_in_motion(f"the step to slot {slot}")
        here = self.slot()
        if here is None:
            raise PositionError(
                self.name,
                "the slider stands between its slots",
                not_done=f"slot {slot} is not in the beam",
                to_do="move the slider by its buttons to one of its slots",
            )
        self._target = slot
        self._start_step(here)

    def is_moving(self) -> bool:
        """Whether the slot is still on its way.

        Raises
        ------
        DeviceFaultError
            When the slider says that a step has failed.
        ReplyTimeoutError
            When a step is not answered.
        PositionError
            When a step has led elsewhere.
        """
        answers = self._module.answers()
        if not answers:
            return answers is None
        reached = self._slot_at(answers[0]) if answers[0].kind == "PO" else self.slot()
        if reached != self._next:
            raise PositionError(
                self.name,
                f"the slider was sent to slot {self._next} but stands at {f'slot {reached}' if reached else 'none'}",
                not_done=f"slot {self._target} is not in the beam",
                to_do="check that nobody moved the slider by its buttons and that it moves freely",
            )
        return self._start_step(reached)

    def remaining_s(self) -> float:
        """Infinite: the slider's steps differ in length."""
        return math.inf

    def slot(self) -> int | None:
        """Which slot the slider says is in the beam, or None, also on its way; waits until the bus is free."""
        slot = self._slot_at(self._module.query("gp"))
        return slot if self._module.rests() else None  # it names a slot before it has come to stand there

    def stop(self) -> None:
        """Begin no further step; one under way ends by itself, which `is_moving` tells.

        Raises
        ------
        NotConnectedError
            When the link is gone and a fresh connection fails too.
        """
        stop_or_warn(self.name, self._module.stop, self.reconnect)

    def reconnect(self) -> None:
        """Open the bus' port afresh, once; raises NotConnectedError."""
        self._module.reconnect()

    def close(self) -> None:
        """Close the bus' port."""
        self._module.close()

    def _start_step(self, here: int) -> bool:
        """Begin the next step; False when the slot is reached."""
        if here == self._target:
            return False
        forward = self._target > here
        self._next = here + (1 if forward else -1)
        self._module.begin(("fw" if forward else "bw", ""))
        return True

    def _slot_at(self, position: Packet) -> int | None:
        slot = 1 + round(position.pulses / _PULSES_PER_SLOT)
        is_there = abs(position.pulses - _PULSES_PER_SLOT * (slot - 1)) <= _NEAR_PULSES
        return slot if is_there and 1 <= slot <= self.slots else None
