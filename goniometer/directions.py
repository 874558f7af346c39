"""How the directions of a scan lie: on a full grid of angles, or one by one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquisition.readings import StokesPoint
from goniometer.rig_devices.entry import Role

_AXES: dict[str, Role] = {
    "incidence_deg": "source_arm",
    "exit_deg": "detector_arm",
    "azimuth_deg": "sample_azimuth",
    "exit_azimuth_deg": "detector_azimuth",
}
"""The angles of a direction; a bench that cannot turn its detector arm out of the plane has no exit azimuth."""

Coordinates = dict[str, tuple[tuple[str, ...], NDArray[Any]]]
"""By name: dimensions and values."""


@dataclass(frozen=True)
class Directions:
    """Dimensions of a scan's directions, coordinates along them, and how values of its points are arranged.

    Attributes
    ----------
    dimensions : tuple of str
        `exit_deg`, and the other angles where these take several values; or `point` alone.
    coordinates : dict
        Of the angles and of the number of the point.
    """

    dimensions: tuple[str, ...]
    coordinates: Coordinates
    _order: NDArray[np.intp]
    _shape: tuple[int, ...]

    @property
    def angles(self) -> tuple[str, ...]:
        """Names of the angles."""
        return tuple(_AXES)

    def arranged(self, values: NDArray[Any]) -> NDArray[Any]:
        """Values of the points, shape (points, ...), on the dimensions of the directions."""
        return values[self._order].reshape(*self._shape, *values.shape[1:])


def directions_of(points: Sequence[StokesPoint], tolerances_deg: Mapping[Role, float]) -> Directions:
    """Whether directions are a full grid, every combination of angles measured exactly once, and where each belongs.

    Parameters
    ----------
    points : sequence of StokesPoint
        The directions as they were read back.
    tolerances_deg : mapping of Role to float
        How far from its target an axis may stop: positions no farther apart than twice that are the same angle.
    """
    names = [name for name in _AXES if getattr(points[0], name) is not None]
    read_deg = {name: np.array([getattr(point, name) for point in points]) for name in names}
    return directions_at(read_deg, np.array([point.point for point in points]), tolerances_deg)


def directions_at(
    read_deg: Mapping[str, NDArray[np.float64]], numbers: NDArray[np.int_], tolerances_deg: Mapping[Role, float]
) -> Directions:
    """As `directions_of`, from angles as they were read back, by name, and the numbers of their points."""
    axes = {name: role for name, role in _AXES.items() if name in read_deg}
    level_of = {name: levels(read_deg[name], 2.0 * tolerances_deg[role]) for name, role in axes.items()}
    counts = {name: int(level.max()) + 1 for name, level in level_of.items()}
    shape = tuple(counts.values())
    cells = np.ravel_multi_index(tuple(level_of.values()), shape)
    if cells.size != np.prod(shape) or np.unique(cells).size != cells.size:
        coordinates: Coordinates = {name: (("point",), values) for name, values in read_deg.items()}
        coordinates["point"] = (("point",), numbers)
        return Directions(("point",), coordinates, np.arange(numbers.size), (numbers.size,))
    dimensions = tuple(name for name in axes if counts[name] > 1 or name == "exit_deg")
    order = np.argsort(cells)
    coordinates = {}
    for name, values in read_deg.items():
        means = np.bincount(level_of[name], values) / np.bincount(level_of[name])
        coordinates[name] = ((name,), means) if name in dimensions else ((), means[0])
    sizes = tuple(counts[name] for name in dimensions)
    coordinates["point"] = (dimensions, numbers[order].reshape(sizes))
    return Directions(dimensions, coordinates, order, sizes)


def levels(values: NDArray[np.float64], same: float) -> NDArray[np.intp]:
    """Which angle each value belongs to, counted from the smallest; a gap larger than `same` parts two angles."""
    order = np.argsort(values, kind="stable")
    levels = np.empty(values.size, np.intp)
    levels[order] = np.concatenate([[0], np.cumsum(np.diff(values[order]) > same)])
    return levels
