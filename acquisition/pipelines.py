"""What happens to the readings of several wavelengths: each has a pipeline of its own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from acquisition.events import Event, ReadingStored, ScanEnded, Subscriber, WavelengthChanged
from acquisition.pipeline import Pipeline
from acquisition.readings import StokesPoint


class Pipelines:
    """Does what `Pipeline` does, at the wavelength that is being measured.

    Parameters
    ----------
    at : mapping of float to Pipeline
        By wavelength in nm; each tells the same subscribers.
    truths : mapping of float to dict
        The parameters of a simulated sample at each wavelength.
    subscribers : sequence of callable
        Who is told that the wavelength changes.
    """

    def __init__(
        self,
        at: Mapping[float, Pipeline],
        truths: Mapping[float, dict[str, float]],
        subscribers: Sequence[Subscriber],
    ) -> None:
        self._at, self._truths, self._subscribers = at, truths, subscribers
        self._wavelength_nm: float | None = None
        self._now = next(iter(at.values()))

    @property
    def points(self) -> list[StokesPoint]:
        """The points of the wavelength that is being measured."""
        return self._now.points

    def publish(self, event: Event) -> None:
        """Tell the subscribers, and keep what was read."""
        if isinstance(event, ReadingStored) and event.reading.wavelength_nm != self._wavelength_nm:
            self._go_on_at(event.reading.wavelength_nm)
        if isinstance(event, ScanEnded):
            for pipeline in self._at.values():
                if pipeline is not self._now:
                    pipeline.tell_doubts()
        self._now.publish(event)

    def _go_on_at(self, wavelength_nm: float | None) -> None:
        assert wavelength_nm is not None, "every step of a scan at several wavelengths has one"
        self._wavelength_nm, self._now = wavelength_nm, self._at[wavelength_nm]
        for subscriber in self._subscribers:
            subscriber(WavelengthChanged(wavelength_nm, self._truths[wavelength_nm]))

    def leave_out(self, point: int) -> None:
        """Make nothing of a direction that was skipped; as `Pipeline.leave_out`."""
        self._now.leave_out(point)  # before its wavelength's first reading there is nothing to leave out

    def so_far(self) -> StokesPoint:
        """What the direction of the last reading reduces to as yet; as `Pipeline.so_far`."""
        return self._now.so_far()

    def end_point(self) -> None:
        """Reduce the direction of the last reading; as `Pipeline.end_point`."""
        self._now.end_point()
