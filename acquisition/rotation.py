"""An analyzer that turns at a constant speed while it is read: whole turns, forwards and backwards in turn.

Every turn has so many readings, evenly spread over 360 degrees; a polarizer or retarder with a wedge, whose beam
wanders once in a turn, then spoils no Stokes parameter. What the clocks of detector and rotator differ by shifts all
angles of a turn forwards in one sense and of the next, backwards, in the other, and so cancels to first order.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

from pydantic import Field

from acquisition.analyzer_matrix import AnalyzerState
from acquisition.section import Section, SectionFault
from acquisition.timing import CONFIRM_S, AnalyzerTiming, AxisTiming, BenchTiming

if TYPE_CHECKING:
    from acquisition.recipe import Recipe
    from acquisition.steps import Step

TURN_DEG = 360.0

FEWEST_READINGS = 12
"""In a turn: behind a retarder the light has harmonics up to the fourth, which nine could just tell apart."""

FORWARDS, BACKWARDS = 1, 2
"""The ends of the way, as slots: in which one the analyzer stands before a turn."""

STEADY_S = 0.1
"""How long the analyzer turns at its full speed before and behind the turn that is read, for what is late."""


class AnalyzerRotation(Section):
    """An analyzer that is read while it turns."""

    turns: int = Field(
        ge=2,
        le=1000,
        description="number of whole turns at every direction, forwards and backwards in turn: an even number",
    )


@dataclass(frozen=True)
class Rotation:
    """How the analyzer of a rig turns; angles in degrees.

    Parameters
    ----------
    element : "polarizer" or "retarder"
        What turns.
    axis : AxisTiming
        Its speed and acceleration.
    fixed : AnalyzerState
        The analyzer with what turns at 0, as the rig file names its angles.
    offset_deg : float
        Added to the angles of polarizer and retarder: the analyzer's zero, from the s-direction.
    """

    element: Literal["polarizer", "retarder"]
    axis: AxisTiming
    fixed: AnalyzerState
    offset_deg: float = 0.0

    @property
    def end_deg(self) -> float:
        """Where the analyzer stands before and behind a turn, above and below 0."""
        speed_deg_s = self.axis.velocity_deg_s
        return TURN_DEG / 2 + speed_deg_s**2 / (2 * self.axis.acceleration_deg_s2) + STEADY_S * speed_deg_s

    @property
    def ends_deg(self) -> dict[int, float]:
        """The same as slots."""
        return {FORWARDS: -self.end_deg, BACKWARDS: self.end_deg}

    @property
    def turn_s(self) -> float:
        """Duration of a turn."""
        return TURN_DEG / self.axis.velocity_deg_s

    @property
    def begin_s(self) -> float:
        """How long after the analyzer was sent the turn begins."""
        return self.axis.velocity_deg_s / self.axis.acceleration_deg_s2 + STEADY_S

    def spacing_s(self, readings: int) -> float:
        """From the beginning of one reading of a turn to the next."""
        return self.turn_s / readings

    def angle_deg(self, slot: int, since_s: float) -> float:
        """Where what turns should be, so long after the turn has begun."""
        way_deg = self.axis.velocity_deg_s * since_s - TURN_DEG / 2
        return way_deg if slot == FORWARDS else -way_deg

    def state(self, angle_deg: float, sweep_deg: float) -> AnalyzerState:
        """The analyzer, from the s-direction, in a reading at whose middle what turns was at this angle."""
        fixed, offset_deg = self.fixed, self.offset_deg
        polarizer_deg, retarder_deg = fixed.polarizer_deg, fixed.retarder_deg
        assert polarizer_deg is not None, "a rotating analyzer has a polarizer"
        turned = replace(
            fixed,
            polarizer_deg=polarizer_deg + offset_deg,
            retarder_deg=None if retarder_deg is None else retarder_deg + offset_deg,
        )
        if self.element == "polarizer":
            return replace(turned, polarizer_deg=angle_deg + offset_deg, polarizer_sweep_deg=sweep_deg)
        return replace(turned, retarder_deg=angle_deg + offset_deg, retarder_sweep_deg=sweep_deg)

    def states(self, readings: int, exposure_s: float) -> tuple[AnalyzerState, ...]:
        """What is planned for the readings of a turn forwards."""
        sweep_deg, spacing_s = self.axis.velocity_deg_s * exposure_s, self.spacing_s(readings)
        return tuple(
            self.state(self.angle_deg(FORWARDS, number * spacing_s + exposure_s / 2), sweep_deg)
            for number in range(readings)
        )


@dataclass(frozen=True)
class EndTiming:
    """From the end of one turn to the beginning of the next, which is where the analyzer goes in any case."""

    rotation: Rotation
    rest_s: float = 0.0
    """Of the turn, behind the last reading in it."""

    @property
    def settle_s(self) -> float:
        """Time to come to rest."""
        return self.rotation.axis.settle_s

    @property
    def exchange_s(self) -> float:
        """Time to ask where it is."""
        return self.rotation.axis.exchange_s

    def move_s(self, start: int, end: int) -> float:
        """Duration of what is left to go behind the last reading of a turn."""
        return self.rest_s + self.rotation.begin_s


@dataclass(frozen=True)
class RotationTiming(BenchTiming):
    """The timing of a bench whose analyzer turns while it is read."""

    rotation: Rotation | None = None

    def readings_s(self, readings: int, exposure_s: float) -> float:
        """Duration of a turn, from when the bench stands to the end of the last exposure."""
        assert self.rotation is not None, "made only for a rotation"
        rotation = self.rotation
        last_s = (readings - 1) * rotation.spacing_s(readings) + exposure_s + self.detector.overhead_s - CONFIRM_S
        return rotation.axis.start_s + rotation.begin_s + last_s

    def shortest_spacing_s(self, exposure_s: float) -> float:
        """How soon one reading can follow another: meanwhile the rotator is asked where it is."""
        exchange_s = self.analyzer.exchange_s
        return max(self.detector.reading_s(exposure_s), exchange_s + CONFIRM_S)


def rotation_timing(timing: BenchTiming, rotation: Rotation, recipe: Recipe) -> RotationTiming:
    """The timing of the bench with its analyzer turning."""
    left_s = rotation.spacing_s(min(recipe.readings_of_angles())) - recipe.exposure_s
    analyzer: AnalyzerTiming = EndTiming(rotation, max(left_s, 0.0))
    known = {name: getattr(timing, name) for name in BenchTiming.__dataclass_fields__}
    return RotationTiming(**(known | {"analyzer": analyzer, "rotation": rotation}))


def with_rotation(steps: Sequence[Step], timing: RotationTiming) -> tuple[Step, ...]:
    """The steps, each a turn; `first_repeat` counts the readings of a direction in turns in the same sense.

    Before the first, the analyzer goes from 0 to the end of its way.
    """
    rotation, first = timing.rotation, steps[0]
    assert rotation is not None, "it is the timing of a rotation"
    reading_s = timing.readings_s(first.readings, first.exposure_s)
    going_s = rotation.axis.start_s + rotation.axis.move_s(-rotation.end_deg) + rotation.axis.settle_s
    steps = [replace(first, duration_s=max(first.duration_s, going_s + reading_s)), *steps[1:]]
    taken: dict[tuple[int, int, int], int] = {}
    turning = []
    for step in steps:
        key = step.point, step.cycle, step.target.slot
        turning.append(replace(step, rotation=rotation, first_repeat=taken.get(key, 0)))
        taken[key] = taken.get(key, 0) + step.readings
    return tuple(turning)


def rotation_faults(recipe: Recipe) -> Iterator[SectionFault]:
    """What does not go with an analyzer that turns, or is missing beside it."""
    rotation = recipe.analyzer_rotation
    if rotation is None:
        if not recipe.analyzer_deg:
            meaning = type(recipe).model_fields["analyzer_deg"].description
            yield ("analyzer_deg",), f"is missing. Add it: {meaning}"
        return
    if rotation.turns % 2:
        yield (
            ("analyzer_rotation", "turns"),
            f"got {rotation.turns}; allowed: an even number, because what delays do to a turn forwards is undone by "
            "one backwards",
        )
    turns = "the analyzer turns (analyzer_rotation)"
    for key, angles in (("analyzer_deg", recipe.analyzer_deg), ("retarder_deg", recipe.retarder_deg)):
        if angles:
            yield (key,), f"names angles at which it stands, and {turns}; leave one of the two out"
    for key, is_given in (
        ("generator_deg", recipe.generator_deg is not None),
        ("calibration", recipe.calibration is not None),
        ("until", recipe.until is not None),
        ("adaptive", recipe.adaptive),
    ):
        if is_given:
            yield (key,), f"goes only with angles at which the analyzer stands, and here {turns}; leave one of them out"
    if recipe.averaging is not None:
        yield ("readings",), f"got a group of keys, but {turns}; write the number of readings in a turn"
    elif (fewest := min(recipe.readings_of_angles())) < FEWEST_READINGS:
        yield (
            ("readings",),
            f"got {fewest}; allowed: at least {FEWEST_READINGS}, because {turns}, and so many readings in a turn tell "
            "what it passes",
        )
