"""Filters before the sample: which light there is at a time, whatever turns the wheel that holds them."""

from __future__ import annotations

from collections.abc import Mapping

from pydantic import Field

from sim_devices.scene_part import ScenePart
from sim_devices.wheel import Wheel


class Filter(ScenePart):
    """A filter: the light that it lets through."""

    wavelength_nm: float = Field(ge=200, le=2000, description="wavelength of the light behind it, in nm")
    transmission: float = Field(default=1.0, gt=0, le=1, description="share of the lamp's power behind it")


class Filters:
    """Filters in a wheel; a slot that is not named lets nothing through.

    Parameters
    ----------
    filters : mapping of int to Filter
        By slot; at least one.

    Attributes
    ----------
    wheel : Wheel
        What turns.
    """

    def __init__(self, filters: Mapping[int, Filter]) -> None:
        self.wheel = Wheel()
        self._filters = filters
        self._first = next(iter(filters.values()))

    def in_beam(self, time_s: float) -> Filter | None:
        """The filter that the light passes; None while the wheel turns, or in a slot without one."""
        return self._filters.get(self.wheel.slot(time_s) or 0)

    def wavelength_nm(self, time_s: float) -> float:
        """The wavelength of the light; where there is none, that of the first filter."""
        return (self.in_beam(time_s) or self._first).wavelength_nm
