"""Collision zones of a rig file, and whether a recipe's way leads through one."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Self

import numpy as np
from pydantic import Field, model_validator

from acquisition.expand import Step, Target
from acquisition.section import Section, SectionFault, refuse_all
from drivers.collision_zones import ArmsTooClose, Box, Span, Zone, entered, free_order
from drivers.travel import Travel
from goniometer.rig_devices.entry import PLACING, Angle, Role

Range = Annotated[tuple[Angle, Angle], Field(strict=False)]


class ZoneEntry(Section):
    """Angles at which parts of the bench would touch: arms too close to each other, or axes within ranges together."""

    arms_closer_than_deg: float | None = Field(
        default=None, gt=0, le=180, description="least angle between source arm and detector arm, in degrees"
    )
    source_arm: Range | None = Field(default=None, description="range of the source arm, in degrees")
    detector_arm: Range | None = Field(default=None, description="range of the detector arm, in degrees")
    sample_azimuth: Range | None = Field(default=None, description="range of the sample's azimuth, in degrees")
    detector_azimuth: Range | None = Field(default=None, description="range of the detector's azimuth, in degrees")

    @model_validator(mode="after")
    def _check(self) -> Self:
        refuse_all(self._faults())
        return self

    def _faults(self) -> Iterator[SectionFault]:
        if (self.arms_closer_than_deg is None) == (not self.ranges_deg()):
            yield (), "needs arms_closer_than_deg, or ranges of one or more axes, and not both"
        for role, (low, high) in self.ranges_deg().items():
            if not low < high:
                yield (role,), f"got [{low:g}, {high:g}]; allowed: the lowest angle, then a higher one"

    def ranges_deg(self) -> dict[str, Span]:
        """The ranges that were given, by role."""
        ranges = {role: getattr(self, role) for role in PLACING}
        return {role: span for role, span in ranges.items() if span is not None}

    def roles(self) -> tuple[Role, ...]:
        """The axes that the zone is about."""
        if self.arms_closer_than_deg is not None:
            return "source_arm", "detector_arm", "detector_azimuth"
        return tuple(role for role in PLACING if role in self.ranges_deg())

    def zone(self) -> Zone:
        """The zone itself."""
        return Box(self.ranges_deg()) if self.arms_closer_than_deg is None else ArmsTooClose(self.arms_closer_than_deg)


@dataclass(frozen=True)
class _WithinTolerance:
    """A zone, and all around it from where an axis that stops somewhere within its tolerance may be in it."""

    zone: Zone
    tolerances_deg: Mapping[str, float]

    def is_entered(self, spans: Mapping[str, Span]) -> bool:
        """Whether the zone can be entered from the spans."""
        wider: dict[str, Span] = {}
        for role, tolerance_deg in self.tolerances_deg.items():
            low_deg, high_deg = spans[role]
            wider[role] = low_deg - tolerance_deg, high_deg + tolerance_deg
        return self.zone.is_entered(wider)

    def describe(self) -> str:
        """The zone, in words."""
        return self.zone.describe()


def blocked_ways(
    steps: Sequence[Step], zones: Sequence[Zone], travels: Mapping[Role, Travel]
) -> Iterator[tuple[Target, Target]]:
    """The places of a scan between which no order of moves keeps out of the zones, each way once, forth or back.

    Where the bench will stand before the first place is not known: every axis is taken to reach it from above. Later
    moves are taken to approach from below too, also where a short step up needs no approach: the way there was free.

    Parameters
    ----------
    steps : sequence of Step
        The scan.
    zones : sequence of Zone
        What no path may enter, nor come so close to that an axis within its tolerance may be in it.
    travels : mapping of str to Travel
        How the axes move, by role.
    """
    if not zones:
        return
    way_of = _Ways([step.target for step in steps], zones, travels)
    known: set[frozenset[tuple[float, ...]]] = set()
    for number in way_of.blocked(0, len(steps)):
        here, there = way_of.places[number], way_of.places[number + 1]
        ends = frozenset(tuple(place.axes_deg.values()) for place in (here, there))
        if ends not in known:
            known.add(ends)
            yield here, there


class _Ways:
    """The ways of a scan, in order; stretches that stay clear of every zone as a whole are not looked at one by one."""

    def __init__(self, places: Sequence[Target], zones: Sequence[Zone], travels: Mapping[Role, Travel]) -> None:
        self._roles = [role for role in PLACING if role in travels]
        tolerances_deg: dict[str, float] = {role: travels[role].tolerance_deg for role in self._roles}
        self.places = [*places[:1], *places]
        self._travels = travels
        self._zones = [_WithinTolerance(zone, tolerances_deg) for zone in zones]
        of_roles = [PLACING.index(role) for role in self._roles]
        self._angles_deg = np.array([place.angles_deg for place in self.places])[:, of_roles]
        self._wraps = any(travels[role].wraps for role in self._roles)

    def blocked(self, first: int, last: int) -> Iterator[int]:
        """The numbers of the ways in a stretch, each from its place to the next, that no order of moves keeps free."""
        if last <= first or self._is_clear(first, last):
            return
        if last == first + 1:
            if not self._is_free(first):
                yield first
            return
        middle = (first + last) // 2
        yield from self.blocked(first, middle)
        yield from self.blocked(middle, last)

    def _is_clear(self, first: int, last: int) -> bool:
        """Whether the axes may be anywhere between all the places of a stretch, independently of each other."""
        if self._wraps:
            return False
        angles_deg = self._angles_deg[first : last + 1]
        spans: dict[str, Span] = {
            role: (low - self._travels[role].backlash_deg, high)
            for role, low, high in zip(
                self._roles, angles_deg.min(axis=0).tolist(), angles_deg.max(axis=0).tolist(), strict=True
            )
        }
        return entered(self._zones, spans) is None

    def _is_free(self, number: int) -> bool:
        standing_deg, going_deg = self.places[number].axes_deg, self.places[number + 1].axes_deg
        ways: dict[str, list[float]] = {
            role: self._travels[role].way_deg(standing_deg[role], going_deg[role], came_from_below=False)
            for role in self._roles
            if number == 0 or going_deg[role] != standing_deg[role]
        }
        return free_order(self._zones, standing_deg, ways) is not None
