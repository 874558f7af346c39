"""Measured Stokes parameters out of a NeXus file that `acquisition.nexus` wrote."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from acquisition.fit_points import directions
from goniometer.errors import FitError, JournalError
from model.fit import Dataset
from model.fit.observable import MUELLER, Elements
from model.geometry import FloatArray

if TYPE_CHECKING:
    import h5py

_POINTS, _MUELLER, _PROVENANCE = "entry/stokes", "entry/mueller", "entry/provenance"


def read_measured_nexus(path: Path) -> tuple[Dataset, dict[str, str]]:
    """Read the reduced points of a scan, and the texts that the file keeps of where they came from.

    Parameters
    ----------
    path : Path
        A scan.nxs.

    Returns
    -------
    data : Dataset
        The same numbers as the run's, named by the file.
    about : dict of str to str
        Recipe, rig, scene and versions; empty if the file has none.

    Raises
    ------
    JournalError
        If the file cannot be read, or is no HDF5 file.
    FitError
        If it lacks the points, or they have another form than a scan's.
    """
    import h5py  # 0.1 s that a table does not need

    try:
        with h5py.File(path, "r") as file:
            return _data(file, path), _about(file)
    except (OSError, KeyError, RuntimeError) as error:  # the last two are how HDF5 meets damaged bytes
        raise JournalError(
            f"{path} cannot be read as a NeXus file: {error}. Nothing was fitted. Write it again from the run: "
            "goniometer fit RUN"
        ) from error


def _data(file: h5py.File, path: Path) -> Dataset:
    if _MUELLER in file:
        return _mueller(file, path)
    count = 4 if f"{_POINTS}/S3" in file else 3
    stokes = [_numbers(file, f"S{place}", "1/sr", 1, path) for place in range(count)]
    covariance = _numbers(file, "covariance", "1/sr^2", 3, path)
    incidence_deg, exit_deg = (_numbers(file, name, "deg", 1, path) for name in ("incidence_angle", "exit_angle"))
    rows = len(exit_deg)
    expected = (rows, count, count)
    if {len(incidence_deg), *map(len, stokes)} != {rows} or covariance.shape != expected:
        raise FitError(
            f"{path}: the arrays of {_POINTS} differ in length, or its covariance, of shape {covariance.shape}, is not "
            f"{expected}. Nothing was fitted. Write the file again from the run: goniometer fit RUN"
        )
    if f"{_POINTS}/wavelength" in file and np.ptp(_numbers(file, "wavelength", "nm", 1, path)) > 0.0:
        raise FitError(
            f"{path} holds several wavelengths, and a surface has one refractive index in a fit. Nothing was fitted. "
            "Fit the run itself, or a table (.csv) with the rows of one wavelength."
        )
    observable = Elements(tuple(range(count)))
    exit_azimuth_deg = np.zeros(rows)
    if f"{_POINTS}/exit_azimuth" in file:
        exit_azimuth_deg = _numbers(file, "exit_azimuth", "deg", 1, path)
    there = directions(incidence_deg, exit_deg, exit_azimuth_deg=exit_azimuth_deg)
    return Dataset(*there, np.stack(stokes, axis=1), covariance, observable, name=path.name)


def _mueller(file: h5py.File, path: Path) -> Dataset:
    """The Mueller matrices, which say all that the Stokes parameters do."""
    mueller = _numbers(file, "M", "1/sr", 3, path, _MUELLER)
    covariance = _numbers(file, "covariance", "1/sr^2", 3, path, _MUELLER)
    where = [_numbers(file, name, "deg", 1, path, _MUELLER) for name in ("incidence_angle", "exit_angle")]
    count, rows, columns = mueller.shape
    expected = (count, rows * columns, rows * columns)
    if {len(angles) for angles in where} != {count} or covariance.shape != expected or max(rows, columns) > 4:
        raise FitError(
            f"{path}: the arrays of {_MUELLER} differ in length, or its covariance, of shape {covariance.shape}, is "
            f"not {expected}. Nothing was fitted. Write the file again from the run: goniometer fit RUN"
        )
    picked = tuple(4 * row + column for row in range(rows) for column in range(columns))
    values = mueller.reshape(count, -1)
    return Dataset(*directions(*where), values, covariance, Elements(picked, MUELLER), name=path.name)


def _numbers(file: h5py.File, name: str, units: str, dimensions: int, path: Path, group: str = _POINTS) -> FloatArray:
    import h5py

    place = f"{group}/{name}"
    found = file.get(place)
    if not isinstance(found, h5py.Dataset) or found.dtype.kind != "f" or found.ndim != dimensions:
        what = "is missing" if found is None else "is not an array of numbers, or not of as many dimensions as a scan's"
    elif found.attrs.get("units") != units:
        what = f"is in {found.attrs.get('units')}; a scan's is in {units}"
    else:
        return np.asarray(found[()], np.float64)
    raise FitError(
        f"{path}: {place} {what}. Nothing was fitted. Only files that a run wrote (scan.nxs) can be read; write other "
        "data as a table (.csv)."
    )


def _about(file: h5py.File) -> dict[str, str]:
    """The notes of the group of provenance, as far as they are texts."""
    import h5py

    about = {}
    notes = file.get(_PROVENANCE)
    for note in notes.values() if isinstance(notes, h5py.Group) else ():
        if isinstance(note, h5py.Group) and isinstance(note.get("data"), h5py.Dataset) and "description" in note:
            key, text = note["description"][()], note["data"][()]
            if isinstance(key, bytes) and isinstance(text, bytes):
                about[key.decode(errors="replace")] = text.decode(errors="replace")
    return about
