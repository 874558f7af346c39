"""One turn of an analyzer that is read meanwhile: the readings taken in it, and where the analyzer was in each."""

from __future__ import annotations

from dataclasses import replace

from acquisition.even_turn import EvenTurn
from acquisition.protocols import HomingAxis
from acquisition.readings import Reading
from acquisition.rotation import Rotation
from acquisition.steps import Step
from drivers.clock import Clock
from goniometer.errors import PositionError


class Turn:
    """What is known of a turn so far."""

    def __init__(self, step: Step, rotation: Rotation, axis: HomingAxis, begins_s: float) -> None:
        self.step, self.rotation, self.begins_s = step, rotation, begins_s
        self.angles_deg: tuple[float, ...] = ()
        self.taken: list[Reading] = []
        self.begun_s = 0.0
        self._axis, self._way = axis, EvenTurn()

    def look(self, clock: Clock) -> None:
        """Ask the analyzer where it is."""
        asked_s = clock.now()
        position_deg = self._axis.position_deg()
        self._way.add(asked_s, position_deg, clock.now())

    def middle_s(self, reading: Reading) -> float:
        """The middle of a reading since the turn has begun."""
        return reading.time_s + reading.exposure_s / 2 - self.begins_s

    def at_angle(self, reading: Reading, angle_deg: float, sweep_deg: float) -> Reading:
        """The reading with the analyzer's state in it."""
        state = self.rotation.state(angle_deg, sweep_deg)
        return replace(
            reading,
            analyzer_deg=state.polarizer_deg,
            retarder_deg=state.retarder_deg,
            retardance_deg=state.retardance_deg,
            analyzer_sweep_deg=state.polarizer_sweep_deg or None,
            retarder_sweep_deg=state.retarder_sweep_deg or None,
        )

    def require_begun(self, readings: int) -> None:
        """See that it was over only behind a reading; raises PositionError when the program came too late for any."""
        if readings:
            return
        raise PositionError(
            self._axis.name,
            "its turn was over before a reading of it could be taken: this program was held up",
            not_done="nothing of the turn was stored",
            to_do="see that nothing else keeps this computer busy, let the rotator turn more slowly (velocity_deg_s), "
            "or simulate at a smaller --speed; then go on",
        )

    def require_even(self) -> None:
        """See that the analyzer turned evenly; raises PositionError, or what the device itself says is wrong."""
        fault = self._way.fault(self._axis.tolerance_deg, self.rotation.axis.velocity_deg_s)
        if not fault:
            return
        self._axis.is_moving()  # which says what has stopped it
        raise PositionError(
            self._axis.name,
            fault,
            not_done="the readings of this turn were not stored",
            to_do="look whether something brakes the rotator, and whether velocity_deg_s and acceleration_deg_s2 in "
            "the rig file are what it truly does, then run the recipe again",
        )

    def readings(self) -> list[Reading]:
        """The readings, with where the analyzer was in them by all that it has said."""
        speed_deg_s = self._way.speed_deg_s
        return [
            self.at_angle(
                reading,
                self._way.angle_deg(reading.time_s + reading.exposure_s / 2),
                speed_deg_s * reading.exposure_s,
            )
            for reading in self.taken
        ]
