"""Carries out, between two readings, what a person or a reading in doubt asks of a scan."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Mapping
from dataclasses import replace

from acquisition.control import ScanControl
from acquisition.events import Event, ExposureChanged, Paused, RequestRefused, Skipped, WentOn
from acquisition.journal import Journal
from acquisition.lamp_level import LampBreak
from acquisition.placement import Placement
from acquisition.protocols import TakesExposures
from acquisition.readings import Reading
from acquisition.steps import Step
from acquisition.suspend import Doubt, Judge, SuspendedTooLongError, note, note_key, suspensions
from acquisition.time_left import TimeLeft
from drivers.clock import Clock
from goniometer.errors import LimitError, SaturatedError

_LOOK_S = 0.1
"""How often, in real time, a scan that holds looks whether it was asked to end."""

_ALIVE_S = 1.0
"""How often the axes are asked meanwhile where they are: links stay alive, and a hand at the bench is noticed."""

ORDERED = "orders"
"""Under which the journal keeps what is to be done otherwise than the plan says, as JSON."""


def skipped_points(about: Mapping[str, str]) -> tuple[int, ...]:
    """The directions that a person had skipped, as the journal of a scan remembers."""
    return tuple(json.loads(about.get(ORDERED, "{}")).get("skipped", ()))


class Orders:
    """What is to be done otherwise than the plan says.

    Parameters
    ----------
    control : ScanControl
        Where a person's requests come from.
    judge : Judge
        Says which readings are in doubt.
    clock, journal, publish, placement, wait, time_left
        As the engine has them.
    """

    def __init__(
        self,
        control: ScanControl,
        judge: Judge,
        clock: Clock,
        journal: Journal,
        publish: Callable[[Event], None],
        placement: Placement,
        wait: Callable[[float], None],
        time_left: TimeLeft,
    ) -> None:
        self._control, self._judge, self._clock = control, judge, clock
        self._journal, self._publish, self._placement = journal, publish, placement
        self._wait, self._time_left = wait, time_left
        self._exposure_s: float | None = None
        self._exposure_before_s: float | None = None
        self._left_out: set[int] = set()
        self._ended: set[int] = set()
        self._has_references = False
        self._before_step = 0
        self._doubt: Doubt | None = None
        self._suspended_s = 0.0
        self._notes = self._suspensions = self.readings_taken = 0
        self._has_begun = False

    def begin(self) -> None:
        """Go on, once, from what the journal of a scan says that was cut off; that of a new one says nothing."""
        if self._has_begun:
            return
        self._has_begun = True
        about = self._journal.about()
        self._notes = sum(key.startswith("control ") for key in about)
        earlier = suspensions(about)
        self._suspensions = len(earlier)
        if earlier and earlier[-1].end_s == math.inf:
            self._doubt, self._suspended_s = Doubt(earlier[-1].begin_s, earlier[-1].why), self._clock.now()
        ordered = json.loads(about.get(ORDERED, "{}"))
        self._left_out |= set(skipped_points(about))
        self._exposure_s = ordered.get("exposure_s")
        for reading in self._journal.readings():
            self.saw(reading)

    def saw(self, reading: Reading) -> None:
        """Take in a reading that is stored: it ends a suspension."""
        self.readings_taken += 1
        self._has_references |= reading.kind == "reference"
        self._judge.saw(reading)

    def leaves_out(self, step: Step) -> bool:
        """Whether a step is left out: its direction is skipped. A lamp that is followed needs dark readings still."""
        is_needed = step.kind == "reference" or (step.kind == "dark" and self._has_references)
        return step.point in self._left_out and not is_needed

    def begin_step(self, step: Step) -> None:
        """The bench is at a step, or on its way there."""
        self._control.at(step)
        self._before_step = self.readings_taken

    def end_direction(self, point: int) -> None:
        """All steps of a direction are done, or left out."""
        self._ended.add(point)

    def is_skipped(self, point: int) -> bool:
        """Whether a direction is not finished because it was skipped."""
        return point in self._left_out

    def as_ordered(self, step: Step) -> Step:
        """A step with the exposure that is wanted now."""
        if self._exposure_s is None or step.exposure_s == self._exposure_s:
            return step
        reading_s = self._time_left.reading_s
        longer_s = reading_s(self._exposure_s) - reading_s(step.exposure_s)
        return replace(
            step,
            exposure_s=self._exposure_s,
            duration_s=step.duration_s + step.readings * longer_s,
            reading_s=step.reading_s + longer_s,
        )

    @property
    def are_waiting(self) -> bool:
        """Whether the bench must not go on before `carry_out`."""
        return self._control.is_waiting or self._doubt is not None

    def carry_out(self, step: Step) -> None:
        """Do what is asked for, where the bench has arrived and no reading is being taken; may last."""
        self._take_wishes(step)
        if self._control.is_paused:
            self._hold(step)
        if self._doubt is not None:
            self._suspend(self._doubt)

    def start_reading(self, detector: TakesExposures, step: Step) -> Step:
        """Begin a reading; one whose exposure was changed to what the detector refuses, with the exposure before."""
        try:
            detector.start_reading(step.exposure_s)
        except LimitError as error:
            if self._exposure_s is None or self._exposure_before_s is None:
                raise
            refused_s, self._exposure_s = self._exposure_s, self._exposure_before_s
            self._exposure_before_s = None
            self._remember()
            self._change_plan(refused_s, self._exposure_s)
            self.tell(RequestRefused(str(error)))
            step = self.as_ordered(step)
            detector.start_reading(step.exposure_s)
        return step

    def judged(self, time_s: float, take: Callable[[], Reading]) -> Reading | None:
        """Finish a reading that began at this time; None when it is in doubt, and to be taken again.

        Raises
        ------
        SuspendedTooLongError
            When it has been in doubt for too long.
        """
        try:
            reading = take()
        except SaturatedError as error:
            if not self._judge.suspend.saturated:
                raise
            self._is_doubted(Doubt(time_s, f"{error.device}: {error.happened}"))
            return None
        doubt = self._judge.doubt(reading)
        if doubt is not None:
            self._is_doubted(doubt)
            return None
        if self._doubt is not None:
            self._end_suspension(reading.time_s)
        return reading

    def _take_wishes(self, step: Step) -> None:
        wishes = self._control.take()
        for refusal in wishes.refusals:
            self.tell(RequestRefused(refusal))
        if wishes.exposure_s is not None:
            before_s = step.exposure_s if self._exposure_s is None else self._exposure_s
            if wishes.exposure_s != before_s:
                self._exposure_before_s, self._exposure_s = before_s, wishes.exposure_s
                self._remember()
                self._change_plan(before_s, wishes.exposure_s)
                self.tell(ExposureChanged(wishes.exposure_s, before_s, self.readings_taken))
        if wishes.skip is not None:
            self._skip(wishes.skip)

    def _skip(self, step: Step) -> None:
        if step.kind == "reference":
            self.tell(RequestRefused("a reference reading belongs to no direction, and is not skipped"))
        elif step.point in self._ended:
            self.tell(RequestRefused(f"nothing was left of point {step.point}"))
        elif step.point not in self._left_out:
            self._left_out.add(step.point)
            self._remember()
            self.tell(Skipped(step.point, step.target.exit_deg, self.readings_taken))

    def _hold(self, step: Step) -> None:
        """Hold with all axes at rest until a person lets the scan go on."""
        self._placement.read_back(anew=True)
        begun_s = self._clock.now()
        self.tell(Paused("a person's request", self.readings_taken))
        asked_s = time.monotonic()
        while self._control.is_paused:
            self._wait(0.0)
            self._control.wait(_LOOK_S)
            if self._control.is_waiting:
                self._take_wishes(step)
            if time.monotonic() - asked_s >= _ALIVE_S:
                self._placement.require_still_there()
                asked_s = time.monotonic()
        self._take_wishes(step)
        self._placement.require_still_there()
        held_s = self._clock.now() - begun_s
        self._time_left.held(held_s)
        self.tell(WentOn("a person's request", held_s))

    def _is_doubted(self, doubt: Doubt) -> None:
        if self._doubt is None:
            self._doubt, self._suspended_s = doubt, self._clock.now()
            self._suspensions += 1
            self._remember_suspension(math.inf)
            self._control.asks_test()  # what was asked before is no answer to this
            self.tell(Paused(f"{doubt.why}; the reading is not stored, and will be taken again", self.readings_taken))
            return
        self._doubt = replace(doubt, since_s=self._doubt.since_s)
        waited_s = self._clock.now() - self._suspended_s
        if waited_s >= self._judge.suspend.for_at_most_s:
            raise SuspendedTooLongError(doubt.why, waited_s)

    def _suspend(self, doubt: Doubt) -> None:
        """Hold, with all axes at rest, until the reading in doubt is to be taken again."""
        self._placement.read_back(anew=True)
        left_s = self._judge.suspend.every_s
        while left_s > 0.0 and not self._control.asks_test():
            slice_s = min(left_s, _ALIVE_S)
            self._wait(slice_s)
            left_s -= slice_s
            self._placement.require_still_there()

    def _end_suspension(self, end_s: float) -> None:
        assert self._doubt is not None, "asked only of a suspended scan"
        why, held_s = self._doubt.why, self._clock.now() - self._suspended_s
        interval = self._remember_suspension(end_s)
        self._doubt = None
        self._time_left.held(held_s)
        self.tell(WentOn(f"it is over: {why}", held_s, interval))

    def _remember_suspension(self, end_s: float) -> LampBreak:
        assert self._doubt is not None, "asked only of a suspended scan"
        interval = LampBreak(self._doubt.since_s, end_s, self._doubt.why)
        self._journal.remember(note_key(self._suspensions), note(interval))
        return interval

    def _change_plan(self, before_s: float, exposure_s: float) -> None:
        in_step = self.readings_taken - self._before_step
        self._time_left.exposure_changed(before_s, exposure_s, self.readings_taken, in_step)

    def _remember(self) -> None:
        ordered = {"skipped": sorted(self._left_out), "exposure_s": self._exposure_s}
        self._journal.remember(ORDERED, json.dumps(ordered))

    def tell(self, event: Event) -> None:
        """Note in the journal what has happened beside the plan, and tell of it."""
        self._notes += 1
        self._journal.remember(f"control {self._notes}", f"after {self.readings_taken} readings: {event}")
        self._publish(event)
