"""Polarizers that let a little of the crossed state through."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np
from pydantic import Field

from sim_devices.analyzer import Row
from sim_devices.effects.entry import Effect

if TYPE_CHECKING:
    from sim_devices.world import World


class ExtinctionRatio(Effect):
    """Every polarizer passes 1/`ratio` of the light across its axis, and all of that along it."""

    effect: Literal["extinction_ratio"] = Field(description="the effect's name")
    ratio: float = Field(gt=1, le=1e9, description="transmittance along the polarizer's axis over that across it")

    def install(self, world: World) -> None:
        """Let the analyzer leak: its row ½ (1, a) becomes ½ (1 + 1/ratio, a (1 - 1/ratio))."""
        ideal_row, leak = world.row, 1 / self.ratio
        leaking = np.array([1 + leak, 1 - leak, 1 - leak, 1 - leak])

        def row(time_s: float) -> Row | None:
            ideal = ideal_row(time_s)
            # an open slot has no axis
            return ideal if ideal is None or not ideal[1:].any() else ideal * leaking

        world.row = row
