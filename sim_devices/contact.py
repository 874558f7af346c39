"""Whether parts of the simulated bench have touched: what a collision zone is there to prevent."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from pydantic import Field

from sim_devices.axis import Axis
from sim_devices.scene_part import ScenePart

_SHORTEST_S = 1e-4
"""Parts that would touch for less than that are taken to have missed each other."""


class Bodies(ScenePart):
    """How much room the arms take, seen from the axis that they turn about; the frame stands beside the sample."""

    source_arm_half_deg: float = Field(gt=0, le=45, description="half the width of the source arm, in degrees")
    detector_arm_half_deg: float = Field(gt=0, le=45, description="half the width of the detector arm, in degrees")
    frame_deg: float = Field(
        gt=45, le=180, description="angle from the sample's normal at which the frame of its table stands, in degrees"
    )

    def clearances_deg(self, source_arm_deg: float, detector_arm_deg: float) -> dict[str, float]:
        """Room between each two parts that can touch, in degrees; negative where they overlap."""
        # the source stands at minus the angle of incidence
        between = abs(source_arm_deg + detector_arm_deg) - self.source_arm_half_deg - self.detector_arm_half_deg
        return {
            "source arm and detector arm": between,
            "source arm and frame": self.frame_deg - abs(source_arm_deg) - self.source_arm_half_deg,
            "detector arm and frame": self.frame_deg - abs(detector_arm_deg) - self.detector_arm_half_deg,
        }


@dataclass(frozen=True)
class Contact:
    """Two parts that touched."""

    parts: str
    time_s: float


class ContactWatch:
    """Looks at what the axes did, each time before they are told something else.

    Parameters
    ----------
    bodies : Bodies
        The parts.
    axes : mapping of str to WatchedAxis
        The axes by role; they may be added later.

    Attributes
    ----------
    contact : Contact or None
        The first one.
    """

    def __init__(self, bodies: Bodies, axes: Mapping[str, WatchedAxis]) -> None:
        self._bodies, self._axes = bodies, axes
        self._looked_s = 0.0
        self.contact: Contact | None = None

    def look(self, now_s: float) -> Contact | None:
        """The first contact up to now."""
        if self.contact is None and now_s > self._looked_s:
            self.contact = self._first(self._looked_s, now_s)
        self._looked_s = max(self._looked_s, now_s)
        return self.contact

    def _clearances_deg(self, time_s: float) -> dict[str, float]:
        return self._bodies.clearances_deg(
            self._axes["source_arm"].position_deg(time_s), self._axes["detector_arm"].position_deg(time_s)
        )

    def _first(self, begin_s: float, end_s: float) -> Contact | None:
        """Step by step as far as the room that there is cannot have been used up."""
        arms = (self._axes["source_arm"], self._axes["detector_arm"])
        end_s = min(end_s, max(arm.end_s for arm in arms))
        fastest_deg_s = sum(arm.fastest_deg_s for arm in arms)
        time_s = begin_s
        while time_s <= end_s:
            parts, room_deg = min(self._clearances_deg(time_s).items(), key=lambda item: item[1])
            if room_deg < 0:
                return Contact(parts, time_s)
            time_s += max(room_deg / fastest_deg_s, _SHORTEST_S) if fastest_deg_s else end_s
        return None


class WatchedAxis(Axis):
    """An axis whose past is looked at before it is told where to go next."""

    def __init__(self, step_deg: float, watch: ContactWatch) -> None:
        super().__init__(step_deg)
        self._watch = watch
        self.fastest_deg_s = 0.0

    def move(
        self,
        target_deg: float,
        now_s: float,
        *,
        velocity_deg_s: float,
        acceleration_deg_s2: float,
        deceleration_deg_s2: float,
    ) -> None:
        """Go to the encoder step nearest to `target_deg`, from whatever motion is under way."""
        self._watch.look(now_s)
        self.fastest_deg_s = max(self.fastest_deg_s, velocity_deg_s)
        super().move(
            target_deg,
            now_s,
            velocity_deg_s=velocity_deg_s,
            acceleration_deg_s2=acceleration_deg_s2,
            deceleration_deg_s2=deceleration_deg_s2,
        )

    def stop(self, now_s: float, *, deceleration_deg_s2: float) -> None:
        """Decelerate to rest, and forget every motion that was to follow."""
        self._watch.look(now_s)
        super().stop(now_s, deceleration_deg_s2=deceleration_deg_s2)
