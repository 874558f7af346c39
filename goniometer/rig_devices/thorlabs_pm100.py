"""Thorlabs PM100 family in a rig file."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from drivers.thorlabs_pm100.meter import ThorlabsPm100
from goniometer.rig_devices.connecting import Connecting
from goniometer.rig_devices.entry import DetectorEntry


class ThorlabsPm100Entry(DetectorEntry):
    """Thorlabs PM100-family power meter."""

    driver: Literal["thorlabs_pm100"] = Field(description="the device's family")

    @property
    def most_samples(self) -> int:
        """Samples that the meter averages at most."""
        return 3000

    def connect(self, name: str, bench: Connecting) -> None:
        """Connect the meter and tell it the wavelength."""
        meter = ThorlabsPm100(bench.link(name), bench.clock, name=name, sample_s=self.sample_s)
        bench.note(name, bench.opened(meter).connect())
        if bench.wavelength_nm is not None:
            meter.set_wavelength_nm(bench.wavelength_nm)
        bench.detectors[name] = meter
