"""Runs steps on a bench: moves overlap, a lost link is taken up again, any way out stops the bench."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import Protocol

from acquisition.catching_up import CatchingUp
from acquisition.control import ScanControl
from acquisition.decisions import time_lost_key
from acquisition.earlier import Earlier
from acquisition.events import Event, LinkRestored, ReadingStored, StepStarted
from acquisition.expand import Step, Target
from acquisition.filters import Filters
from acquisition.imaging.frame_files import FrameFiles
from acquisition.journal import LINK_LOST, Journal
from acquisition.lost_links import LostLinks
from acquisition.orders import Orders
from acquisition.placement import Placement
from acquisition.protocols import Analyzer, Detector, HomingAxis
from acquisition.readings import Reading
from acquisition.readout import Readout
from acquisition.signal_to_noise import Enough, as_planned
from acquisition.stopping import stop_all
from acquisition.suspend import Judge
from acquisition.time_left import TimeLeft
from acquisition.timing import POLL_S
from acquisition.turn_readout import TurnReadout
from drivers.camera.frame import Frame
from drivers.clock import Clock
from drivers.interlock import Interlock
from drivers.motion import without_home
from goniometer.errors import DeviceFaultError

_SLICE_S = 0.1
"""Longest time between two checks for an interruption."""


@dataclass(frozen=True)
class Bench:
    """The devices of a goniometer, by their roles; `notes` are what they said on connecting.

    `polarizer` and `retarder` are the axes that turn a rotating analyzer, None where there is none; in a scan the
    analyzer moves them. `to_home` are the axes that every scan homes before it begins. `identities` are what devices
    say of themselves, with their serial numbers, where they have any. `position_retries` says by role how often an axis
    is sent again that has not come close enough to its target. `detector_azimuth` carries the detector arm out of the
    plane of incidence, None where nothing does. `generator` polarizes the light on the sample, None where it is
    unpolarized; `of_generator` are the axes that turn it. `filters` choose the wavelength, None where the light has one
    of its own.
    """

    source_arm: HomingAxis
    detector_arm: HomingAxis
    sample_azimuth: HomingAxis
    analyzer: Analyzer
    detector: Detector
    notes: tuple[str, ...] = ()
    interlock: Interlock | None = None
    polarizer: HomingAxis | None = None
    to_home: tuple[HomingAxis, ...] = ()
    retarder: HomingAxis | None = None
    identities: Mapping[str, str] = field(default_factory=dict)
    position_retries: Mapping[str, int] = field(default_factory=dict)
    detector_azimuth: HomingAxis | None = None
    generator: Analyzer | None = None
    of_generator: tuple[HomingAxis, ...] = ()
    filters: Filters | None = None

    @property
    def axes(self) -> dict[str, HomingAxis]:
        """The axes that bring the bench to a direction, by role."""
        axes = {
            "source_arm": self.source_arm,
            "detector_arm": self.detector_arm,
            "sample_azimuth": self.sample_azimuth,
        }
        return axes if self.detector_azimuth is None else {**axes, "detector_azimuth": self.detector_azimuth}

    @property
    def selectors(self) -> tuple[Analyzer, ...]:
        """What has numbered slots: the analyzer, and those of generator and filters that there are."""
        filters = None if self.filters is None else self.filters.wheel
        return tuple(device for device in (self.analyzer, self.generator, filters) if device is not None)

    def order(self, standing_deg: Mapping[str, float], targets_deg: Mapping[str, float]) -> tuple[tuple[str, ...], ...]:
        """The roles that move together, in turn; raises CollisionError when there is no safe way."""
        return (tuple(targets_deg),) if self.interlock is None else self.interlock.order(standing_deg, targets_deg)

    def stop(self, clock: Clock) -> list[BaseException]:
        """Stop everything that can move and see it come to rest, whatever fails on the way; returns what failed."""
        return list(stop_all([*self.axes.values(), *self.selectors], clock).values())


class Stoppable(Protocol):
    """What can be stopped as a whole."""

    def stop(self, clock: Clock) -> list[BaseException]:
        """Stop all that can move and see it come to rest; returns what failed."""
        ...


@contextmanager
def stopped_afterwards(bench: Stoppable, clock: Clock) -> Iterator[None]:
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
                "This went wrong, and not every device could be stopped", [error, *failures]
            ) from None
        raise
    if failures := bench.stop(clock):
        raise BaseExceptionGroup("Not every device could be stopped", failures)


class Engine:
    """Takes the readings of a scan, one direction after another, in one thread.

    A reading over which a link was lost is taken anew from its beginning, with the bench brought there again; what is
    stored stays, once.

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
    time_left : TimeLeft
        How long the rest of the scan takes.
    enough : callable
        Says when a step has its readings; without it, when it has as many as were planned.
    earlier : Earlier, optional
        What an earlier process has taken of the scan.
    control : ScanControl, optional
        What a person asks for while the scan runs.
    judge : Judge, optional
        Says which readings are in doubt, and to be taken again.

    Attributes
    ----------
    readings_taken : int
        How many readings are stored.
    """

    def __init__(
        self,
        bench: Bench,
        clock: Clock,
        journal: Journal,
        publish: Callable[[Event], None],
        check: Callable[[], None],
        time_left: TimeLeft,
        *,
        enough: Enough = as_planned,
        earlier: Earlier | None = None,
        control: ScanControl | None = None,
        judge: Judge | None = None,
    ) -> None:
        self._bench, self._clock, self._journal = bench, clock, journal
        self._publish, self._check, self._time_left = publish, check, time_left
        self._placement = Placement(bench, clock, self._wait)
        self._links = LostLinks(bench, clock, self._wait, self._begin_again)
        self._catching_up = CatchingUp(
            earlier or Earlier(),
            clock,
            check,
            come_by=self._come_by,
            arrive=self._arrive,
            take=self._take_besides,
            tell=self._tell,
            enough=enough,
            lose=lambda lost_s: journal.remember(time_lost_key(self.readings_taken), repr(lost_s)),
        )
        whole = control or ScanControl(), judge or Judge(), clock, journal, publish
        self._orders = Orders(*whole, self._placement, self._wait, time_left)
        taking = bench, clock, self._keep, self._placement, self._wait, self._orders
        self._standing, self._turning = Readout(*taking, enough), TurnReadout(*taking)
        self.readings_taken = 0

    def is_skipped(self, point: int) -> bool:
        """Whether a person had the rest of a direction left out."""
        return self._orders.is_skipped(point)

    def home(self) -> None:
        """Home the axes that the bench says, one after the other: on its way, nobody knows where an axis is.

        Then every axis is asked whether it knows its zero: one that seems to stand where it should is never moved, and
        so never asked again.

        Raises
        ------
        DeviceFaultError
            When an axis does not find its home position, or has none.
        NotConnectedError
            When a link is lost: a search for home is not begun again by itself.
        ScanInterrupted
            When `check` says so.
        """
        for axis in self._bench.to_home:
            self._check()
            axis.start_homing()
            self._wait(POLL_S)
            while axis.is_moving():
                self._wait(POLL_S)
            self._wait(axis.settle_s)
            if not axis.is_homed():
                raise DeviceFaultError(
                    axis.name,
                    "its controller says that the search for the home position has ended, and that it is not known",
                    not_done="the scan was not begun",
                    to_do="look at the stage, its home switch and its cable, then run the recipe again",
                )
        bench = self._bench
        for turned in (*bench.axes.values(), bench.polarizer, bench.retarder, *bench.of_generator):
            if turned is not None and not turned.is_homed():
                raise without_home(turned.name, "the scan was not begun")

    def run(self, steps: Sequence[Step], ahead: Target | None = None) -> None:
        """Run steps that are not there already; the caller stops the bench after the last ones (`stopped_afterwards`).

        Parameters
        ----------
        steps : sequence of Step
            What is to be done.
        ahead : Target, optional
            Where the scan goes on behind them: its axes are on their way there when this returns.

        Raises
        ------
        DeviceError
            When a device fails; the readings stored so far are safe.
        ScanInterrupted
            When `check` says so.
        """
        self._orders.begin()
        for planned, after in zip(steps, [*(step.target for step in steps[1:]), ahead], strict=True):
            if self._catching_up.passes_over(planned):
                continue
            step = self._orders.as_ordered(planned)
            if self._orders.leaves_out(step) and not self._catching_up.is_at_last:
                self._time_left.left_out(step.duration_s, step.readings)
                continue
            self._links.begin_step()
            there = self._catching_up.take_up(step)
            target = step.target
            self._orders.begin_step(step)
            self._publish(
                StepStarted(
                    step.point,
                    target.incidence_deg,
                    target.exit_deg,
                    target.azimuth_deg,
                    target.slot,
                    self.readings_taken,
                    self._time_left.left_s(),
                    self._time_left.elapsed_s(),
                    None if self._bench.detector_azimuth is None else target.exit_azimuth_deg,
                )
            )
            self._check()
            self._take(step, there, after)
            self._time_left.step_done(self._orders.as_ordered(planned).duration_s)
        self._orders.end_direction(steps[-1].point)
        if ahead is None and not self._catching_up.is_behind:
            self._links.begin_step()
            self._links.through(self._placement.require_still_there)

    def _readout(self, step: Step) -> Readout | TurnReadout:
        return self._standing if step.rotation is None else self._turning

    def _take(self, step: Step, there: Sequence[Reading], after: Target | None) -> None:
        """Take the readings of a step but for the first ones that are there."""
        readout = self._readout(step)
        readout.begin(there)
        while not (readout.has_all(step) or self._orders.leaves_out(step)):
            self._links.through(partial(readout.take, step, after))
            after = None  # a reading was in doubt: the bench stays until one is not

    def _take_besides(self, step: Step, after: Target | None) -> None:
        """Take the readings of a step whatever was skipped: it is not the plan that wants them."""
        readout = self._readout(step)
        readout.begin(())
        while not readout.has_all(step):
            self._links.through(partial(readout.take, step, after))
            after = None

    def _keep(self, reading: Reading, frames: Sequence[Frame]) -> None:
        if not self._catching_up.compares(reading):
            stored = self._frame_files.save(frames) if frames else ()
            self._journal.append(reading, stored, is_planned=self._catching_up.is_planned)
            self._orders.saw(reading)
            self._tell(reading)

    @cached_property
    def _frame_files(self) -> FrameFiles:
        return FrameFiles(self._journal.path.parent)

    def _tell(self, reading: Reading) -> None:
        self.readings_taken += 1
        self._publish(ReadingStored(reading))

    def _come_by(self, place: Target) -> None:
        def come() -> None:
            self._placement.arrive(place)
            self._placement.read_back(anew=True)

        self._links.through(come)

    def _arrive(self, place: Target) -> None:
        self._links.through(partial(self._placement.arrive, place))

    def _begin_again(self, restored: LinkRestored) -> None:
        self._placement.leave()
        note = f"after {self.readings_taken} readings: {restored}"
        before = sum(key.startswith(LINK_LOST) for key in self._journal.about())
        self._journal.remember(f"{LINK_LOST} {before + 1}", note)
        self._publish(restored)

    def _wait(self, duration_s: float) -> None:
        """Let time pass in slices, so that an interruption is noticed soon.

        What is left is counted down, not read off the clock: in virtual time another party may move the clock between
        two looks at it, and time stamps would depend on who came first.
        """
        self._check()
        while duration_s > 0.0:
            slice_s = min(duration_s, _SLICE_S)
            self._clock.sleep(slice_s)
            duration_s -= slice_s
            self._check()
