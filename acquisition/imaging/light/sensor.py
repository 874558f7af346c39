"""What must be known of a camera's sensor before its counts mean light."""

from __future__ import annotations

import math
from dataclasses import dataclass

from acquisition.imaging.light.linearity import Linearity
from acquisition.imaging.stokes.pixel_formula import SensorNoise
from drivers.camera.saturation import saturated_from
from goniometer.errors import ConfigurationError

_QUANTIZATION = 1 / 12
"""Variance that rounding to whole counts adds, in counts² (EMVA Standard 1288, release 4.0)."""


@dataclass(frozen=True)
class Sensor:
    """Figures of a sensor at one gain, from which those at other gains follow.

    Parameters
    ----------
    noise : SensorNoise
        Its `read_counts` without the noise of the dark current where darks of several exposures are given, which show
        how large that is. A figure below 1/√12 cannot have the quantization among it, which is then added.
    saturation_counts : int
        Counts as read from which on a pixel says nothing.
    bits : int
        Of the counts: those of other depths are other counts.
    gain_db : float
        At which all figures hold.
    linearity : Linearity, optional
        Where counts are not in proportion to charge; it holds for this one gain only.
    black_counts : float
        As read without light in no time, whatever the gain; subtracted where there are no dark frames.

    Raises
    ------
    ConfigurationError
        Names every figure that cannot be.
    """

    noise: SensorNoise
    saturation_counts: int
    bits: int = 16
    gain_db: float = 0.0
    linearity: Linearity | None = None
    black_counts: float = 0.0

    def __post_init__(self) -> None:
        faults = []
        if not 1 <= self.bits <= 16:
            faults.append(f"bits: {self.bits}; cameras have 1 to 16.")
        elif not 0 < self.saturation_counts < 1 << self.bits:
            faults.append(
                f"saturation_counts: {self.saturation_counts}; a pixel of {self.bits} bits ends at "
                f"{(1 << self.bits) - 1} counts and says nothing there: it must be 1 to that."
            )
        if not 0.0 <= self.noise.read_counts < math.inf:
            faults.append(f"read_counts: {self.noise.read_counts}; it must be 0 or more.")
        if not 0.0 < self.noise.electrons_per_count < math.inf:
            faults.append(f"electrons_per_count: {self.noise.electrons_per_count}; it must be above 0.")
        if self.linearity is not None and self.linearity.largest_counts < self.saturation_counts - 1:
            faults.append(
                f"linearity: ends at {self.linearity.largest_counts:g} counts read; "
                f"it must go up to saturation at {self.saturation_counts}."
            )
        if faults:
            raise ConfigurationError(faults)

    @property
    def true_black_counts(self) -> float:
        """The black level as the table of linearity has it."""
        return self.black_counts if self.linearity is None else self.linearity.true_level(self.black_counts)

    def amplification(self, gain_db: float) -> float:
        """How many times the counts at the gain of the figures those at another gain are."""
        return _ratio(gain_db - self.gain_db)

    def saturation(self, gain_db: float) -> int:
        """Counts as read from which on a pixel says nothing."""
        return saturated_from(self.saturation_counts, gain_db - self.gain_db)

    def electrons_per_count(self, gain_db: float) -> float:
        """How many electrons a true count at a gain stands for."""
        return self.noise.electrons_per_count / self.amplification(gain_db)

    def read_variance(self, gain_db: float) -> float:
        """Variance of counts as read without light, in counts² (the linear model of EMVA 1288, release 4.0).

        It is amplified with the signal, except what the quantization makes of it.
        """
        read = self.noise.read_counts**2
        before = read - _QUANTIZATION if read >= _QUANTIZATION else read
        return before * self.amplification(gain_db) ** 2 + _QUANTIZATION


def from_0_db(gain_db: float) -> float:
    """How many times the counts at gain 0 dB those at a gain are."""
    return _ratio(gain_db)


def _ratio(gain_db: float) -> float:
    return float(10.0 ** (gain_db / 20.0))
