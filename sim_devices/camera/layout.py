"""A plate as it is drawn: inks, and the layers that they lie in."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from sim_devices.camera.layers import Boxes, Cells, FloatArray, Layer, summed, sums
from sim_devices.sample import Sample


@dataclass(frozen=True)
class Lambertian:
    """Ink that scatters alike in all directions, and depolarizes: F is albedo/pi, in its first element alone."""

    albedo: float


@dataclass(frozen=True)
class Rough:
    """A surface of the model; with `mapped` its sigma is that of the plate's roughness map."""

    sample: Sample
    mapped: bool = False


Ink = Lambertian | Rough

DARKNESS = Lambertian(0.0)


@dataclass(frozen=True, eq=False)
class Roughness:
    """How rough the plate is where.

    Parameters
    ----------
    place : Cells
        Where the map lies, which is all of the plate.
    sigma : ndarray
        Of each cell, (rows, columns).
    """

    place: Cells
    sigma: FloatArray

    def mean(self, boxes: Boxes) -> FloatArray:
        """Mean sigma of the cells that boxes touch, (N,)."""
        top, bottom, left, right = self.place.cells(boxes)
        whole = sums(self._table, top, bottom + 1, left, right + 1)
        return whole / ((bottom + 1 - top) * (right + 1 - left))

    @cached_property
    def _table(self) -> FloatArray:
        return summed(self.sigma)


@dataclass(frozen=True)
class Layout:
    """What lies where on a plate.

    Parameters
    ----------
    inks : tuple of Ink
        What layers count from 0; the first is what shows where no layer has one.
    layers : tuple of Layer
        From the lowest to the uppermost.
    roughness : Roughness or None
        What takes the place of sigma in the inks that are mapped.
    """

    inks: tuple[Ink, ...]
    layers: tuple[Layer, ...]
    roughness: Roughness | None = None
