"""Filters that choose the wavelength, of which a detector is told."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from acquisition.protocols import Analyzer, Detector
from acquisition.selector import Selector


@dataclass(frozen=True)
class Filters:
    """A wheel of filters, which is turned and asked as an analyzer is, and the wavelength in nm of each slot."""

    wheel: Analyzer
    wavelengths_nm: Mapping[int, float]

    def selector(self) -> Selector:
        """What brings a filter into the beam, and sees that it stays."""
        held = {slot: f"{wavelength_nm:g} nm" for slot, wavelength_nm in self.wavelengths_nm.items()}
        return Selector(self.wheel, "wheel of filters", held)


@runtime_checkable
class WavelengthCorrected(Protocol):
    """A detector whose readings are corrected for the wavelength of the light."""

    def set_wavelength_nm(self, wavelength_nm: float) -> None:
        """Set the wavelength and read it back; raises DeviceError when the detector does not hold it."""
        ...


class ToldWavelength:
    """Tells a detector the wavelength behind the filter in the beam, where its readings depend on it.

    Parameters
    ----------
    filters : Filters
        The wheel.
    detector : Detector
        Who is told, once for each change.
    """

    def __init__(self, filters: Filters, detector: Detector) -> None:
        self._filters, self._detector = filters, detector
        self._told: int | None = None

    def forget(self) -> None:
        """Take nothing for granted: a detector that was away may have forgotten it."""
        self._told = None

    def tell(self, slot: int) -> None:
        """Tell it of the filter in a slot, which has come to rest; raises DeviceError when it does not take it."""
        if self._told == slot:
            return
        if isinstance(self._detector, WavelengthCorrected):
            self._detector.set_wavelength_nm(self._filters.wavelengths_nm[slot])
        self._told = slot
