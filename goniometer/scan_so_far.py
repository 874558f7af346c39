"""What the events of a scan add up to: where it stands, what it found last, how it ended."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

from acquisition.events import (
    DirectionChosen,
    Event,
    FitRefused,
    FitUpdated,
    Paused,
    PointReduced,
    ReadingStored,
    ScanDoubted,
    ScanEnded,
    ScanStarted,
    SpectrumFitted,
    StepStarted,
    WavelengthChanged,
    WentOn,
)
from acquisition.readings import StokesPoint
from goniometer.durations import clock_text


def in_plane(point: StokesPoint) -> str:
    """In which plane a point lies, for scans with several."""
    plane = f"incidence {point.incidence_deg:z6.2f}°  azimuth {point.azimuth_deg:z7.2f}°"
    return plane if point.exit_azimuth_deg is None else f"{plane}  exit azimuth {point.exit_azimuth_deg:z7.2f}°"


@dataclass
class ScanSoFar:
    """The newest event of each kind, and counts; a subscriber that costs about a microsecond an event.

    Parameters
    ----------
    now_s : callable
        Real time in seconds, from any origin.
    """

    now_s: Callable[[], float]
    started: ScanStarted | None = None
    step: StepStarted | None = None
    point: StokesPoint | None = None
    fit: FitUpdated | None = None
    refusal: FitRefused | None = None
    chosen: DirectionChosen | None = None
    ended: ScanEnded | None = None
    paused: Paused | None = None
    paused_s: float = 0.0
    doubts: tuple[str, ...] = ()
    wavelength_nm: float | None = None
    spectrum: SpectrumFitted | None = None
    readings: int = 0
    points_seen: set[int] = field(default_factory=set)
    start_s: float = 0.0
    step_s: float = 0.0

    def __call__(self, event: Event) -> None:
        """Take an event in."""
        match event:
            case ReadingStored():
                self.readings += 1
            case StepStarted():
                self.step, self.step_s = event, self.now_s()
            case PointReduced():
                self.point = event.stokes_point
                self.points_seen.add(event.stokes_point.point)
            case FitUpdated():
                self.fit, self.refusal = event, None
            case FitRefused():
                self.refusal = event
            case DirectionChosen():
                self.chosen = event
            case ScanStarted():
                self.started, self.start_s = event, self.now_s()
            case Paused():
                self.paused, self.paused_s = event, self.now_s()
            case WentOn():
                self.paused, self.step_s = None, self.step_s + self.now_s() - self.paused_s
                self.start_s += self.now_s() - self.paused_s
            case ScanDoubted():
                self.doubts += tuple(doubt for doubt in event.doubts if doubt not in self.doubts)
            case WavelengthChanged():
                self.wavelength_nm, self.fit, self.refusal = event.wavelength_nm, None, None
                if self.started is not None:
                    self.started = replace(self.started, truth=event.truth)
            case SpectrumFitted():
                self.spectrum = event
            case ScanEnded():
                self.ended = event

    @property
    def points(self) -> int:
        """How many directions have been reduced, each counted once however often it is measured."""
        return len(self.points_seen)

    def bench_elapsed_s(self) -> float:
        """How long the scan has taken up to its last step, on the bench's clock."""
        return 0.0 if self.step is None else self.step.elapsed_s

    def bench_speed(self) -> float | None:
        """Seconds of the bench in a real second, 1 on a real bench; None until it shows."""
        real_s = self.step_s - self.start_s
        done_s = self.bench_elapsed_s()
        return done_s / real_s if done_s > 0.0 and real_s > 0.0 else None

    def real_left_s(self) -> float | None:
        """How long the person in front of it still has to wait; None until that can be told."""
        speed = self.bench_speed()
        if self.step is None or speed is None:
            return None
        now_s = self.now_s() if self.paused is None else self.paused_s
        return max(self.step.time_left_s / speed - (now_s - self.step_s), 0.0)

    def ending(self) -> str:
        """How the scan ended, as one sentence, and then a line for each doubt about its light."""
        return "\n".join([self._ending(), *(f"warning: {doubt}." for doubt in self.doubts)])

    def _ending(self) -> str:
        if self.started is None:
            return "The scan did not begin."
        of_all = f" of {self.started.readings}" if self.started.readings else ""
        taken = f"{self.readings}{of_all} readings, {self.points} points"
        if self.ended is None:
            return f"{self.started.recipe}: cut short after {taken}."
        took = f"{clock_text(self.ended.bench_duration_s)} on the bench's clock"
        if self.ended.reason == "finished":
            return f"{self.started.recipe}: finished, {taken}, {took}."
        if self.ended.as_asked:
            return f"{self.started.recipe}: finished, {taken}, {took}. Reason: {self.ended.reason}."
        return f"{self.started.recipe}: ended early after {taken}, {took}. Reason: {self.ended.reason}"
