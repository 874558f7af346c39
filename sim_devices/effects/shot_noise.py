"""The statistics of counting photons."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from pydantic import Field

from sim_devices.effects.entry import Effect
from sim_devices.effects.measurement import Measurement

if TYPE_CHECKING:
    from sim_devices.world import World

_PLANCK_J_S = 6.62607015e-34
_LIGHT_SPEED_M_S = 299792458.0


class ShotNoise(Effect):
    """The statistics of counting photons."""

    effect: Literal["shot_noise"] = Field(description="the effect's name")

    def install(self, world: World) -> None:
        """Count photons: a Poisson number, so the variance is power times photon energy over exposure."""
        signal_w = world.signal_w
        wavelength_nm = world.wavelength_nm

        def counted_w(measurement: Measurement) -> float:
            photon_j = _PLANCK_J_S * _LIGHT_SPEED_M_S / (wavelength_nm(measurement.middle_s) * 1e-9)
            photon_w = photon_j / measurement.exposure_s
            return float(measurement.random.poisson(signal_w(measurement) / photon_w)) * photon_w

        world.signal_w = counted_w
