"""Errors of an encoder: what a controller reports, while motor and light are where they are."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Literal

from pydantic import Field

from sim_devices.bench_devices.entry import AxisRole
from sim_devices.effects.entry import Effect
from sim_devices.effects.measurement import seeded

if TYPE_CHECKING:
    from sim_devices.world import World

_LATCH_S = 0.001


class EncoderEffect(Effect):
    """An effect on what an axis reports."""

    axis: AxisRole = Field(description="the axis whose encoder has it")

    @property
    def title(self) -> str:
        """Its name and the axis."""
        return f"{self.effect} of {self.axis}"


class EncoderNoise(EncoderEffect):
    """Every millisecond the encoder is off by another Gaussian error, a function of seed and time alone."""

    effect: Literal["encoder_noise"] = Field(description="the effect's name")
    stddev_deg: float = Field(gt=0, le=1, description="standard deviation of a reported position, in deg")

    def install(self, world: World) -> None:
        """Disturb what the axis reports."""
        axis, seed, stddev_deg = world.axes[self.axis], world.scene.seed, self.stddev_deg
        position_deg, name = axis.position_deg, f"encoder of {self.axis}"

        def noisy_deg(time_s: float) -> float:
            random = seeded(seed, math.floor(time_s / _LATCH_S), name)
            return position_deg(time_s) + float(random.normal(0.0, stddev_deg))

        axis.position_deg = noisy_deg


class EncoderStep(EncoderEffect):
    """The encoder tells whole steps of its own, coarser than those in which its axis moves."""

    effect: Literal["encoder_step"] = Field(description="the effect's name")
    step_deg: float = Field(gt=0, le=5, description="step of a reported position, in deg")

    def install(self, world: World) -> None:
        """Round what the axis reports."""
        axis, step_deg = world.axes[self.axis], self.step_deg
        position_deg = axis.position_deg

        def rounded_deg(time_s: float) -> float:
            return round(position_deg(time_s) / step_deg) * step_deg

        axis.position_deg = rounded_deg
