"""A polarizer of known angle that somebody has put in front of the analyzer, to calibrate it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Literal

import numpy as np
from pydantic import Field

from sim_devices.effects.entry import Effect
from sim_devices.effects.measurement import Moment, Stokes

if TYPE_CHECKING:
    from sim_devices.world import World


class ReferencePolarizer(Effect):
    """A polarizer before the analyzer, in a mount whose zero may be off; it costs a matrix product a reading."""

    effect: Literal["reference_polarizer"] = Field(description="the effect's name")
    angle_deg: float = Field(default=0.0, ge=-360, le=360, description="what its mount shows, from s towards p, in deg")
    error_deg: float = Field(default=0.0, ge=-90, le=90, description="what is added to that: its true angle, in deg")
    extinction_ratio: float = Field(
        default=1e6, gt=1, le=1e12, description="transmittance along its axis over that across it"
    )

    def install(self, world: World) -> None:
        """Let light pass it before the analyzer."""
        arriving_w, matrix = world.arriving_w, self.mueller()

        def behind_it_w(moment: Moment) -> Stokes:
            passed: Stokes = matrix @ arriving_w(moment)
            return passed

        world.arriving_w = behind_it_w

    def mueller(self) -> Stokes:
        """Its Mueller matrix: R(-a) D R(a), with D that of an element of amplitudes 1 and √(1/ratio) along s and p."""
        twice = 2 * math.radians(self.angle_deg + self.error_deg)
        cos, sin = math.cos(twice), math.sin(twice)
        turn = np.array([[1, 0, 0, 0], [0, cos, sin, 0], [0, -sin, cos, 0], [0, 0, 0, 1]])
        leak = 1 / self.extinction_ratio
        along = 0.5 * np.array([[1 + leak, 1 - leak], [1 - leak, 1 + leak]])
        element = np.zeros((4, 4))
        element[:2, :2], element[2:, 2:] = along, math.sqrt(leak) * np.eye(2)
        matrix: Stokes = turn.T @ element @ turn
        return matrix
