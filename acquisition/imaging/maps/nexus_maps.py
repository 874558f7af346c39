"""Maps in a NeXus file: Stokes parameters, DoLP and AoLP of every pixel in every direction."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from acquisition.imaging.maps.direction_maps import DirectionMaps
from acquisition.imaging.maps.nexus_map_fields import DIMENSIONLESS, OWN_DIRECTIONS, kinds, write_pixels
from acquisition.nexus_fields import EXIT_AZIMUTH, field, group
from goniometer.errors import ReductionError

if TYPE_CHECKING:
    import h5py

_TILE_PX = 256
"""Width of what is compressed together: a pixel in all directions is read without the rest of the maps."""
_COMPRESSED = {"compression": "gzip", "compression_opts": 1, "shuffle": True}


def write_maps(entry: h5py.Group, maps: Iterable[DirectionMaps]) -> None:
    """Write NXdata `maps`, with S0 for a signal and S1 to S3 beside it, `maps_dolp` and `maps_aolp`.

    Datasets are (direction, y, x) of float32, NaN where a pixel is flagged or a direction has no maps; `notes` in
    `maps` says why. Where no direction has maps, `maps` is an NXcollection of the directions and notes.

    Parameters
    ----------
    entry : h5py.Group
        The file's NXentry.
    maps : iterable of DirectionMaps
        In the order of the directions; each is written before the next is asked for.

    Raises
    ------
    ReductionError
        If maps differ in size, place, unit or in what they hold, or hold what no file has a place for.
    """
    planes: _Planes | None = None
    written: list[_Where] = []
    for one in maps:
        if planes is None and one.maps:
            planes = _Planes(entry, one)
        if planes is not None and one.maps:
            planes.write(len(written), one)
        written.append(_Where(one))
    if not written:
        return
    where = group(entry, "maps", "NXcollection") if planes is None else planes.groups["maps"]
    axes = _write_directions(where, written)
    if planes is not None:
        planes.finish(axes, len(written))


class _Where:
    """What is kept of a direction once its maps are written."""

    def __init__(self, maps: DirectionMaps) -> None:
        self.point, self.notes = maps.point, " ".join(maps.notes)
        self.angles = (maps.exit_deg, maps.incidence_deg, maps.azimuth_deg)
        self.exit_azimuth_deg = maps.exit_azimuth_deg


class _Planes:
    """The datasets, which grow by a plane for each direction."""

    def __init__(self, entry: h5py.Group, first: DirectionMaps) -> None:
        self._point, self._layout = first.point, _layout(first)
        known = kinds(first)
        unknown = [name for name in first.maps if name not in known]
        if unknown:
            raise ReductionError(
                f"There is no place in a NeXus file for maps called {', '.join(unknown)}. The maps were not written. "
                f"Ask for {', '.join(known)}."
            )
        self._kinds = {name: known[name] for name in known if name in first.maps}
        if first.pixel_directions is not None:
            self._kinds |= OWN_DIRECTIONS
        self.groups: dict[str, h5py.Group] = {}
        height, width = first.maps["S0"].shape
        for kind in self._kinds.values():
            if kind.group not in self.groups:
                self._new_group(entry, kind.group)
                write_pixels(self.groups[kind.group], first.grid, (height, width))
            dataset = self.groups[kind.group].create_dataset(
                kind.field,
                shape=(0, height, width),
                maxshape=(None, height, width),
                chunks=(1, min(height, _TILE_PX), min(width, _TILE_PX)),
                dtype=np.float32,
                fillvalue=np.nan,
                **_COMPRESSED,
            )
            dataset.attrs["units"] = kind.units
            if kind.long_name:
                dataset.attrs["long_name"] = kind.long_name

    def _new_group(self, entry: h5py.Group, name: str) -> None:
        made = group(entry, name, "NXdata")
        signals = [kind.field for kind in self._kinds.values() if kind.group == name and kind.is_signal]
        made.attrs.update(signal=signals[0], axes=["exit_angle", "y", "x"])
        if len(signals) > 1:
            made.attrs["auxiliary_signals"] = signals[1:]
        self.groups[name] = made

    def write(self, number: int, maps: DirectionMaps) -> None:
        """Write the planes of a direction."""
        self._refuse_other(maps)
        for name, kind in self._kinds.items():
            dataset = self.groups[kind.group][kind.field]
            dataset.resize(number + 1, axis=0)
            values = maps.maps[name] if name in maps.maps else getattr(maps.pixel_directions, name)
            dataset[number] = kind.stored(values)

    def finish(self, axes: list[str], count: int) -> None:
        """Let every group have the axes of its directions, and every field as many planes."""
        for kind in self._kinds.values():
            self.groups[kind.group][kind.field].resize(count, axis=0)
        for made in self.groups.values():
            for name in axes:
                if name not in made:
                    made[name] = self.groups["maps"][name]
                made.attrs[f"{name}_indices"] = 0
            made.attrs.update(y_indices=1, x_indices=2)

    def _refuse_other(self, maps: DirectionMaps) -> None:
        for what, here in _layout(maps).items():
            if here != self._layout[what]:
                raise ReductionError(
                    f"The maps of direction {maps.point} differ in {what} from those of direction {self._point}: "
                    f"{here}, not {self._layout[what]}. The maps were not written. Reduce all directions alike."
                )


def _layout(maps: DirectionMaps) -> dict[str, object]:
    """What has to be alike in all directions."""
    return {
        "size": maps.shape,
        "grid": maps.grid,
        "being calibrated": maps.is_calibrated,
        "maps": sorted(maps.maps),
        "having directions of their own": maps.pixel_directions is not None,
    }


def _write_directions(where: h5py.Group, written: list[_Where]) -> list[str]:
    axes = ["exit_angle", "incidence_angle", "sample_azimuth", "point"]
    exit_deg, incidence_deg, azimuth_deg = zip(*(one.angles for one in written), strict=True)
    field(where, "exit_angle", exit_deg, "deg", "signed exit angle")
    field(where, "incidence_angle", incidence_deg, "deg")
    field(where, "sample_azimuth", azimuth_deg, "deg")
    if any(one.exit_azimuth_deg is not None for one in written):
        field(where, "exit_azimuth", [one.exit_azimuth_deg or 0.0 for one in written], "deg", EXIT_AZIMUTH)
        axes.append("exit_azimuth")
    field(where, "point", [one.point for one in written], DIMENSIONLESS)
    where["notes"] = [one.notes for one in written]
    return axes
