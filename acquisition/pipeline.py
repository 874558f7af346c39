"""What happens to readings on their way: collected to points, reduced, handed to the live fit, shown."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from acquisition.events import Event, PointReduced, ReadingStored, Subscriber
from acquisition.expand import Step
from acquisition.live_fit import LiveFit
from acquisition.readings import Reading, StokesPoint
from acquisition.reduce import Reduction


class Pipeline:
    """Passes events on to those who show them, and adds those of the reduction and of the live fit.

    Everything is called in the engine's thread; the live fit's news are picked up whenever an event passes.

    Parameters
    ----------
    steps : sequence of Step
        The scan, from which follows when a point is complete.
    reduction : Reduction
        Reduces a complete point.
    live_fit : LiveFit or None
        Where the points go.
    subscribers : sequence of callable
        Who is told.
    """

    def __init__(
        self,
        steps: Sequence[Step],
        reduction: Reduction,
        live_fit: LiveFit | None,
        subscribers: Sequence[Subscriber],
    ) -> None:
        self._missing: Counter[int] = Counter()
        for step in steps:
            self._missing[step.point] += step.readings
        self._reduction, self._live_fit, self._subscribers = reduction, live_fit, subscribers
        self._of_point: list[Reading] = []
        self._references: list[Reading] = []
        self._points: list[StokesPoint] = []

    def publish(self, event: Event) -> None:
        """Tell the subscribers, then do what follows from the event."""
        if self._live_fit is not None and (news := self._live_fit.news()) is not None:
            self._tell(news)
        self._tell(event)
        if isinstance(event, ReadingStored):
            self._collect(event.reading)

    def _tell(self, event: Event) -> None:
        for subscriber in self._subscribers:
            subscriber(event)

    def _collect(self, reading: Reading) -> None:
        self._of_point.append(reading)
        self._missing[reading.point] -= 1
        if self._missing[reading.point]:
            return
        complete, self._of_point = self._of_point, []
        if any(taken.kind == "reference" for taken in complete):
            self._references += [taken for taken in complete if taken.kind != "signal"]
        lamp = self._reduction.lamp_level(self._references)
        point = self._reduction.point(complete, lamp)
        self._points.append(point)
        self._tell(PointReduced(point))
        if self._live_fit is not None:
            self._live_fit.submit(tuple(self._points))
