"""An arm or the sample stage as a Bluesky motor, in degrees."""

from __future__ import annotations

from typing import TYPE_CHECKING

from drivers.axis import Axis
from drivers.motion import refuse_outside
from goniometer.bluesky.bench_thread import BenchThread
from goniometer.bluesky.device import BenchTime, MovingDevice, reading
from goniometer.bluesky.processes import Process
from goniometer.bluesky.status import Status
from goniometer.errors import PositionError
from goniometer.rig_devices.entry import AxisEntry, Role

if TYPE_CHECKING:
    from bluesky.protocols import Location, Reading
    from event_model import DataKey


class BlueskyAxis(MovingDevice):
    """Movable, Readable, Locatable, Checkable, Stoppable and Configurable, as `bluesky.protocols` has them.

    Parameters
    ----------
    role : str
        What it turns; its name in the documents.
    axis : Axis
        The axis itself, with its limits, its backlash and its interlock.
    entry : AxisEntry
        What the rig file says of it.
    """

    def __init__(
        self, role: Role, axis: Axis, entry: AxisEntry, source: str, thread: BenchThread, time: BenchTime
    ) -> None:
        configuration = {
            "velocity": (entry.velocity_deg_s, "deg/s"),
            "acceleration": (entry.acceleration_deg_s2, "deg/s^2"),
            "settle": (entry.settle_s, "s"),
            "tolerance": (entry.tolerance_deg, "deg"),
            "backlash": (entry.backlash_deg, "deg"),
        }
        super().__init__(role, source, thread, time, configuration)
        self._axis = self._mover = axis
        self._sent_to_deg: float | None = None
        self._left_deg: float | None = None

    def set(self, target_deg: float) -> Status:
        """Go to an angle; a move outside the limits, or into a collision zone, fails before anything is sent."""
        return self._begin(f"move of {self.name} to {target_deg:g} degrees", self._move(float(target_deg)))

    def check_value(self, target_deg: float) -> None:
        """Raise LimitError for an angle outside the limits; collisions depend on the way, and show when it is gone."""
        refuse_outside(self.name, target_deg, self._axis.travel.reachable_deg)

    def read(self) -> dict[str, Reading[float]]:
        """Where the device says it is."""
        return self._thread.ask(lambda: {self.name: reading(self._axis.position_deg(), self._time.unix_s())})

    def describe(self) -> dict[str, DataKey]:
        """What `read` returns, with the limits of the angle."""
        low_deg, high_deg = self._axis.travel.reachable_deg
        key = self._data_key(0.0, "deg")
        key["limits"] = {"control": {"low": low_deg, "high": high_deg}}
        return {self.name: key}

    def locate(self) -> Location[float]:
        """Where it was sent last, and where the device says it is; before the first move, twice the latter."""
        here_deg = self._thread.ask(self._axis.position_deg)
        return {"setpoint": here_deg if self._sent_to_deg is None else self._sent_to_deg, "readback": here_deg}

    def _move(self, target_deg: float) -> Process:
        yield from self._until_stopped()
        self._require_still_there()
        self._sent_to_deg, self._left_deg = target_deg, None
        self._axis.start_move(target_deg)
        yield from self._until_at_rest()
        here_deg, tolerance_deg = self._axis.position_deg(), self._axis.tolerance_deg
        if abs(here_deg - target_deg) > tolerance_deg:
            raise PositionError(
                self.name,
                f"stands at {here_deg:g} degrees after a move to {target_deg:g} degrees (tolerance {tolerance_deg:g} "
                "degrees)",
                not_done="no reading there",
                to_do="check that nothing touches the stage, home it, then run the plan again",
            )
        self._left_deg = here_deg

    def _require_still_there(self) -> None:
        """Refuse to move from where the axis was not left: every way, and every collision, is reckoned from there."""
        here_deg = self._axis.position_deg()
        if self._left_deg is not None and abs(here_deg - self._left_deg) > self._axis.tolerance_deg:
            raise PositionError(
                self.name,
                f"stands at {here_deg:g} degrees although it was left at {self._left_deg:g} degrees: it was moved by "
                "hand, or its controller was reset and counts from another zero",
                not_done="nothing was moved; the last readings may have been taken elsewhere",
                to_do="look where it truly stands, home it, then open the bench again",
            )
