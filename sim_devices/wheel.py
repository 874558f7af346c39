"""The analyzer wheel of the simulated bench: which slot is in the beam, whatever controller turns it."""

from __future__ import annotations

from dataclasses import dataclass

from sim_devices.timeline import Timeline


@dataclass(frozen=True)
class Turn:
    """A turn of the wheel, the `number`-th; nothing is in the beam while it lasts."""

    start_s: float
    end_s: float
    slot: int
    number: int


class Wheel:
    """A wheel that starts with slot 1 in the beam, after so many turns."""

    def __init__(self, turns: int = 0) -> None:
        self._turns = Timeline(Turn(float("-inf"), float("-inf"), 1, turns))

    def slot(self, time_s: float) -> int | None:
        """The slot in the beam, or None while the wheel turns."""
        turn = self._turns.at(time_s)
        return turn.slot if time_s >= turn.end_s else None

    def arrival(self, time_s: float) -> int:
        """How many turns had begun by `time_s`; a turn to where the wheel stands is none."""
        return self._turns.at(time_s).number

    @property
    def target(self) -> int:
        """The slot that the last turn that was asked for ends at."""
        return self._turns.last.slot

    def turn(self, slot: int, now_s: float, *, slots: int, slot_s: float) -> float:
        """Turn the shorter way round and return the time of arrival.

        Parameters
        ----------
        slot : int
            Where to go, from 1 to `slots`.
        now_s : float
            Time of the start; the wheel stands.
        slots : int
            Slots all round.
        slot_s : float
            Time from one slot to its neighbour.
        """
        forward = (slot - self.target) % slots
        arrival_s = now_s + min(forward, slots - forward) * slot_s
        number = self._turns.last.number + (forward > 0)
        self._turns.add(now_s, Turn(now_s, arrival_s, slot, number))
        return arrival_s
