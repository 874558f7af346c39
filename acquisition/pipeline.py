"""What happens to readings on their way: collected to points, reduced, handed to the live fit, shown."""

from __future__ import annotations

from collections.abc import Sequence

from acquisition.averaged import Averaged
from acquisition.doubts import in_break
from acquisition.events import (
    Event,
    NotReached,
    PointReduced,
    ReadingStored,
    ScanDoubted,
    ScanEnded,
    Subscriber,
    WentOn,
)
from acquisition.lamp_level import LampBreak, LampLevel
from acquisition.lamp_watch import LampWatch
from acquisition.live_fit import LiveFit
from acquisition.readings import Reading, StokesPoint
from acquisition.reduce import Reduction
from goniometer.errors import ReductionError


class Pipeline:
    """Passes events on to those who show them, and adds those of the reduction and of the live fit.

    Everything is called in the engine's thread; the live fit's news are picked up whenever an event passes.

    Parameters
    ----------
    reduction : Reduction
        Reduces a complete point.
    live_fit : LiveFit or None
        Where the points go.
    subscribers : sequence of callable
        Who is told.
    averaged : Averaged, optional
        Says whether readings have reached what they were to reach.
    is_repeated : bool
        Whether directions are measured several times, and all that is read of one is reduced together.
    """

    def __init__(
        self,
        reduction: Reduction,
        live_fit: LiveFit | None,
        subscribers: Sequence[Subscriber],
        averaged: Averaged | None = None,
        *,
        is_repeated: bool = False,
    ) -> None:
        self._reduction, self._live_fit, self._subscribers = reduction, live_fit, subscribers
        self._averaged = averaged
        self._averaged_readings: list[Reading] = []
        self._of_points: dict[int, list[Reading]] = {}
        self._lamp = LampWatch(forgets=not is_repeated)
        self._repeated: dict[int, list[Reading]] | None = {} if is_repeated else None
        self._last: Reading | None = None
        self._spoilt: tuple[str, ...] = ()
        self.points: list[StokesPoint] = []

    def publish(self, event: Event) -> None:
        """Tell the subscribers, and keep what was read."""
        if self._live_fit is not None and (news := self._live_fit.news()) is not None:
            self._tell(news)
        if isinstance(event, ScanEnded):
            self.tell_doubts()
        self._tell(event)
        if isinstance(event, WentOn) and event.suspended is not None:
            self._leave_spoilt_out(event.suspended)
        if isinstance(event, ReadingStored):
            self._last = event.reading
            self._of_points.setdefault(event.reading.point, []).append(event.reading)
            self._lamp.add(event.reading)
            if self._averaged is not None:
                self._averaged_readings.append(event.reading)

    def _leave_spoilt_out(self, interval: LampBreak) -> None:
        self._reduction = self._reduction.suspended(interval)
        spoilt = [one for one in self._lamp.in_question() if self._reduction.is_spoilt([one])]
        if spoilt:
            self._spoilt += (in_break(interval, spoilt),)
            self._forget({one.point for one in spoilt})

    def _forget(self, numbers: set[int]) -> None:
        known = [point for point in self.points if point.point not in numbers]
        if len(known) < len(self.points):
            self.points = known
            if self._live_fit is not None and known:
                self._live_fit.submit(known)

    def leave_out(self, point: int) -> None:
        """Make nothing of a direction that was skipped; raises ReductionError as `end_point` does for the lamp."""
        self._of_points.pop(point, None)
        self._forget({point})
        self._lamp_level()
        self._lamp.end_point(point)

    def tell_doubts(self) -> None:
        """Tell what a person should know of the light so far before believing in the points."""
        try:
            doubts = self._reduction.warnings(self._lamp.in_question(), self.points)
        except ReductionError:
            return  # it has been raised when the point ended, and is why the scan ends
        if self._averaged is not None:
            doubts += self._averaged.doubts(self._averaged_readings, self.points)
        if doubts := (*self._spoilt, *doubts):
            self._tell(ScanDoubted(doubts))

    def _with_repeats(self, complete: list[Reading]) -> list[Reading]:
        if self._repeated is None:
            return complete
        readings = self._repeated.setdefault(complete[0].point, [])
        readings += complete
        return readings

    def _lamp_level(self) -> LampLevel:
        lamp = self._reduction.lamp_level(self._lamp.of_lamp())
        self._reduction.require_lamp(lamp, self._lamp.in_question())
        return lamp

    def _tell(self, event: Event) -> None:
        for subscriber in self._subscribers:
            subscriber(event)

    def so_far(self) -> StokesPoint:
        """What the direction of the last reading reduces to as yet.

        Raises
        ------
        ReductionError
            As `end_point` does.
        """
        assert self._last is not None, "asked only behind a reading"
        return self._reduction.point(self._of_points[self._last.point], self._lamp_level())

    def end_point(self) -> None:
        """Reduce the direction of the last reading: it is complete, or the reference that closes the scan is.

        Others may have been begun before, and go on later. A direction that is measured again is reduced with all that
        was read there before; its point replaces the earlier one.

        Raises
        ------
        ReductionError
            When its readings do not determine its Stokes parameters, or references show that nobody knows how bright
            the lamp was.
        """
        assert self._last is not None, "a direction ends with a reading"
        complete = self._of_points.pop(self._last.point)
        lamp = self._lamp_level()
        self._lamp.end_point(self._last.point)
        if all(taken.kind == "reference" for taken in complete) or self._reduction.is_spoilt(complete):
            return
        readings = self._with_repeats(complete)
        point = self._reduction.point(readings, lamp)
        if len(readings) == len(complete):
            self.points.append(point)
        else:
            number = next(number for number, known in enumerate(self.points) if known.point == point.point)
            self.points[number] = point
        self._tell(PointReduced(point))
        if self._averaged is not None and (what := self._averaged.shortfall(complete, point)):
            self._tell(NotReached(point.point, point.exit_deg, what))
        if self._live_fit is not None:
            self._live_fit.submit(self.points)
