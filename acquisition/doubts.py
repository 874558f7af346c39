"""What looks wrong in the light of a scan, in words: a lamp that nobody watched, changed or was off."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

from acquisition.lamp_level import SIGNIFICANT, LampBreak, LampLevel
from acquisition.readings import Reading, StokesPoint


def in_break(found: LampBreak, readings: Sequence[Reading]) -> str:
    """Which readings are in doubt for what two references show, and why."""
    concerned = [reading for reading in readings if reading.kind == "signal" and found.holds(reading.time_s)]
    return (
        f"At {named([reading.point for reading in concerned])} ({len(concerned)} readings) the lamp level cannot be "
        f"followed: {found.why}. The readings are stored, and are left out of every result. Look at the lamp and at "
        "what may stand in the beam, then measure these directions again"
    )


def unfinished(points: Sequence[int]) -> str:
    """Which directions of a scan that was cut off have too few readings; empty if there is none."""
    if not points:
        return ""
    return (
        f"The scan was cut off before {named(points)} {'were' if len(set(points)) > 1 else 'was'} finished; the "
        f"{len(points)} readings there are stored, and are left out of every result"
    )


def skipped(points: Sequence[int]) -> str:
    """Which directions a person has skipped; empty if none."""
    if not points:
        return ""
    return (
        f"The rest of {named(points)} was skipped, so {'they are' if len(set(points)) > 1 else 'it is'} unfinished; "
        "what was read there is stored, and is left out of every result"
    )


def behind_last_reference(lamp: LampLevel, readings: Sequence[Reading]) -> str:
    """Which directions no reference closes; empty if the recipe has none, or the last one stands at the end."""
    if not lamp.times_s or lamp.is_dark(-1):
        return ""
    unwatched = [
        reading.point for reading in readings if reading.kind == "signal" and reading.time_s > lamp.times_s[-1]
    ]
    if not unwatched:
        return ""
    return (
        f"No reference was read after {named(unwatched)}: the lamp is taken to be as bright there as at the last one, "
        f"{lamp.times_s[-1]:.1f} s on the bench's clock"
    )


def without_light(points: Sequence[StokesPoint]) -> str:
    """That no direction shows any light; empty if one does."""
    if not points or any(point.stokes[0] > SIGNIFICANT * math.sqrt(point.covariance[0, 0]) for point in points):
        return ""
    return (
        f"No light was seen: S0 is within {SIGNIFICANT:g} standard errors of 0 in every direction. Look whether the "
        "lamp is on, the shutter open and the detector in the beam"
    )


def in_unsteady_light(what: str, points: Sequence[int]) -> str:
    """Which directions were not read in one steady light, for what their readings show."""
    return (
        f"The readings of {named(points)} {what}: the lamp may have been off, or something in the beam, for a part of "
        "the time. They are in every result. Look at the lamp and the beam, then measure these directions, and those "
        "read just before and behind them, again"
    )


def named(points: Sequence[int]) -> str:
    """Points in words, such as ``points 2 to 5, 9``."""
    stretches: list[str] = []
    ordered = sorted(set(points))
    for _, group in itertools.groupby(enumerate(ordered), key=lambda pair: pair[1] - pair[0]):
        members = [point for _, point in group]
        stretches.append(f"{members[0]}" if len(members) == 1 else f"{members[0]} to {members[-1]}")
    return f"point{'s' * (len(ordered) != 1)} {', '.join(stretches)}"
