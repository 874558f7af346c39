"""Takes the readings of a step while the analyzer turns.

A turn is known as a whole: where the analyzer was in each reading follows from all positions that it was asked for on
its way, and only then are the readings stored. A turn that is broken off is begun anew.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from acquisition.orders import Orders
from acquisition.placement import Astray, Placement
from acquisition.protocols import TakesExposures
from acquisition.readings import Reading
from acquisition.readout import reading_of
from acquisition.rotation import BACKWARDS, FEWEST_READINGS, FORWARDS, STEADY_S, Rotation
from acquisition.steps import Step, Target
from acquisition.stopping import require_rest
from acquisition.timing import DUE_POLL_S, READING_POLL_S
from acquisition.turn import Turn
from drivers.camera.frame import Frame
from drivers.clock import Clock
from goniometer.errors import LimitError

if TYPE_CHECKING:
    from acquisition.engine import Bench

_LATE_S = STEADY_S / 2
"""How much later than the turn its last reading may end; then the analyzer is as fast still."""


class _BrokenOff(Exception):
    """A turn that is begun anew; never leaves the readout."""


class TurnReadout:
    """Takes, confirms and stores the readings of turns.

    Parameters
    ----------
    bench, clock, keep, placement, wait, orders
        As for `Readout`; the bench's analyzer has the ends of its way as slots.
    """

    def __init__(
        self,
        bench: Bench,
        clock: Clock,
        keep: Callable[[Reading, Sequence[Frame]], None],
        placement: Placement,
        wait: Callable[[float], None],
        orders: Orders,
    ) -> None:
        self._bench, self._clock, self._keep_reading = bench, clock, keep
        self._placement, self._wait, self._orders = placement, wait, orders
        self._there = 0
        self._told_s: float | None = None

    def begin(self, there: Sequence[Reading]) -> None:
        """Begin a step, of which these readings are there already."""
        self._there = len(there)

    def has_all(self, step: Step) -> bool:
        """Whether a step has its readings."""
        return self._there >= step.readings

    def take(self, step: Step, after: Target | None) -> None:
        """Take the readings that a step still wants in one turn, and store them.

        Returns without all of them when the turn was broken off, or some did not fit into it.

        Parameters
        ----------
        step : Step
            What is wanted.
        after : Target or None
            Where to leave for as soon as the last one has its light; None: nowhere.

        Raises
        ------
        PositionError
            When the analyzer did not turn evenly; the readings of the turn are not stored.
        DeviceError
            When a device fails; the readings of earlier turns are safe.
        ScanInterrupted
            When waiting says so.
        """
        if self.has_all(step):
            return  # the link was lost behind the last reading
        try:
            self._placement.arrive(step.target)
            if self._orders.are_waiting:
                self._orders.carry_out(step)
                if self._orders.leaves_out(step):
                    return
            self._turn(step, after)
        except Astray as astray:
            self._break_off()
            self._orders.tell(astray.event)
        except _BrokenOff:
            self._break_off()

    def _turn(self, step: Step, after: Target | None) -> None:
        rotation, slot = step.rotation, step.target.slot
        assert rotation is not None, "such a step turns the analyzer"
        axis = self._bench.polarizer if rotation.element == "polarizer" else self._bench.retarder
        assert axis is not None, "a recipe is only accepted on a bench that has what it turns"
        step = self._told(step)
        self._told_s = None  # unless all goes well
        self._placement.send_analyzer(BACKWARDS if slot == FORWARDS else FORWARDS)
        turn = Turn(step, rotation, axis, self._clock.now() + rotation.begin_s)
        turn.angles_deg = self._placement.read_back(anew=True)  # while the analyzer gathers speed
        wanted, leaves, failure = step.readings - self._there, False, None
        self._wait(max(turn.begins_s - _LATE_S - self._clock.now(), 0.0))
        turn.look(self._clock)
        for number in range(wanted):
            self._wait(max(turn.begins_s + number * rotation.spacing_s(wanted) - self._clock.now(), 0.0))
            is_last = number == wanted - 1
            if number and self._orders.are_waiting:  # at first what they had to do is done
                raise _BrokenOff
            if not self._expose(turn, is_last=is_last):
                turn.require_begun(number)
                break
            if is_last and after is not None and not self._orders.are_waiting:
                leaves = True
                failure = self._placement.departure(after)
            self._confirm(turn)
        turn.require_even()
        for reading in turn.readings():
            self._keep_reading(reading, ())
            self._there += 1
        self._told_s = step.exposure_s
        if not self.has_all(step):
            self._break_off()
        if failure is not None:
            raise failure
        if not leaves and self._orders.are_waiting:
            self._orders.carry_out(step)

    def _told(self, step: Step) -> Step:
        """Have the detector told the exposure, by a reading of no account: one that waits for that begins late."""
        step = self._orders.as_ordered(step)
        if step.exposure_s != self._told_s:
            assert step.rotation is not None, "such a step turns the analyzer"
            step = self._orders.start_reading(_Fitting(self._bench.detector, step.rotation), step)
            self._end_reading()
        return step

    def _expose(self, turn: Turn, *, is_last: bool) -> bool:
        """Take a reading until it has its light; False when it would outlast the turn."""
        begun_s, exposure_s = self._clock.now(), turn.step.exposure_s
        if begun_s + exposure_s > turn.begins_s + turn.rotation.turn_s + _LATE_S:
            return False
        self._bench.detector.start_reading(exposure_s)
        turn.look(self._clock)
        if is_last:
            self._placement.read_back(anew=True)
        left_s = begun_s + exposure_s - self._clock.now()
        self._wait(max(left_s, 0.0))
        while self._bench.detector.is_exposing():
            self._wait(DUE_POLL_S)
        turn.begun_s = begun_s
        return True

    def _confirm(self, turn: Turn) -> None:
        """Finish a reading; one that the detector had to take again was taken at another angle, and is left out."""
        is_again, detector = False, self._bench.detector
        while detector.is_reading():
            is_again |= detector.is_exposing()
            self._wait(READING_POLL_S)
        if is_again:
            return
        step, begun_s = turn.step, turn.begun_s
        number = self._there + len(turn.taken)

        def taken() -> Reading:
            reading = reading_of(step, number, begun_s, turn.angles_deg, detector.power_w())
            return turn.at_angle(reading, turn.rotation.angle_deg(step.target.slot, turn.middle_s(reading)), 0.0)

        reading = self._orders.judged(begun_s, taken)
        if reading is None:
            raise _BrokenOff
        turn.taken.append(reading)

    def _break_off(self) -> None:
        """Bring the analyzer to rest where it is, to be brought back."""
        analyzer = self._bench.analyzer
        analyzer.stop()
        require_rest(analyzer, self._clock, self._wait)
        self._end_reading()
        self._placement.ask_analyzer()

    def _end_reading(self) -> None:
        """Let a reading end that nobody wants."""
        detector = self._bench.detector
        while detector.is_exposing() or detector.is_reading():
            self._wait(READING_POLL_S)


@dataclass(frozen=True)
class _Fitting:
    """The detector, for exposures of which enough fit into a turn."""

    detector: TakesExposures
    rotation: Rotation

    def start_reading(self, exposure_s: float) -> None:
        """Begin a reading; raises LimitError for an exposure that is too long."""
        longest_s = self.rotation.turn_s / FEWEST_READINGS
        if exposure_s > longest_s:
            raise LimitError(
                "detector",
                f"an exposure of {exposure_s:g} s is more than a {FEWEST_READINGS}th of the {self.rotation.turn_s:g} s "
                "that the analyzer takes for a turn",
                not_done="the reading was not begun",
                to_do=f"choose at most {longest_s:g} s, or let the analyzer turn more slowly",
            )
        self.detector.start_reading(exposure_s)
