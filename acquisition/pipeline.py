"""What happens to readings on their way: collected to points, reduced, handed to the live fit, shown."""

from __future__ import annotations

from collections.abc import Sequence

from acquisition.averaged import Averaged
from acquisition.events import Event, NotReached, PointReduced, ReadingStored, ScanDoubted, ScanEnded, Subscriber
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
    """

    def __init__(
        self,
        reduction: Reduction,
        live_fit: LiveFit | None,
        subscribers: Sequence[Subscriber],
        averaged: Averaged | None = None,
    ) -> None:
        self._reduction, self._live_fit, self._subscribers = reduction, live_fit, subscribers
        self._averaged = averaged
        self._readings: list[Reading] = []
        self._of_points: dict[int, list[Reading]] = {}
        self._references: list[Reading] = []
        self._darks: dict[int, list[Reading]] = {}
        self.points: tuple[StokesPoint, ...] = ()

    def publish(self, event: Event) -> None:
        """Tell the subscribers, and keep what was read."""
        if self._live_fit is not None and (news := self._live_fit.news()) is not None:
            self._tell(news)
        if isinstance(event, ScanEnded):
            self._tell_doubts()
        self._tell(event)
        if isinstance(event, ReadingStored):
            self._readings.append(event.reading)
            self._of_points.setdefault(event.reading.point, []).append(event.reading)
            if event.reading.kind == "reference":
                self._references.append(event.reading)
            elif event.reading.kind == "dark":
                self._darks.setdefault(event.reading.point, []).append(event.reading)

    def _tell_doubts(self) -> None:
        try:
            doubts = self._reduction.warnings(self._readings, self.points)
        except ReductionError:
            return  # it has been raised when the point ended, and is why the scan ends
        if self._averaged is not None:
            doubts += self._averaged.doubts(self._readings, self.points)
        if doubts:
            self._tell(ScanDoubted(doubts))

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
        lamp = self._reduction.lamp_level(self._of_lamp())
        self._reduction.require_lamp(lamp, self._readings)
        return self._reduction.point(self._of_points[self._readings[-1].point], lamp)

    def end_point(self) -> None:
        """Reduce the direction of the last reading: it is complete, or the reference that closes the scan is.

        Others may have been begun before, and go on later.

        Raises
        ------
        ReductionError
            When its readings do not determine its Stokes parameters, or references show that nobody knows how bright
            the lamp was.
        """
        complete = self._of_points.pop(self._readings[-1].point)
        lamp = self._reduction.lamp_level(self._of_lamp())
        self._reduction.require_lamp(lamp, self._readings)
        if all(taken.kind == "reference" for taken in complete):
            return
        point = self._reduction.point(complete, lamp)
        self.points = (*self.points, point)
        self._tell(PointReduced(point))
        if self._averaged is not None and (what := self._averaged.shortfall(complete, point)):
            self._tell(NotReached(point.point, point.exit_deg, what))
        if self._live_fit is not None:
            self._live_fit.submit(self.points)

    def _of_lamp(self) -> list[Reading]:
        """What tells of the lamp: references, and the dark readings of their directions, as far as they are taken."""
        points = dict.fromkeys(reference.point for reference in self._references)
        return [*self._references, *(dark for point in points for dark in self._darks.get(point, ()))]
