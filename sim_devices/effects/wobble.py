"""A wheel that never comes to rest at quite the same angle."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import TYPE_CHECKING, Literal

from pydantic import Field

from sim_devices.analyzer import Row, WheelAnalyzer, turned
from sim_devices.bench_devices.entry import Slot
from sim_devices.effects.entry import Effect
from sim_devices.effects.measurement import seeded

if TYPE_CHECKING:
    from sim_devices.world import World


class WheelWobble(Effect):
    """Each arrival of the wheel turns what it brings into the beam by another Gaussian error, until it turns again."""

    effect: Literal["wheel_wobble"] = Field(description="the effect's name")
    stddev_deg: float = Field(gt=0, le=10, description="standard deviation of an arrival's angle, in deg")

    def faults(self, slots: Mapping[int, Slot]) -> tuple[str, ...]:
        """An analyzer that is no wheel."""
        return () if slots else (f"{self.effect}: the analyzer is no wheel",)

    def install(self, world: World) -> None:
        """Turn the analyzer's row by the arrival's error."""
        steady_row, analyzer = world.row, world.analyzer
        seed, stddev_deg = world.scene.seed, self.stddev_deg
        # a scene whose analyzer is no wheel has been refused
        assert isinstance(analyzer, WheelAnalyzer)
        wheel = analyzer.wheel

        # several readings are taken after an arrival
        @lru_cache(maxsize=1)
        def error_deg(arrival: int) -> float:
            return float(seeded(seed, arrival, "wheel").normal(0.0, stddev_deg))

        def row(time_s: float) -> Row | None:
            steady = steady_row(time_s)
            return None if steady is None else turned(steady, error_deg(wheel.arrival(time_s)))

        world.row = row
