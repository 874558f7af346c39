"""Stanford Research SR830 in a rig file."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from drivers.stanford_sr830 import StanfordSr830
from goniometer.rig_devices.connecting import Connecting
from goniometer.rig_devices.entry import DetectorEntry


class StanfordSr830Entry(DetectorEntry):
    """Stanford Research SR830 (or SR810) lock-in with a photodiode behind a chopper."""

    driver: Literal["stanford_sr830"] = Field(description="the device's family")
    baudrate: Literal[300, 600, 1200, 2400, 4800, 9600, 19200] = Field(
        default=9600, description="as set in the lock-in; without effect on a socket"
    )
    responsivity_v_per_w: float = Field(
        gt=0, le=1e12, description="rms voltage at the chopper's frequency for each watt that reaches the photodiode"
    )
    raises_sensitivity: bool = Field(
        default=False, description="whether an overload raises the full scale and the reading is taken again"
    )

    @property
    def most_samples(self) -> int:
        """As many as a reading of an hour has."""
        return max(1, round(3600 / self.sample_s))

    def connect(self, name: str, bench: Connecting) -> None:
        """Connect the lock-in."""
        lock_in = StanfordSr830(
            bench.link(name, baudrate=self.baudrate),
            bench.clock,
            name=name,
            responsivity_v_per_w=self.responsivity_v_per_w,
            raises_sensitivity=self.raises_sensitivity,
        )
        bench.note(name, bench.opened(lock_in).connect())
        bench.detectors[name] = lock_in
