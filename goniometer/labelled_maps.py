"""The maps of a stored run as an `xarray.Dataset`: every pixel with its place, its direction and its unit."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import yaml

from acquisition import journal
from goniometer.directions import Directions, directions_at
from goniometer.errors import ConfigurationError, JournalError
from goniometer.rig_file import Rig

if TYPE_CHECKING:
    import h5py
    import xarray

_GROUPS = ("maps", "maps_dolp", "maps_aolp")
_SUFFIXES = {"1/sr": "_per_sr", "1/sr^2": "_per_sr2", "deg": "_deg", "mm": "_mm", "pixel": "_px"}
_ANGLES = {
    "incidence_angle": "incidence_deg",
    "exit_angle": "exit_deg",
    "sample_azimuth": "azimuth_deg",
    "exit_azimuth": "exit_azimuth_deg",
}


def load_maps(run: str | Path) -> xarray.Dataset:
    """Read the maps of a run with labelled dimensions.

    Parameters
    ----------
    run : str or Path
        The run's folder, or the journal in it; its maps are in the `scan.nxs` that was written with its results.

    Returns
    -------
    xarray.Dataset
        Directions have the dimensions that `load` gives them: `exit_deg`, and other angles where these take several
        values, or `point` alone when not every combination was measured exactly once. Beside them `y_mm` and `x_mm` in
        the sample's coordinates, or `y_px` and `x_px` in the camera's pixels. Variables are named with their units,
        such as `s0_per_sr`, `s0_stderr_per_sr`, `dolp` and `aolp_deg`; NaN where nothing is known, and `notes` says why
        a direction has no maps.

    Raises
    ------
    ConfigurationError
        When xarray is not installed.
    JournalError
        When the run has no maps, or its file cannot be read.
    """
    try:
        import xarray
    except ImportError as error:
        raise ConfigurationError(
            [
                "goniometer.load_maps returns an xarray.Dataset, and xarray is not installed. Nothing was read. "
                "Run: pip install 'goniometer[xarray]', or read the run's scan.nxs."
            ]
        ) from error
    import h5py

    folder = Path(run)
    path = (folder.parent if folder.name == journal.FILE_NAME else folder) / "scan.nxs"
    try:
        with h5py.File(path) as file:
            groups = _groups(file, path)
            directions = _directions(groups[0], _rig(file, path))
            found = xarray.Dataset({name: value for group in groups for name, value in _variables(group, directions)})
    except OSError as error:
        raise JournalError(
            f"{path} cannot be read: {error}. Write it again with: goniometer fit {path.parent}"
        ) from error
    return found.set_coords([*directions.coordinates])


def _groups(file: h5py.File, path: Path) -> list[h5py.Group]:
    entry = file["entry"]
    if "maps" not in entry or entry["maps"].attrs["NX_class"] != "NXdata":
        raise JournalError(
            f"{path} holds no maps: the recipe asks for none (imaging), or no direction has any; see its notes."
        )
    return [entry[name] for name in _GROUPS]


def _rig(file: h5py.File, path: Path) -> Rig:
    """The rig of the scan, which knows how far from its target each axis may stop."""
    if "entry/provenance/rig" not in file:
        raise JournalError(
            f"{path} does not say which rig its maps were taken on. Write it again with: goniometer fit {path.parent}"
        )
    return Rig.model_validate(yaml.safe_load(file["entry/provenance/rig/data"][()]))


def _directions(maps: h5py.Group, rig: Rig) -> Directions:
    read_deg = {name: maps[stored][()] for stored, name in _ANGLES.items() if stored in maps}
    return directions_at(read_deg, maps["point"][()], {role: axis.tolerance_deg for role, axis in rig.axes().items()})


def _variables(group: h5py.Group, directions: Directions) -> Iterator[tuple[str, Any]]:
    """Names with units, dimensions and values; the axes of all groups are the same."""
    _, *pixels = (str(axis) for axis in group.attrs["axes"])
    inner = [_named(axis, group[axis].attrs["units"]) for axis in pixels]
    for name, values in group.items():
        attributes = {key: str(values.attrs[key]) for key in ("long_name", "units") if key in values.attrs}
        if name in pixels:
            one = _named(name, attributes["units"])
            yield one, ([one], values[()], attributes)
            continue
        found = _ANGLES.get(name) or ("notes" if name == "notes" else _named(name, attributes["units"]))
        if found in directions.coordinates:
            yield found, (*directions.coordinates[found], attributes)
        else:
            stored = values.asstr()[()] if name == "notes" else values[()]
            dims = [*directions.dimensions, *inner[: values.ndim - 1]]
            yield found, (dims, directions.arranged(stored), attributes)


def _named(name: str, units: str) -> str:
    """A name as the project writes it: S0_errors in 1/sr is s0_stderr_per_sr."""
    return name.lower().replace("_errors", "_stderr").replace("_angle", "") + _SUFFIXES.get(units, "")
