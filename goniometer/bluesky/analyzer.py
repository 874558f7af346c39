"""The polarization analyzer as a Bluesky positioner of numbered slots."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from acquisition.protocols import Analyzer
from goniometer.bluesky.bench_thread import BenchThread
from goniometer.bluesky.device import BenchTime, MovingDevice, reading
from goniometer.bluesky.processes import Process
from goniometer.bluesky.status import Status
from goniometer.errors import LimitError, PositionError
from goniometer.rig_devices.entry import AnalyzerEntry

if TYPE_CHECKING:
    from bluesky.protocols import Location, Reading
    from event_model import DataKey


class BlueskyAnalyzer(MovingDevice):
    """Movable, Readable, Locatable, Checkable, Stoppable and Configurable, as `bluesky.protocols` has them.

    Its values are numbers of slots; beside them it reads the angle of the polarizer in the beam. The configuration says
    what every slot holds.

    Parameters
    ----------
    analyzer : Analyzer
        The driver.
    entry : AnalyzerEntry
        What the rig file says of it.
    """

    def __init__(
        self, analyzer: Analyzer, entry: AnalyzerEntry, source: str, thread: BenchThread, time: BenchTime
    ) -> None:
        held = entry.contents()
        self._angles_deg = {
            slot: math.nan if isinstance(content, str) else content + entry.offset_deg for slot, content in held.items()
        }
        configuration: dict[str, tuple[Any, str | None]] = {
            f"slot_{slot}": (content, None) if isinstance(content, str) else (self._angles_deg[slot], "deg")
            for slot, content in held.items()
        }
        super().__init__("analyzer", source, thread, time, configuration)
        self._analyzer = self._mover = analyzer
        self._sent_to: int | None = None

    def set(self, slot: float) -> Status:
        """Bring a slot into the beam; a slot that there is not fails before anything is sent."""
        return self._begin(f"turn of {self.name} to slot {slot:g}", self._select(slot))

    def check_value(self, slot: float) -> None:
        """Raise LimitError for a slot that there is not."""
        if slot not in self._angles_deg:
            raise LimitError(
                self.name,
                f"slot {slot:g} does not exist; the rig file has the slots {', '.join(map(str, self._angles_deg))}",
                not_done="the move was refused and nothing was sent",
                to_do="give the number of a slot, not the angle of its polarizer",
            )

    def read(self) -> dict[str, Reading[float]]:
        """The slot in the beam, as the device says, and the angle of its polarizer; NaN where it holds none."""
        return self._thread.ask(self._read)

    def describe(self) -> dict[str, DataKey]:
        """What `read` returns."""
        return {self.name: self._data_key(0, None), f"{self.name}_angle": self._data_key(0.0, "deg")}

    def locate(self) -> Location[int]:
        """The slot that was ordered last, and the one in the beam; before the first order, twice the latter."""
        here = self._thread.ask(self._slot)
        return {"setpoint": here if self._sent_to is None else self._sent_to, "readback": here}

    def _read(self) -> dict[str, Reading[float]]:
        slot, unix_s = self._slot(), self._time.unix_s()
        return {self.name: reading(slot, unix_s), f"{self.name}_angle": reading(self._angles_deg[slot], unix_s)}

    def _slot(self) -> int:
        slot = self._analyzer.slot()
        if slot is None:
            raise PositionError(
                self.name,
                "none of its slots is in the beam",
                not_done="nothing was read, for nobody knows what the light passes through",
                to_do="send it to a slot first",
            )
        return slot

    def _select(self, slot: float) -> Process:
        self.check_value(slot)
        yield from self._until_stopped()
        self._analyzer.start_select(int(slot))
        self._sent_to = int(slot)
        yield from self._until_at_rest()
        if (here := self._slot()) != slot:
            raise PositionError(
                self.name,
                f"slot {here} is in the beam instead of slot {slot:g}",
                not_done="no reading there",
                to_do="check that nothing holds the analyzer and that nobody turned it by hand, then run the plan "
                "again",
            )
