"""Stanford Research SR830 in a rig file."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Literal, Self

from pydantic import Field, model_validator

from acquisition.section import SectionFault, refuse_all
from acquisition.timing import DetectorTiming
from drivers.stanford_sr830.detector import StanfordSr830
from drivers.stanford_sr830.lock_in import TIME_CONSTANTS_S, Settings
from goniometer.rig_devices.connecting import Connecting
from goniometer.rig_devices.entry import MeterEntry

_NOISE_TIME_CONSTANTS = {6: 2.0, 12: 4.0, 18: 16 / 3, 24: 6.4}
"""Over how much time the filter averages white noise, by its slope: 1 / (2 bandwidth), in time constants."""

_QUESTIONS_S = 0.05
"""For filter, condition and samples, at 9600 baud."""


class StanfordSr830Entry(MeterEntry):
    """Stanford Research SR830 (or SR810) lock-in with a photodiode behind a chopper."""

    averages_evenly = False
    driver: Literal["stanford_sr830"] = Field(description="the device's family")
    baudrate: Literal[300, 600, 1200, 2400, 4800, 9600, 19200] = Field(
        default=9600, description="as set in the lock-in; without effect on a socket"
    )
    time_constant_s: float = Field(description="the output filter's time constant, which the lock-in is given, in s")
    slope_db: Literal[6, 12, 18, 24] = Field(
        default=12, description="the output filter's slope, which the lock-in is given, in dB an octave"
    )
    responsivity_v_per_w: float = Field(
        gt=0, le=1e12, description="rms voltage at the chopper's frequency for each watt that reaches the photodiode"
    )
    input: Literal["A", "A-B"] = Field(
        default="A", description="where the photodiode's voltage comes in, which the lock-in is told"
    )
    raises_sensitivity: bool = Field(
        default=False, description="whether an overload raises the full scale and the reading is taken again"
    )

    @model_validator(mode="after")
    def _check_filter(self) -> Self:
        refuse_all(self._filter_faults())
        return self

    def _filter_faults(self) -> Iterator[SectionFault]:
        if self.time_constant_s not in TIME_CONSTANTS_S:
            yield (
                ("time_constant_s",),
                f"got {self.time_constant_s:g}; allowed: {', '.join(f'{known:g}' for known in TIME_CONSTANTS_S)}",
            )
        shortest_s = _NOISE_TIME_CONSTANTS[self.slope_db] * self.time_constant_s
        if self.sample_s < shortest_s and not math.isclose(self.sample_s, shortest_s, rel_tol=1e-6):
            yield (
                ("sample_s",),
                f"got {self.sample_s:g}; allowed: at least {shortest_s:g}, because samples less than "
                f"{_NOISE_TIME_CONSTANTS[self.slope_db]:.3g} time constants apart repeat each other's noise",
            )

    @property
    def most_samples(self) -> int:
        """As many as a reading of an hour has."""
        return max(1, round(3600 / self.sample_s))

    @property
    def timing(self) -> DetectorTiming:
        """Each reading waits until the output filter has settled."""
        return DetectorTiming(self._settings.settling_s + _QUESTIONS_S)

    @property
    def _settings(self) -> Settings:
        return Settings(self.time_constant_s, self.slope_db, self.input)

    def connect(self, name: str, bench: Connecting) -> None:
        """Connect the lock-in."""
        lock_in = StanfordSr830(
            bench.link(name, baudrate=self.baudrate),
            bench.clock,
            name=name,
            responsivity_v_per_w=self.responsivity_v_per_w,
            noise_w=self.noise.read_w,
            settings=self._settings,
            raises_sensitivity=self.raises_sensitivity,
        )
        bench.add(name, lock_in)
        bench.detectors[name] = lock_in
