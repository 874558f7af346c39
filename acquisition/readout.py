"""Takes the readings of a step, and lets nothing wait that need not.

While light is collected, the axes are asked where they stand, and the reading before is confirmed and stored. The bench
leaves as soon as the last reading of a step has all its light; that one is confirmed and stored on the way.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from acquisition.expand import Step, Target
from acquisition.orders import Orders
from acquisition.placement import Astray, Placement
from acquisition.protocols import TakesFrames
from acquisition.readings import Reading
from acquisition.signal_to_noise import Enough, as_planned
from acquisition.timing import DUE_POLL_S, READING_POLL_S
from drivers.camera.frame import Frame
from drivers.clock import Clock

if TYPE_CHECKING:
    from acquisition.engine import Bench

_LOOK_S = 0.06
"""How long before the end of an exposure the axes are asked where they are, so that it still holds behind it."""

_INSTANT_S = 1e-6
"""So short that it may be lost in the rounding of a clock, which then stands still."""

_OVERDUE_S = 0.02
"""How long after its exposure a reading is asked for in quick succession."""


class Readout:
    """Takes, confirms and stores readings.

    Parameters
    ----------
    bench : Bench
        The devices.
    clock : Clock
        The bench's clock.
    keep : callable
        Called with each reading that is confirmed, and its pictures, to store them.
    placement : Placement
        Brings the bench where a step wants it.
    wait : callable
        Lets time pass; raises to end the scan.
    orders : Orders
        What a person, or a reading in doubt, asks for between two readings.
    enough : callable
        Says when a step has its readings.
    """

    def __init__(
        self,
        bench: Bench,
        clock: Clock,
        keep: Callable[[Reading, Sequence[Frame]], None],
        placement: Placement,
        wait: Callable[[float], None],
        orders: Orders,
        enough: Enough = as_planned,
    ) -> None:
        self._detector, self._clock, self._keep_reading = bench.detector, clock, keep
        self._placement, self._wait, self._enough = placement, wait, enough
        self._orders = orders
        self._powers_w: list[float] = []

    def begin(self, there: Sequence[Reading]) -> None:
        """Begin a step, of which these readings are there already."""
        self._powers_w = [reading.power_w for reading in there]

    def has_all(self, step: Step) -> bool:
        """Whether a step has its readings."""
        return self._enough(step, self._powers_w)

    def take(self, step: Step, after: Target | None) -> None:
        """Take the readings that a step still wants, where it wants them.

        Returns without all of them when one is to be taken again, or the rest is left out.

        Parameters
        ----------
        step : Step
            What is wanted.
        after : Target or None
            Where to leave for as soon as the last one has its light; None: nowhere.

        Raises
        ------
        DeviceError
            When a device fails; the readings stored so far are safe.
        ScanInterrupted
            When waiting says so.
        """
        if self.has_all(step):
            return  # the link was lost behind the last reading
        try:
            self._take(step, after)
        except Astray as astray:
            self._orders.tell(astray.event)  # it is on its way again with the next attempt

    def _take(self, step: Step, after: Target | None) -> None:
        self._placement.arrive(step.target)
        taken: _Taken | None = None
        for repeat in range(len(self._powers_w), step.readings):
            if self._orders.are_waiting:
                if taken is not None:
                    self._keep(step, taken)
                    taken = None
                self._orders.carry_out(step)
                if self._orders.leaves_out(step):
                    return
            time_s = self._clock.now()
            step = self._orders.start_reading(self._detector, self._orders.as_ordered(step))
            if taken is not None:
                self._keep(step, taken)
            is_last = repeat == step.readings - 1
            angles_deg = self._expose(time_s, step.exposure_s, anew=is_last)
            leaves = after is not None and is_last and not self._orders.are_waiting
            failure = self._placement.departure(after) if leaves and after is not None else None
            if self._is_taken_again() and leaves:
                return
            taken = self._judged(step, repeat, time_s, angles_deg)
            is_enough = taken is not None and self._enough(step, [*self._powers_w, taken.reading.power_w])
            if is_enough and not is_last and after is not None and not self._orders.are_waiting:
                leaves = True
                failure = self._placement.departure(after)
            if failure is not None:
                if taken is not None:
                    self._keep(step, taken)
                raise failure
            if taken is None:
                return
            if is_enough:
                break
        if taken is not None:
            self._keep(step, taken)
        if not leaves and self._orders.are_waiting:
            self._orders.carry_out(step)

    def _expose(self, begun_s: float, exposure_s: float, *, anew: bool) -> tuple[float, ...]:
        """Wait until a reading has its light; returns where the axes are meanwhile, or were a moment before."""
        detector, angles_deg = self._detector, None
        left_s = exposure_s
        while angles_deg is None or detector.is_exposing():
            if angles_deg is None and left_s <= _LOOK_S:
                try:
                    angles_deg = self._placement.read_back(anew=anew)
                except Astray:
                    self._end_reading()
                    raise
            elif left_s > _INSTANT_S:
                self._wait(min(left_s, READING_POLL_S))
            else:
                self._wait(DUE_POLL_S if left_s > -_OVERDUE_S else READING_POLL_S)
            left_s = begun_s + exposure_s - self._clock.now()
        return angles_deg

    def _end_reading(self) -> None:
        """Let a reading end that nobody wants."""
        while self._detector.is_exposing() or self._detector.is_reading():
            self._wait(READING_POLL_S)

    def _judged(self, step: Step, repeat: int, time_s: float, angles_deg: tuple[float, ...]) -> _Taken | None:
        taken, detector = (step, repeat, time_s, angles_deg), self._detector
        reading = self._orders.judged(time_s, lambda: reading_of(*taken, detector.power_w()))
        if reading is None:
            return None
        if isinstance(detector, TakesFrames):
            return _Taken(replace(reading, exposure_s=detector.used_s), detector.frames())
        return _Taken(reading)

    def _is_taken_again(self) -> bool:
        """Wait for the reading to come and be confirmed; True when the detector had to take it again."""
        is_again = False
        while self._detector.is_reading():
            is_again |= self._detector.is_exposing()
            self._wait(READING_POLL_S)
        return is_again

    def _keep(self, step: Step, taken: _Taken) -> None:
        """Keep a reading, unless analyzer, generator or filters have left their slots."""
        self._placement.require_slots(step.target)
        self._keep_reading(taken.reading, taken.frames)
        self._powers_w.append(taken.reading.power_w)


@dataclass(frozen=True)
class _Taken:
    """A finished reading, and its pictures if the detector takes any."""

    reading: Reading
    frames: tuple[Frame, ...] = ()


def reading_of(step: Step, repeat: int, time_s: float, angles_deg: tuple[float, ...], power_w: float) -> Reading:
    """A reading of a step, with the angles at which the axes stood."""
    incidence_deg, exit_deg, azimuth_deg, *out_of_plane = angles_deg
    return Reading(
        point=step.point,
        kind=step.kind,
        repeat=step.first_repeat + repeat,
        time_s=time_s,
        incidence_deg=incidence_deg,
        exit_deg=exit_deg,
        azimuth_deg=azimuth_deg,
        slot=step.target.slot,
        analyzer_deg=step.analyzer_deg,
        exposure_s=step.exposure_s,
        power_w=power_w,
        retarder_deg=step.retarder_deg,
        retardance_deg=step.retardance_deg,
        exit_azimuth_deg=out_of_plane[0] if out_of_plane else None,
        generator_slot=step.target.generator,
        generator_deg=step.made.polarizer_deg,
        generator_retarder_deg=step.made.retarder_deg,
        generator_retardance_deg=step.made.retardance_deg,
        wavelength_nm=step.wavelength_nm,
    )
