"""Thorlabs PM100 family in a rig file."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from acquisition.timing import DetectorTiming
from drivers.thorlabs_pm100.meter import ThorlabsPm100
from goniometer.rig_devices.connecting import Connecting
from goniometer.rig_devices.entry import MeterEntry

_EXCHANGE_S = 0.002
"""A question and its answer, over USB."""


class ThorlabsPm100Entry(MeterEntry):
    """Thorlabs PM100-family power meter."""

    driver: Literal["thorlabs_pm100"] = Field(description="the device's family")
    baudrate: Literal[9600, 19200, 38400, 57600, 115200, 230400, 460800, 921600] = Field(
        default=115200, description="as set in a meter with a serial line; without effect on a socket or on USB"
    )
    attenuation_db: float = Field(
        default=0.0,
        ge=-60,
        le=60,
        description="attenuator before the sensor for which the meter is set to correct its readings, in dB",
    )

    @property
    def most_samples(self) -> int:
        """Samples that the meter averages at most."""
        return 3000

    @property
    def timing(self) -> DetectorTiming:
        """Behind a single sample the meter is also asked for its wavelength: a meter that was reset averages none."""
        return DetectorTiming(sample_s=self.sample_s, single_s=_EXCHANGE_S)

    def connect(self, name: str, bench: Connecting) -> None:
        """Connect the meter and tell it the wavelength."""
        meter = ThorlabsPm100(
            bench.link(name, baudrate=self.baudrate),
            bench.clock,
            name=name,
            sample_s=self.sample_s,
            attenuation_db=self.attenuation_db,
        )
        bench.add(name, meter)
        if bench.wavelength_nm is not None:
            meter.set_wavelength_nm(bench.wavelength_nm)
        bench.detectors[name] = meter
