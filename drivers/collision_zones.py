"""Where parts of a bench would touch: zones of its axes' angles that no path may enter."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from drivers.arm_angle import nearest_deg

Span = tuple[float, float]
"""Lowest and highest angle of an axis on its way, in degrees."""


_IN_PLANE = (0.0, 0.0)
_ROUNDING_DEG = 1e-9


class Zone(Protocol):
    """Angles that are forbidden together, and all that are whole turns away from them: it is the same place."""

    def is_entered(self, spans: Mapping[str, Span]) -> bool:
        """Whether any combination of angles out of the spans of all axes lies in the zone."""
        ...

    def describe(self) -> str:
        """The zone, in words."""
        ...


@dataclass(frozen=True)
class ArmsTooClose:
    """Source arm and detector arm with less than so many degrees between their axes.

    The source stands at minus the angle of incidence, the detector at the exit angle, so in one plane the angle between
    them is the sum of the two; a detector azimuth may carry the detector out of that plane.
    """

    angle_deg: float

    def is_entered(self, spans: Mapping[str, Span]) -> bool:
        """Whether the arms can come closer than that anywhere in the spans."""
        source, detector = spans["source_arm"], spans["detector_arm"]
        azimuth = spans.get("detector_azimuth", _IN_PLANE)
        if azimuth != _IN_PLANE:
            return nearest_deg(source, detector, azimuth) < self.angle_deg - _ROUNDING_DEG
        lowest_deg, highest_deg = source[0] + detector[0], source[1] + detector[1]
        turns = math.floor((lowest_deg - self.angle_deg) / 360.0) + 1  # the first whose upper end is above the lowest
        return highest_deg > 360.0 * turns - self.angle_deg

    def describe(self) -> str:
        """The zone, in words."""
        return f"source arm and detector arm closer than {self.angle_deg:g} degrees"


@dataclass(frozen=True)
class Box:
    """Axes that touch something, or each other, while each is within its range; ends are forbidden too."""

    ranges_deg: Mapping[str, Span]

    def is_entered(self, spans: Mapping[str, Span]) -> bool:
        """Whether every axis of the zone can be within its range."""
        return all(_overlap(spans[role], range_deg) for role, range_deg in self.ranges_deg.items())

    def describe(self) -> str:
        """The zone, in words."""
        parts = (f"{role} at {low:g} to {high:g} degrees" for role, (low, high) in self.ranges_deg.items())
        return " with ".join(parts)


def _overlap(span: Span, range_deg: Span) -> bool:
    turns = math.ceil((span[0] - range_deg[1]) / 360.0)
    return span[1] >= range_deg[0] + 360.0 * turns


def entered(zones: Sequence[Zone], spans: Mapping[str, Span]) -> Zone | None:
    """The first zone that lies on a path; None for a free path."""
    return next((zone for zone in zones if zone.is_entered(spans)), None)


def orders(moving: Sequence[str]) -> Iterator[tuple[tuple[str, ...], ...]]:
    """Ways to move axes: all at once, then one after the other in every order."""
    if moving:
        yield (tuple(moving),)
    if len(moving) > 1:
        for order in itertools.permutations(moving):
            yield tuple((role,) for role in order)


def free_order(
    zones: Sequence[Zone], standing_deg: Mapping[str, float], ways: Mapping[str, Sequence[float]]
) -> tuple[tuple[str, ...], ...] | None:
    """The quickest order of moves whose path enters no zone.

    Axes that move at once may be anywhere on their ways independently of each other, because their speeds differ and
    any of them may be stopped.

    Parameters
    ----------
    zones : sequence of Zone
        What must not be entered.
    standing_deg : mapping of str to float
        Where each axis stands, by role.
    ways : mapping of str to sequence of float
        The angles where the move of each axis that moves begins, turns and ends.

    Returns
    -------
    tuple of tuple of str, or None
        The roles that move together, in turn; None when there is no such order.
    """
    if not ways:
        return ()
    return next((order for order in orders(tuple(ways)) if not _first_entered(zones, standing_deg, ways, order)), None)


def _first_entered(
    zones: Sequence[Zone],
    standing_deg: Mapping[str, float],
    ways: Mapping[str, Sequence[float]],
    order: tuple[tuple[str, ...], ...],
) -> Zone | None:
    spans = {role: (angle_deg, angle_deg) for role, angle_deg in standing_deg.items()}
    for together in order:
        spans |= {role: (min(ways[role]), max(ways[role])) for role in together}
        if zone := entered(zones, spans):
            return zone
        spans |= {role: (ways[role][-1], ways[role][-1]) for role in together}
    return None
