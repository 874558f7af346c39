"""Thorlabs Elliptec sliders ELL9 (four slots) and ELL6 (two) as analyzers, on a bus that several modules share."""

from __future__ import annotations

from drivers.elliptec_bus import ElliptecBus
from drivers.elliptec_exchange import Exchange
from drivers.elliptec_packets import Packet, identity_of
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
        self._bus, self._address = bus, address
        self._target = self._next = 0
        self._step: Exchange | None = None

    def connect(self) -> None:
        """Check that the module is a slider with these slots; moves nothing. Raises DeviceFaultError otherwise."""
        model = identity_of(self._bus.query(self.name, self._address, "in")).model
        if _SLOTS.get(model) != self.slots:
            raise DeviceFaultError(
                self.name,
                f"the module with address {self._address:X} is of type {model}, not a slider of {self.slots} slots",
                not_done="nothing was moved",
                to_do="check the address and the slots in the rig file",
            )

    def start_select(self, slot: int) -> None:
        """Begin to bring a slot into the beam.

        Raises
        ------
        LimitError
            For a slot that the slider has not; nothing is sent.
        PositionError
            When it stands between two slots; nothing is moved.
        """
        if not 1 <= slot <= self.slots:
            raise LimitError(
                self.name,
                f"slot {slot} does not exist; the slider has slots 1 to {self.slots}",
                not_done="the move was refused and nothing was sent",
                to_do="correct the slot in the rig file",
            )
        self._target, self._step = slot, None
        self._start_step(self.slot())

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
        if self._step is None:
            return False
        self._bus.pump()
        if not self._step.is_over:
            return True
        step, self._step = self._step, None
        answer = step.answer()
        reached = self._slot_at(answer) if answer.kind == "PO" else self.slot()
        if reached != self._next:
            raise PositionError(
                self.name,
                f"the slider was sent to slot {self._next} but stands at slot {reached}",
                not_done=f"slot {self._target} is not in the beam",
                to_do="check that nobody moved the slider by its buttons and that it moves freely",
            )
        self._start_step(reached)
        return self._step is not None

    def slot(self) -> int:
        """Which slot the slider says is in the beam; waits until the bus is free, raises PositionError for none."""
        return self._slot_at(self._bus.query(self.name, self._address, "gp"))

    def stop(self) -> None:
        """Stop, and begin no further step; returns when the slider has answered."""
        self._step = None
        self._bus.stop(self.name, self._address)

    def close(self) -> None:
        """Close the bus' port."""
        self._bus.close()

    def _start_step(self, here: int) -> None:
        if here != self._target:
            forward = self._target > here
            self._next = here + (1 if forward else -1)
            self._step = self._bus.start(Exchange(self.name, self._address, "fw" if forward else "bw"))

    def _slot_at(self, position: Packet) -> int:
        slot = 1 + round(position.pulses / _PULSES_PER_SLOT)
        if not 1 <= slot <= self.slots or abs(position.pulses - _PULSES_PER_SLOT * (slot - 1)) > _NEAR_PULSES:
            raise PositionError(
                self.name,
                f"the slider stands at {position.pulses}, where it has no slot",
                not_done="no slot is in the beam",
                to_do="move the slider by its buttons to one of its slots",
            )
        return slot
