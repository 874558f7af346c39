"""What a scan is made of: places of the bench, and the readings taken there."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple, Self

from acquisition.analyzer_matrix import AnalyzerState
from acquisition.generator import GeneratorState
from acquisition.readings import ReadingKind

if TYPE_CHECKING:
    from acquisition.rotation import Rotation


@dataclass(frozen=True)
class Slots:
    """Which analyzer slot holds what; and in `generator` the same of the slots of the generator, None without one.

    `polarizers` are slots by the angle that a recipe names; `retarded` are those with a retarder, by number, with
    the angles that a recipe names. Beside them there are the blocked and the open slot. `filter_slot` is that of the
    filter wheel for all that is read, None where there is no such wheel.
    """

    polarizers: Mapping[float, int]
    offset_deg: float
    blocked: int | None
    open: int | None
    retarded: Mapping[int, AnalyzerState] = field(default_factory=dict)
    generator: Self | None = None
    filter_slot: int | None = None

    def signal(self, polarizer_deg: float, retarder_deg: float | None) -> tuple[int, AnalyzerState]:
        """The slot with these angles, and the analyzer's state there, from the s-direction."""
        if retarder_deg is None:
            return self.polarizers[polarizer_deg], AnalyzerState(polarizer_deg + self.offset_deg)
        named = (polarizer_deg, retarder_deg)
        slot, state = next(
            (slot, state) for slot, state in self.retarded.items() if (state.polarizer_deg, state.retarder_deg) == named
        )
        return slot, AnalyzerState(
            polarizer_deg + self.offset_deg, retarder_deg + self.offset_deg, state.retardance_deg
        )


class Target(NamedTuple):
    """Where the bench stands: angles in degrees and the slots of analyzer, generator and filters.

    `exit_azimuth_deg` is the detector arm's turn out of the plane of incidence, 0 on a bench that cannot turn it.
    `generator` is None without one, or where any of its slots will do.
    """

    incidence_deg: float
    exit_deg: float
    azimuth_deg: float
    slot: int
    exit_azimuth_deg: float = 0.0
    generator: int | None = None
    filter_slot: int | None = None

    @property
    def angles_deg(self) -> tuple[float, float, float, float]:
        """Where the axes stand, in the order of `axes_deg`."""
        return self.incidence_deg, self.exit_deg, self.azimuth_deg, self.exit_azimuth_deg

    @property
    def axes_deg(self) -> dict[str, float]:
        """Where the axes stand, by role; not every bench has the last one."""
        return {
            "source_arm": self.incidence_deg,
            "detector_arm": self.exit_deg,
            "sample_azimuth": self.azimuth_deg,
            "detector_azimuth": self.exit_azimuth_deg,
        }


HOME = Target(0.0, 0.0, 0.0, 1)
"""Where a bench is taken to stand before its first step."""


@dataclass(frozen=True, slots=True)
class Step:
    """One place of the bench and the readings taken there, `reading_s` each of the whole `duration_s`.

    Where the scan averages until something is reached, `readings` is the most of them. `first_repeat` is how often the
    slot was read in this direction before. `cycle` counts the repeats of all directions, from 0. `made` is what the
    light passes before the sample. Where the analyzer turns while it is read, as `rotation` says, a step is one turn,
    from the end of its way that is the target's slot.
    """

    point: int
    kind: ReadingKind
    target: Target
    analyzer_deg: float | None
    readings: int
    exposure_s: float
    duration_s: float
    retarder_deg: float | None = None
    retardance_deg: float | None = None
    reading_s: float = 0.0
    first_repeat: int = 0
    cycle: int = 0
    made: GeneratorState = GeneratorState()  # noqa: RUF009 (frozen)
    wavelength_nm: float | None = None
    rotation: Rotation | None = None

    @property
    def analyzer(self) -> AnalyzerState:
        """What the light passes."""
        return AnalyzerState(self.analyzer_deg, self.retarder_deg, self.retardance_deg)
