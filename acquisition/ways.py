"""How long many ways take at once: the moving times of lists of directions, as `Moving` has them one by one."""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray

from acquisition.moving import Moving
from acquisition.steps import Target
from acquisition.timing import CONFIRM_S, AxisTiming, BenchTiming
from drivers.collision_zones import free_order

Angles = NDArray[np.float64]
"""Incidence, exit angle, sample azimuth and exit azimuth in degrees, shape (..., 4)."""

MOST_WITH_ZONES = 61
"""Directions, home among them, between which every way is looked at for collisions."""

_BLOCKED_S = 1e5
_SLOT = 1
"""Whichever: the analyzer stays."""


class Ways:
    """Moving times between directions, the analyzer at rest.

    Parameters
    ----------
    timing : BenchTiming
        Speeds of the rig.
    moving_s : Moving
        What knows the ways of axes that wait for each other.
    """

    def __init__(self, timing: BenchTiming, moving_s: Moving) -> None:
        self._moving_s, self._zones = moving_s, timing.zones
        self._axes, self._watching_s = tuple(timing.axes.values()), timing.watching_s

    def free_s(self, starts_deg: Angles, ends_deg: Angles) -> NDArray[np.float64]:
        """Duration of each way (...) with all axes going at once, settling and questions included."""
        way_deg = (ends_deg - starts_deg)[..., : len(self._axes)]
        going = way_deg != 0.0
        moves_s = [axis_moves_s(axis, way_deg[..., place]) for place, axis in enumerate(self._axes)]
        settles_s = going * [axis.settle_s for axis in self._axes]
        asking_s = going @ np.array([axis.start_s + axis.exchange_s + self._watching_s for axis in self._axes])
        confirm_s = CONFIRM_S * going.any(axis=-1)
        return np.asarray(np.max(moves_s, axis=0) + settles_s.max(axis=-1) + asking_s - confirm_s)

    def along_s(self, places_deg: Angles) -> NDArray[np.float64]:
        """Duration of the way from each of the directions (N, 4) to the next, shape (N - 1,)."""
        return self._waiting_s(places_deg[:-1], places_deg[1:])

    def between_s(self, places_deg: Angles) -> NDArray[np.float64]:
        """Duration of the way from each direction (N, 4) to each (N, N); one that leads through a zone takes very long.

        Of more than `MOST_WITH_ZONES` directions, all ways count as if free.
        """
        count = len(places_deg)
        if not self._zones or count > MOST_WITH_ZONES:
            return self.free_s(places_deg[:, None], places_deg[None, :])
        first, last = np.indices((count, count)).reshape(2, -1)
        ways_s = self._waiting_s(places_deg[first], places_deg[last])
        is_blocked = [
            self._is_blocked(places_deg[one], places_deg[other]) for one, other in zip(first, last, strict=True)
        ]
        return np.asarray((ways_s + _BLOCKED_S * np.array(is_blocked)).reshape(count, count))

    def blocked(self, places_deg: Angles) -> int:
        """How many of the ways from each of the directions (N, 4) to the next lead through a zone."""
        if not self._zones:
            return 0
        return sum(self._is_blocked(one, other) for one, other in itertools.pairwise(places_deg))

    def _waiting_s(self, starts_deg: Angles, ends_deg: Angles) -> NDArray[np.float64]:
        """Durations of ways (M,); axes that could touch wait for each other."""
        ways_s = self.free_s(starts_deg, ends_deg)
        if self._zones:
            for number in np.flatnonzero((starts_deg != ends_deg).sum(axis=1) > 1).tolist():
                here, there = _target(starts_deg[number]), _target(ends_deg[number])
                ways_s[number] = self._moving_s(here, there)
        return ways_s

    def _is_blocked(self, start_deg: Angles, end_deg: Angles) -> bool:
        here, there = _target(start_deg).axes_deg, _target(end_deg).axes_deg
        ways = {role: (here[role], there[role]) for role in here if here[role] != there[role]}
        return free_order(self._zones, here, ways) is None


def _target(angles_deg: Angles) -> Target:
    incidence_deg, exit_deg, azimuth_deg, exit_azimuth_deg = angles_deg.tolist()
    return Target(incidence_deg, exit_deg, azimuth_deg, _SLOT, exit_azimuth_deg)


def axis_moves_s(axis: AxisTiming, way_deg: Angles) -> NDArray[np.float64]:
    """Duration of moves of one axis, as `AxisTiming.move_s` has it; 0 for none."""

    def way_s(distance_deg: Angles) -> NDArray[np.float64]:
        full_deg = axis.velocity_deg_s**2 / axis.acceleration_deg_s2
        rising_s = 2.0 * np.sqrt(distance_deg / axis.acceleration_deg_s2)
        full_s = distance_deg / axis.velocity_deg_s + axis.velocity_deg_s / axis.acceleration_deg_s2
        return np.where(distance_deg < full_deg, rising_s, full_s)

    moves_s = way_s(np.abs(way_deg))
    if axis.backlash_deg > 0.0:
        down_s = way_s(np.abs(way_deg) + axis.backlash_deg) + axis.back_s
        moves_s = np.where(way_deg < 0.0, down_s, moves_s)
    return np.asarray(moves_s)
