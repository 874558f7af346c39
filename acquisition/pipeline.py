"""What happens to readings on their way: collected to points, reduced, handed to the live fit, shown."""

from __future__ import annotations

from collections.abc import Sequence

from acquisition.events import Event, PointReduced, ReadingStored, Subscriber
from acquisition.live_fit import LiveFit
from acquisition.readings import Reading, StokesPoint
from acquisition.reduce import Reduction


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
    """

    def __init__(self, reduction: Reduction, live_fit: LiveFit | None, subscribers: Sequence[Subscriber]) -> None:
        self._reduction, self._live_fit, self._subscribers = reduction, live_fit, subscribers
        self._of_point: list[Reading] = []
        self._references: list[Reading] = []
        self.points: tuple[StokesPoint, ...] = ()

    def publish(self, event: Event) -> None:
        """Tell the subscribers, and keep what was read."""
        if self._live_fit is not None and (news := self._live_fit.news()) is not None:
            self._tell(news)
        self._tell(event)
        if isinstance(event, ReadingStored):
            self._of_point.append(event.reading)

    def _tell(self, event: Event) -> None:
        for subscriber in self._subscribers:
            subscriber(event)

    def end_point(self) -> None:
        """Reduce the readings since the last point: a direction is complete.

        Raises
        ------
        ReductionError
            When they do not determine its Stokes parameters.
        """
        complete, self._of_point = self._of_point, []
        if any(taken.kind == "reference" for taken in complete):
            self._references += [taken for taken in complete if taken.kind != "signal"]
        lamp = self._reduction.lamp_level(self._references)
        point = self._reduction.point(complete, lamp)
        self.points = (*self.points, point)
        self._tell(PointReduced(point))
        if self._live_fit is not None:
            self._live_fit.submit(self.points)
