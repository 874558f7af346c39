"""The event stream: everything a person sees of a scan comes from here.

Events are plain frozen data. A reading's event is sent after its journal row is on disk, so what was shown is stored.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from acquisition.lamp_level import LampBreak
from acquisition.readings import Reading, StokesPoint
from model.fit import FitResult


@dataclass(frozen=True)
class ScanStarted:
    """The bench is ready and the first step is about to begin.

    `notes` are what devices said on connecting that a person should know, `truth` the parameters of a simulated sample.
    A scan that decides as it goes has an `aim`; then nobody knows the number of readings, nor, where a fit decides, of
    points, and `expected_duration_s` is the longest that it may take. `has_planes` says that directions differ in more
    than their exit angles.
    """

    run: str
    recipe: str
    points: int | None
    readings: int | None
    expected_duration_s: float
    truth: dict[str, float]
    notes: tuple[str, ...] = ()
    aim: str = ""
    has_planes: bool = False


@dataclass(frozen=True)
class StepStarted:
    """The bench goes to this place, in degrees and slot, or is on its way there.

    `exit_azimuth_deg` is None on a bench that cannot turn the detector arm out of the plane of incidence.
    `time_left_s` is left by the plan and by how long its steps have taken so far; `elapsed_s` have gone on the bench's
    clock.
    """

    point: int
    incidence_deg: float
    exit_deg: float
    azimuth_deg: float
    slot: int
    readings_done: int
    time_left_s: float
    elapsed_s: float = 0.0
    exit_azimuth_deg: float | None = None


@dataclass(frozen=True)
class ReadingStored:
    """A reading is on disk."""

    reading: Reading


@dataclass(frozen=True)
class LinkRestored:
    """A link was lost and is back; every device is as it was, and the reading that was under way is taken again.

    `device` is the one that lost it and `happened` what it said; `lost_at` the time of day, `away_s` how long it was
    away on the bench's clock, until every device had been checked; `notes` are what devices said on that.
    """

    device: str
    happened: str
    lost_at: str
    away_s: float
    notes: tuple[str, ...] = ()

    def __str__(self) -> str:
        said = "".join(f"; {note}" for note in self.notes)
        return (
            f"{self.device}: {self.happened} at {self.lost_at} and back after {self.away_s:.1f} s; all devices are as "
            f"they were, and what was under way is done again{said}"
        )


class Control:
    """What happens to a scan beside its plan; as text it says itself in words."""


@dataclass(frozen=True)
class Paused(Control):
    """The scan holds: all that was read without doubt is stored, no axis moves, links are kept alive. `why` says so."""

    why: str
    readings: int

    def __str__(self) -> str:
        return f"paused: {self.why}"


@dataclass(frozen=True)
class WentOn(Control):
    """The scan goes on after `held_s` on the bench's clock.

    `suspended` is the interval in which readings may be spoilt when the scan had paused by itself.
    """

    why: str
    held_s: float
    suspended: LampBreak | None = None

    def __str__(self) -> str:
        return f"goes on after {self.held_s:.1f} s: {self.why}"


@dataclass(frozen=True)
class Skipped(Control):
    """What remains of a direction is left out."""

    point: int
    exit_deg: float
    readings: int

    def __str__(self) -> str:
        return f"point {self.point} (exit {self.exit_deg:z.2f} degrees) is skipped: the rest of it is left out"


@dataclass(frozen=True)
class ExposureChanged(Control):
    """All readings from now on have another exposure."""

    exposure_s: float
    before_s: float
    readings: int

    def __str__(self) -> str:
        return f"exposure {self.exposure_s:g} s from now on, {self.before_s:g} s before"


@dataclass(frozen=True)
class RequestRefused(Control):
    """What a person asked for is not done, and the scan goes on as before."""

    why: str

    def __str__(self) -> str:
        return f"refused: {self.why}"


@dataclass(frozen=True)
class AxisSentAgain(Control):
    """An axis has not come close enough to its target: the reading there is not stored, and the axis is sent again."""

    axis: str
    position_deg: float
    target_deg: float
    time: int
    of: int

    def __str__(self) -> str:
        return (
            f"{self.axis}: stands at {self.position_deg:g} degrees after a move to {self.target_deg:g} degrees; it is "
            f"sent again ({self.time} of {self.of}), and the reading there is taken again"
        )


@dataclass(frozen=True)
class MapsMade(Control):
    """The pictures of a scan have become maps of so many of its directions; `notes` are what to know of them."""

    made: int
    of: int
    folder: str
    notes: tuple[str, ...] = ()

    def __str__(self) -> str:
        return "\n".join([f"maps of {self.made} of {self.of} directions are in {self.folder}", *self.notes])


@dataclass(frozen=True)
class PointReduced:
    """All readings of a direction are in and have been reduced."""

    stokes_point: StokesPoint


@dataclass(frozen=True)
class NotReached:
    """The readings of a direction have not reached what the recipe wants of them, for all that it allows."""

    point: int
    exit_deg: float
    what: str


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
class DirectionChosen:
    """A scan that decides as it goes has decided where to measure next, with so many readings in every slot.

    `why` says what speaks for it, `standing` how each standard error compares with the wanted one; empty if none is.
    """

    point: int
    exit_deg: float
    readings: int
    why: str
    standing: str


@dataclass(frozen=True)
class WavelengthChanged:
    """A scan at several wavelengths goes on at this one; `truth` are the parameters of a simulated sample there."""

    wavelength_nm: float
    truth: dict[str, float]


@dataclass(frozen=True)
class SpectrumFitted:
    """A scan at several wavelengths is over, and each has been fitted by itself: None where it could not be.

    `truths` are the parameters of a simulated sample at each.
    """

    wavelengths_nm: tuple[float, ...]
    results: tuple[FitResult | None, ...]
    truths: tuple[dict[str, float], ...]


@dataclass(frozen=True)
class ScanDoubted:
    """The scan is about to end, and a person should know this of its light before believing in its points."""

    doubts: tuple[str, ...]


@dataclass(frozen=True)
class ScanEnded:
    """The bench is safe. `reason` is ``"finished"``, or what ended the scan.

    `as_asked` says whether that is an end that the recipe asks for; otherwise it was an error, or a person.
    """

    reason: str
    readings: int
    bench_duration_s: float
    as_asked: bool


Event = (
    ScanStarted
    | StepStarted
    | ReadingStored
    | LinkRestored
    | Paused
    | WentOn
    | Skipped
    | ExposureChanged
    | RequestRefused
    | AxisSentAgain
    | MapsMade
    | PointReduced
    | NotReached
    | FitUpdated
    | FitRefused
    | DirectionChosen
    | WavelengthChanged
    | SpectrumFitted
    | ScanDoubted
    | ScanEnded
)
Subscriber = Callable[[Event], None]
