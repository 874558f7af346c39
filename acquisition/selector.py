"""A device of numbered slots, as a scan left it."""

from __future__ import annotations

from collections.abc import Mapping

from acquisition.protocols import Analyzer
from goniometer.errors import PositionError


class Selector:
    """Which slot of an analyzer, a generator or a wheel of filters is in the beam, asked as seldom as is safe.

    Parameters
    ----------
    device : Analyzer
        The device.
    part : str
        What it is on the bench, for a person.
    held : mapping of int to str, optional
        What a person knows its slots by, where not by their numbers; the others hold nothing.
    """

    def __init__(self, device: Analyzer, part: str, held: Mapping[int, str] | None = None) -> None:
        self.device, self._part, self._held = device, part, held
        self._slot: int | None = None
        self._is_sent = False
        self._goes_to: int | None = None

    def forget(self) -> None:
        """Take nothing for granted that the device said before."""
        self._slot = self._goes_to = None

    def send(self, slot: int) -> None:
        """Send it to a slot, and wait for nothing: light is read on the way."""
        self.forget()
        self.device.start_select(slot)
        self._goes_to = slot

    def arrived(self) -> None:
        """What was sent has arrived."""
        self._is_sent = False

    def begin(self, wanted: int) -> bool:
        """Begin to bring a slot into the beam; False if it is there already and nothing was sent since."""
        if self._goes_to == wanted:
            self._goes_to = None
            return True
        if self._slot is None:
            self._slot = self.device.slot()
        if self._slot == wanted and not self._is_sent:
            return False
        self._is_sent, self._slot = True, None
        self.device.start_select(wanted)
        return True

    def require(self, wanted: int) -> None:
        """Ask before and after every reading: a wheel can be turned by hand. Raises PositionError."""
        self._slot = self.device.slot()
        if self._slot != wanted:
            raise PositionError(
                self.device.name,
                f"{self._named(self._slot)} is in the beam instead of {self._named(wanted)}",
                not_done="no reading was stored that this may have spoilt",
                to_do=f"check that nothing holds the {self._part} and that nobody turned it by hand, then run the "
                "recipe again",
            )

    def _named(self, slot: int | None) -> str:
        if slot is None:
            return "no slot"
        return f"slot {slot}" if self._held is None else f"slot {slot} ({self._held.get(slot, 'nothing')})"
