"""How long moves and readings take: what the planner knows of a bench without touching it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

from drivers.collision_zones import Zone, free_order
from drivers.motion import motion_s

POLL_S = 0.02
"""How often a moving device is asked whether it has arrived."""

DUE_POLL_S = 0.001
"""How often once it should have arrived, or a reading should have come."""

READING_POLL_S = 0.005
"""How often it is looked whether a reading has come; costs no exchange with the device."""

CONFIRM_S = 0.004
"""The questions whether a reading is what was asked: a step's last is confirmed on the way to the next direction."""

READING_S = CONFIRM_S
"""What a reading takes beyond its exposure."""

FRESH_S = 0.1
"""How long it is taken for granted that axes at rest stand where they have just said."""

_TO_TURN_BACK = 4
"""Exchanges between the ways down and back up: whether it stands, without errors, where, and whether it has begun."""

_TO_WATCH = 3
"""Exchanges by which each start sees that no axis is in the way: whether it stands, without errors, and where."""

FIRST_SLOT = 1
"""Where a wheel is taken to stand that nobody has asked yet."""

EXCHANGE_S = 0.01
"""A question and its answer on a serial line: 20 characters at 19200 baud, or a controller's own latency."""


@dataclass(frozen=True)
class AxisTiming:
    """An axis that accelerates evenly to its speed, then needs `settle_s` to come to rest.

    It takes `exchange_s` to ask something, such as whether it has arrived, and `start_s` for whatever else belongs to a
    move and nothing hides. Where there is `backlash_deg`, moves down go so far below their target and come back.
    """

    velocity_deg_s: float
    acceleration_deg_s2: float
    settle_s: float
    exchange_s: float = EXCHANGE_S
    start_s: float = 2 * EXCHANGE_S
    backlash_deg: float = 0.0

    def move_s(self, distance_deg: float) -> float:
        """Duration of a move; one downwards goes on by the backlash, and comes back."""
        if distance_deg < 0.0 < self.backlash_deg:
            return self._way_s(distance_deg - self.backlash_deg) + self.back_s
        return self._way_s(distance_deg)

    @property
    def back_s(self) -> float:
        """Duration of the way back by the backlash, and of turning to it."""
        return self._way_s(self.backlash_deg) + self.start_s + _TO_TURN_BACK * self.exchange_s

    def _way_s(self, distance_deg: float) -> float:
        return motion_s(distance_deg, self.velocity_deg_s, self.acceleration_deg_s2)


class AnalyzerTiming(Protocol):
    """How long an analyzer takes from one of its slots to another, and then to come to rest."""

    @property
    def settle_s(self) -> float:
        """Time to come to rest."""
        ...

    @property
    def exchange_s(self) -> float:
        """Time to ask which slot is in the beam."""
        ...

    def move_s(self, start: int, end: int) -> float:
        """Duration of the move from slot to slot."""
        ...


@dataclass(frozen=True)
class WheelTiming:
    """A wheel of `slots` positions that goes the shorter way round, `slot_s` for each neighbour."""

    slots: int
    slot_s: float
    settle_s: float
    exchange_s: float = 0.0

    def move_s(self, start: int, end: int) -> float:
        """Duration of the wheel's move."""
        apart = abs(start - end) % self.slots
        return min(apart, self.slots - apart) * self.slot_s


@dataclass(frozen=True)
class SliderTiming:
    """A slider of slots in a row, `slot_s` for each neighbour."""

    slot_s: float
    settle_s: float
    exchange_s: float

    def move_s(self, start: int, end: int) -> float:
        """Duration of the slider's move."""
        return abs(start - end) * self.slot_s


@dataclass(frozen=True)
class RotatorTiming:
    """A rotator whose slots are angles."""

    angles_deg: Mapping[int, float]
    axis: AxisTiming

    @property
    def settle_s(self) -> float:
        """Time to come to rest."""
        return self.axis.settle_s

    @property
    def exchange_s(self) -> float:
        """Time to ask where it is."""
        return self.axis.exchange_s

    def move_s(self, start: int, end: int) -> float:
        """Duration of the rotator's move; from a slot that it does not have, as from 0 degrees."""
        return self.axis.start_s + self.axis.move_s(self.angles_deg[end] - self.angles_deg.get(start, 0.0))


@dataclass(frozen=True)
class JointTiming:
    """Several elements that turn at the same time."""

    elements: tuple[RotatorTiming, ...]

    @property
    def settle_s(self) -> float:
        """Time until all have come to rest."""
        return max(element.settle_s for element in self.elements)

    @property
    def exchange_s(self) -> float:
        """Time to ask each where it is."""
        return sum(element.exchange_s for element in self.elements)

    def move_s(self, start: int, end: int) -> float:
        """Duration of the longest move."""
        return max(element.move_s(start, end) for element in self.elements)


@dataclass(frozen=True)
class DetectorTiming:
    """A detector that needs `overhead_s` for each reading, besides its exposure; more if that is a single sample.

    `exposures` are those of one reading, one after the other, over the longest of them.
    """

    overhead_s: float = READING_S
    sample_s: float = 0.0
    single_s: float = 0.0
    exposures: tuple[float, ...] = (1.0,)

    def reading_s(self, exposure_s: float) -> float:
        """Duration of a reading."""
        is_single = exposure_s < 1.5 * self.sample_s
        single_s = self.single_s if is_single else 0.0
        return sum(self.exposures) * exposure_s + len(self.exposures) * self.overhead_s + single_s


@dataclass(frozen=True)
class BenchTiming:
    """The timing of every part of the bench; axes that could touch in a zone move one after the other.

    `detector_azimuth` is None on a bench without this axis.
    """

    source_arm: AxisTiming
    detector_arm: AxisTiming
    sample_azimuth: AxisTiming
    analyzer: AnalyzerTiming
    zones: tuple[Zone, ...] = ()
    detector: DetectorTiming = DetectorTiming()
    detector_azimuth: AxisTiming | None = None
    generator: AnalyzerTiming | None = None
    filter: WheelTiming | None = None

    @property
    def axes(self) -> dict[str, AxisTiming]:
        """The axes that the bench has, by role, in the order of `Target.axes_deg`."""
        axes = {
            "source_arm": self.source_arm,
            "detector_arm": self.detector_arm,
            "sample_azimuth": self.sample_azimuth,
        }
        return axes if self.detector_azimuth is None else {**axes, "detector_azimuth": self.detector_azimuth}

    def reading_s(self, exposure_s: float) -> float:
        """Duration of a reading; the axes are asked where they are meanwhile, which may take longer."""
        return max(self.detector.reading_s(exposure_s), self._asking_s + CONFIRM_S)

    def readings_s(self, readings: int, exposure_s: float) -> float:
        """Duration of a step's readings.

        During each, analyzer and generator are asked about the one before it; the axes are asked during the first and
        the last, and whenever what they said is no longer fresh.
        """
        if readings < 2:
            return readings * self.reading_s(exposure_s)
        least_s = self.slots_s + CONFIRM_S
        plain_s = max(least_s, self.detector.reading_s(exposure_s))
        asked_s = max(least_s + self._asking_s, plain_s)
        rarely_s = plain_s + (asked_s - plain_s) / math.ceil(FRESH_S / plain_s)
        return self.reading_s(exposure_s) + (readings - 2) * rarely_s + asked_s

    @property
    def slots_s(self) -> float:
        """Time to ask which slots are in the beam."""
        return self.analyzer.exchange_s + (0.0 if self.generator is None else self.generator.exchange_s)

    @property
    def watching_s(self) -> float:
        """Time by which each start of an axis is later where axes could touch in a zone."""
        return _TO_WATCH * self._asking_s if self.zones else 0.0

    @property
    def _asking_s(self) -> float:
        """Time to ask every axis where it is."""
        return sum(axis.exchange_s for axis in self.axes.values())

    def axes_s(self, here_deg: Mapping[str, float], there_deg: Mapping[str, float]) -> float:
        """Duration of the axes' moves between two places, given by role; a way through a zone counts as if free."""
        axes = self.axes
        ways = {role: (here_deg[role], there_deg[role]) for role in axes if here_deg[role] != there_deg[role]}
        if len(ways) < 2:
            return sum(axes[role].move_s(there - here) for role, (here, there) in ways.items())
        order = free_order(self.zones, here_deg, ways) or (tuple(ways),)
        return sum(max(axes[role].move_s(ways[role][1] - ways[role][0]) for role in together) for together in order)
