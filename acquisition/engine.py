"""Runs steps on a bench: moves overlap, every wait can be interrupted, any way out stops the bench."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

from acquisition.events import Event, ReadingStored, StepStarted
from acquisition.expand import Step
from acquisition.journal import Journal
from acquisition.protocols import Analyzer, Detector, HomingAxis, RotaryAxis
from acquisition.readings import Reading
from acquisition.stopping import stop_all
from acquisition.timing import POLL_S, READING_POLL_S
from drivers.clock import Clock
from drivers.interlock import Interlock
from goniometer.errors import DeviceFaultError, PositionError

_SLICE_S = 0.1
"""Longest time between two checks for an interruption."""


@dataclass(frozen=True)
class Bench:
    """The devices of a goniometer, by their roles; `notes` are what they said on connecting.

    `polarizer` is the axis that turns a rotating analyzer, None for other analyzers; in a scan the analyzer moves it.
    `to_home` are the axes that every scan homes before it begins.
    """

    source_arm: RotaryAxis
    detector_arm: RotaryAxis
    sample_azimuth: RotaryAxis
    analyzer: Analyzer
    detector: Detector
    notes: tuple[str, ...] = ()
    interlock: Interlock | None = None
    polarizer: RotaryAxis | None = None
    to_home: tuple[HomingAxis, ...] = ()

    @property
    def axes(self) -> dict[str, RotaryAxis]:
        """The axes by role."""
        return {
            "source_arm": self.source_arm,
            "detector_arm": self.detector_arm,
            "sample_azimuth": self.sample_azimuth,
        }

    def order(self, targets_deg: Mapping[str, float]) -> tuple[tuple[str, ...], ...]:
        """The roles that move together, in turn; raises CollisionError when there is no safe way."""
        return (tuple(targets_deg),) if self.interlock is None else self.interlock.order(targets_deg)

    def stop(self, clock: Clock) -> list[BaseException]:
        """Stop everything that can move and see it come to rest, whatever fails on the way; returns what failed."""
        return stop_all(list(self.axes.values()), self.analyzer, clock)


@contextmanager
def stopped_afterwards(bench: Bench, clock: Clock) -> Iterator[None]:
    """Stop the bench on every way out of the block.

    Raises
    ------
    BaseExceptionGroup
        When a device could not be stopped: that outranks, and carries, the error that ended the block.
    """
    try:
        yield
    except BaseException as error:
        if failures := bench.stop(clock):
            raise BaseExceptionGroup(
                "The scan failed and not every device could be stopped", [error, *failures]
            ) from None
        raise
    if failures := bench.stop(clock):
        raise BaseExceptionGroup("Not every device could be stopped", failures)


class Engine:
    """Takes the readings of a scan, one direction after another, in one thread.

    Parameters
    ----------
    bench : Bench
        The devices, connected.
    clock : Clock
        The bench's clock; everything waits on it.
    journal : Journal
        Where each reading is stored before anybody hears of it.
    publish : callable
        Called with each event.
    check : callable
        Called between any two waits; raises to end the scan.
    duration_s : float
        How long the whole scan may take, from which the time left is counted down.
    """

    def __init__(
        self,
        bench: Bench,
        clock: Clock,
        journal: Journal,
        publish: Callable[[Event], None],
        check: Callable[[], None],
        duration_s: float,
    ) -> None:
        self._bench, self._clock, self._journal = bench, clock, journal
        self._publish, self._check, self._time_left_s = publish, check, duration_s
        self._left_deg: dict[str, float] = {}
        self.readings_taken = 0

    def home(self) -> None:
        """Home the axes that the bench says, one after the other: on its way, nobody knows where an axis is.

        Raises
        ------
        DeviceFaultError
            When an axis does not find its home position.
        ScanInterrupted
            When `check` says so.
        """
        for axis in self._bench.to_home:
            self._check()
            axis.start_homing()
            self._until_at_rest([axis], [axis])
            self._wait(axis.settle_s)
            if not axis.is_homed():
                raise DeviceFaultError(
                    axis.name,
                    "its controller says that the search for the home position has ended, and that it is not known",
                    not_done="the scan was not begun",
                    to_do="look at the stage, its home switch and its cable, then run the recipe again",
                )

    def run(self, steps: Sequence[Step]) -> None:
        """Run steps; the caller stops the bench after the last ones (`stopped_afterwards`).

        Raises
        ------
        DeviceError
            When a device fails; the readings stored so far are safe.
        ScanInterrupted
            When `check` says so.
        """
        for step in steps:
            target = step.target
            self._publish(
                StepStarted(
                    step.point,
                    target.incidence_deg,
                    target.exit_deg,
                    target.azimuth_deg,
                    target.slot,
                    self.readings_taken,
                    self._time_left_s,
                )
            )
            self._move(step)
            positions_deg = self._read_back(step)
            self._check_slot(step)
            for repeat in range(step.readings):
                self._take_reading(step, repeat, positions_deg)
            self._time_left_s -= step.duration_s
        self._require_still_there()

    def _move(self, step: Step) -> None:
        """Start every motion that the step needs, then wait until all have ended and settled."""
        self._check()
        axes, analyzer = self._bench.axes, self._bench.analyzer
        here_deg = self._require_still_there()
        targets_deg = {
            role: angle_deg
            for role, angle_deg in step.target.axes_deg.items()
            if abs(here_deg[role] - angle_deg) > axes[role].tolerance_deg
        }
        turns = analyzer.slot() != step.target.slot
        settles_s = [axes[role].settle_s for role in targets_deg] + [analyzer.settle_s] * turns
        moving: list[RotaryAxis | Analyzer] = []
        if turns:
            analyzer.start_select(step.target.slot)
            moving.append(analyzer)
        for together in self._bench.order(targets_deg):
            for role in together:
                axes[role].start_move(targets_deg[role])
            arms = [axes[role] for role in together]
            moving = self._until_at_rest([*arms, *moving], arms)
        self._until_at_rest(moving, moving)
        if settles_s:
            self._wait(max(settles_s))

    def _until_at_rest(
        self, moving: list[RotaryAxis | Analyzer], needed: Sequence[RotaryAxis | Analyzer]
    ) -> list[RotaryAxis | Analyzer]:
        """Wait until the needed devices have arrived; returns the others that still move."""
        while any(device in moving for device in needed):
            self._wait(POLL_S)
            moving = [device for device in moving if device.is_moving()]
        return moving

    def _require_still_there(self) -> dict[str, float]:
        """Where the axes are; raises PositionError when one is not where it was left.

        A controller that was reset counts from where it stands: a move from there would lead anywhere.
        """
        positions_deg = {role: axis.position_deg() for role, axis in self._bench.axes.items()}
        for role, left_deg in self._left_deg.items():
            axis = self._bench.axes[role]
            if abs(positions_deg[role] - left_deg) > axis.tolerance_deg:
                raise PositionError(
                    axis.name,
                    f"stands at {positions_deg[role]:g} degrees although it was left at {left_deg:g} degrees: it was "
                    "moved by hand, or its controller was reset and counts from another zero",
                    not_done="nothing was moved; the last readings in the journal may have been taken elsewhere",
                    to_do="look where it truly stands, home it, then run the recipe again",
                )
        return positions_deg

    def _read_back(self, step: Step) -> list[float]:
        positions_deg = []
        for role, target_deg in step.target.axes_deg.items():
            axis = self._bench.axes[role]
            position_deg = axis.position_deg()
            if abs(position_deg - target_deg) > axis.tolerance_deg:
                raise PositionError(
                    axis.name,
                    f"stands at {position_deg:g} degrees after a move to {target_deg:g} degrees "
                    f"(tolerance {axis.tolerance_deg:g} degrees)",
                    not_done="the readings there",
                    to_do="check that nothing touches the stage, home it, then run the recipe again",
                )
            positions_deg.append(position_deg)
        self._left_deg = step.target.axes_deg
        return positions_deg

    def _check_slot(self, step: Step) -> None:
        """Ask before and after every reading: a wheel can be turned by hand."""
        slot = self._bench.analyzer.slot()
        if slot != step.target.slot:
            raise PositionError(
                self._bench.analyzer.name,
                f"{'no slot' if slot is None else f'slot {slot}'} is in the beam instead of slot {step.target.slot}",
                not_done="no reading was stored that this may have spoilt",
                to_do="check that nothing holds the analyzer and that nobody turned it by hand, then run the recipe "
                "again",
            )

    def _take_reading(self, step: Step, repeat: int, positions_deg: list[float]) -> None:
        detector = self._bench.detector
        time_s = self._clock.now()
        detector.start_reading(step.exposure_s)
        self._wait(READING_POLL_S)
        while detector.is_reading():
            self._wait(READING_POLL_S)
        power_w = detector.power_w()
        self._check_slot(step)
        incidence_deg, exit_deg, azimuth_deg = positions_deg
        reading = Reading(
            point=step.point,
            kind=step.kind,
            repeat=repeat,
            time_s=time_s,
            incidence_deg=incidence_deg,
            exit_deg=exit_deg,
            azimuth_deg=azimuth_deg,
            slot=step.target.slot,
            analyzer_deg=step.analyzer_deg,
            exposure_s=step.exposure_s,
            power_w=power_w,
        )
        self._journal.append(reading)
        self.readings_taken += 1
        self._publish(ReadingStored(reading))

    def _wait(self, duration_s: float) -> None:
        """Let time pass in slices, so that an interruption is noticed soon.

        What is left is counted down, not read off the clock: in virtual time another party may move the clock between
        two looks at it, and time stamps would depend on who came first.
        """
        while duration_s > 0.0:
            self._check()
            slice_s = min(duration_s, _SLICE_S)
            self._clock.sleep(slice_s)
            duration_s -= slice_s
