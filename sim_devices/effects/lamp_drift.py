"""A lamp whose power changes in the course of a scan: steadily, or by a random walk."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Literal

from pydantic import Field

from sim_devices.effects.entry import Effect
from sim_devices.effects.measurement import Moment, Stokes, seeded

if TYPE_CHECKING:
    from sim_devices.world import World

_HOUR_S = 3600.0
_STEP_S = 10.0


class LampDrift(Effect):
    """The lamp's power is exp(`relative_per_hour` · t / 1 h) times that of the scene, from the bench's start on."""

    effect: Literal["lamp_drift"] = Field(description="the effect's name")
    relative_per_hour: float = Field(ge=-1, le=1, description="relative change of the lamp's power, per hour")

    def install(self, world: World) -> None:
        """Scale what arrives, by the lamp's power in the middle of the exposure."""
        steady_w, relative_per_s = world.arriving_w, self.relative_per_hour / _HOUR_S

        def drifted_w(moment: Moment) -> Stokes:
            return steady_w(moment) * math.exp(relative_per_s * moment.middle_s)

        world.arriving_w = drifted_w


class LampWalk(Effect):
    """The logarithm of the lamp's power walks at random, from the bench's start on."""

    effect: Literal["lamp_walk"] = Field(description="the effect's name")
    relative_per_root_hour: float = Field(
        gt=0,
        le=1,
        description="standard deviation of the relative change after one hour; it grows as root t",
    )

    def install(self, world: World) -> None:
        """Scale what arrives, by the lamp's power in the middle of the exposure."""
        steady_w, walk = world.arriving_w, Walk(world.scene.seed, self.relative_per_root_hour)

        def walking_w(moment: Moment) -> Stokes:
            return steady_w(moment) * math.exp(walk.at(moment.middle_s))

        world.arriving_w = walking_w


class Walk:
    """A Gaussian random walk by steps of 10 s, with straight lines between them; the same whenever it is asked.

    Parameters
    ----------
    seed : int
        The scene's seed.
    per_root_hour : float
        Standard deviation after one hour.
    """

    def __init__(self, seed: int, per_root_hour: float) -> None:
        self._random, self._spread = seeded(seed, 0, "lamp walk"), per_root_hour * math.sqrt(_STEP_S / _HOUR_S)
        self._walked = [0.0]

    def at(self, time_s: float) -> float:
        """Where it is at `time_s` >= 0."""
        step, way = divmod(time_s / _STEP_S, 1.0)
        while len(self._walked) < step + 2:
            self._walked.append(self._walked[-1] + float(self._random.normal(0.0, self._spread)))
        before, after = self._walked[int(step)], self._walked[int(step) + 1]
        return before + way * (after - before)
