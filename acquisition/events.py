"""The event stream: everything a person sees of a scan comes from here.

Events are plain frozen data. A reading's event is sent after its journal row is on disk, so what was shown is stored.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from acquisition.readings import Reading, StokesPoint
from model.fit import FitResult


@dataclass(frozen=True)
class ScanStarted:
    """The bench is ready and the first step is about to begin.

    `notes` are what devices said on connecting that a person should know, `truth` the parameters of a simulated sample.
    """

    run: str
    recipe: str
    points: int
    readings: int
    expected_duration_s: float
    truth: dict[str, float]
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class StepStarted:
    """The bench is about to move; angles in degrees."""

    point: int
    incidence_deg: float
    exit_deg: float
    azimuth_deg: float
    slot: int
    readings_done: int
    time_left_s: float


@dataclass(frozen=True)
class ReadingStored:
    """A reading is on disk."""

    reading: Reading


@dataclass(frozen=True)
class PointReduced:
    """All readings of a direction are in and have been reduced."""

    stokes_point: StokesPoint


@dataclass(frozen=True)
class FitUpdated:
    """The live fit has taken in all points up to `points`."""

    points: int
    result: FitResult


@dataclass(frozen=True)
class FitRefused:
    """The live fit cannot say anything from the points up to `points`; the scan goes on."""

    points: int
    reason: str


@dataclass(frozen=True)
class ScanEnded:
    """The bench is safe. `reason` is ``"finished"``, or what ended the scan early."""

    reason: str
    readings: int
    bench_duration_s: float


Event = ScanStarted | StepStarted | ReadingStored | PointReduced | FitUpdated | FitRefused | ScanEnded
Subscriber = Callable[[Event], None]
