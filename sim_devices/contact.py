"""Whether parts of the simulated bench have touched: what a collision zone is there to prevent."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from pydantic import Field

from sim_devices.axis import AngleOfTime, Axis
from sim_devices.scene_part import ScenePart

_SHORTEST_S = 1e-4
"""Parts that would touch for less than that are taken to have missed each other."""

_MOST_MOTIONS = 16
"""As many that have begun or are to begin are not looked at yet; more than any device has queued."""

_CAUTION = 1.5
"""How much faster than its motor an arm may be while it bends or its gear takes up play."""


class Bodies(ScenePart):
    """How much room the arms take, seen from the axis that they turn about; the frame stands beside the sample."""

    source_arm_half_deg: float = Field(gt=0, le=45, description="half the width of the source arm, in degrees")
    detector_arm_half_deg: float = Field(gt=0, le=45, description="half the width of the detector arm, in degrees")
    frame_deg: float = Field(
        gt=45, le=180, description="angle from the sample's normal at which the frame of its table stands, in degrees"
    )

    def rooms_deg(
        self, source_arm_deg: float, detector_arm_deg: float, detector_azimuth_deg: float = 0.0
    ) -> tuple[tuple[float, str], ...]:
        """Room between each two parts that can touch, in degrees, negative where they overlap; and which they are."""
        between_deg = _between_deg(source_arm_deg, detector_arm_deg, detector_azimuth_deg)
        return (
            (between_deg - self.source_arm_half_deg - self.detector_arm_half_deg, "source arm and detector arm"),
            (self.frame_deg - abs(source_arm_deg) - self.source_arm_half_deg, "source arm and frame"),
            (self.frame_deg - abs(detector_arm_deg) - self.detector_arm_half_deg, "detector arm and frame"),
        )


def _between_deg(source_deg: float, detector_deg: float, azimuth_deg: float) -> float:
    """The angle between the arms; the source stands at minus the angle of incidence."""
    if azimuth_deg == 0.0:
        return abs((source_deg + detector_deg + 180.0) % 360.0 - 180.0)
    source, detector, azimuth = map(math.radians, (source_deg, detector_deg, azimuth_deg))
    cosine = math.cos(source) * math.cos(detector) - math.sin(source) * math.sin(detector) * math.cos(azimuth)
    return math.degrees(math.acos(max(-1.0, min(cosine, 1.0))))


@dataclass(frozen=True)
class Contact:
    """Two parts that touched."""

    parts: str
    time_s: float


class ContactWatch:
    """Looks at what the arms did, motion after motion, once they are long over: one that is to begin may not.

    Parameters
    ----------
    bodies : Bodies
        The parts.
    axes : mapping of str to Axis
        What turns the arms, by role.
    angle_deg : mapping of str to callable
        Where the arms truly are at a time, by role.

    Attributes
    ----------
    contact : Contact or None
        The first one.
    """

    def __init__(self, bodies: Bodies, axes: Mapping[str, Axis], angle_deg: Mapping[str, AngleOfTime]) -> None:
        self._bodies = bodies
        roles = [role for role in ("source_arm", "detector_arm", "detector_azimuth") if role in axes]
        self._arms = [axes[role] for role in roles]
        self._angles_deg = [angle_deg[role] for role in roles]
        self._looked_s = 0.0
        self._starts_s: list[float] = []
        self.contact: Contact | None = None
        for arm in self._arms:
            arm.before_motion.append(self._note)

    def look(self, now_s: float) -> Contact | None:
        """The first contact up to now."""
        for end_s in sorted({now_s, *(start_s for start_s in self._starts_s if start_s < now_s)}):
            if self.contact is None and end_s > self._looked_s:
                self.contact = self._first(self._looked_s, end_s)
            self._looked_s = max(self._looked_s, end_s)
        self._starts_s = [start_s for start_s in self._starts_s if start_s >= now_s]
        return self.contact

    def _note(self, start_s: float) -> None:
        """Keep in mind when a motion begins; look while the arms' own memory still reaches back so far."""
        self._starts_s.append(start_s)
        if len(self._starts_s) > _MOST_MOTIONS:
            self.look(min(self._starts_s))
            self._starts_s.remove(min(self._starts_s))

    def _first(self, begin_s: float, end_s: float) -> Contact | None:
        """Step by step as far as the room that there is cannot have been used up."""
        profiles = [arm.profile(time_s) for arm in self._arms for time_s in (begin_s, end_s)]
        end_s = min(end_s, max(profile.end_s for profile in profiles))
        closing_deg_s = _CAUTION * sum(profile.fastest_deg_s for profile in profiles)
        time_s = begin_s
        while time_s <= end_s:
            room_deg, parts = min(self._bodies.rooms_deg(*(angle(time_s) for angle in self._angles_deg)))
            if room_deg < 0:
                return Contact(parts, time_s)
            time_s += max(room_deg / closing_deg_s, _SHORTEST_S) if closing_deg_s else end_s
        return None
